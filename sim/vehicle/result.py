"""The answers to commands that the fakes give (MAV_RESULT)."""

from enum import IntEnum


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    COMMAND_LONG_ONLY = 7
    COMMAND_INT_ONLY = 8
