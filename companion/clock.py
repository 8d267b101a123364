"""The clock of the flying service: whole microseconds of Unix time that never step."""

import time
from typing import Protocol


class Clock(Protocol):
    """What the shell needs of a clock; a simulated one may run faster than the wall's."""

    def now_us(self) -> int:
        """Unix time [us]; never runs backwards."""

    def wall_seconds_until(self, time_us: int) -> float:
        """How long to sleep, in seconds of the wall, until that time comes; 0 when it is past."""


class SteadyClock:
    """Unix time as read once, advanced by the monotonic clock: setting the system's time changes nothing."""

    def __init__(self) -> None:
        self._start_us = time.time_ns() // 1000
        self._start_ns = time.monotonic_ns()

    def now_us(self) -> int:
        """Unix time [us]."""
        return self._start_us + (time.monotonic_ns() - self._start_ns) // 1000

    def wall_seconds_until(self, time_us: int) -> float:
        """Seconds until that time."""
        return max((time_us - self.now_us()) / 1e6, 0.0)
