"""Bytes to frames, frames to messages, messages to facts; and telemetry logs."""
