"""Bytes to frames, frames to messages, messages to facts; and logs of all that."""
