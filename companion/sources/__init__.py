"""Receivers of traffic that do not speak MAVLink: the bytes of each format to facts, one file a format."""

from companion.sources.decoder import Decoder, DecoderCounters

__all__ = ["Decoder", "DecoderCounters"]
