"""The clock of the flying service: whole microseconds of Unix time that never step."""

import time
from typing import Protocol


class Clock(Protocol):
    """The clock that the service needs; a simulated one may run faster than real time."""

    def now_us(self) -> int:
        """Unix time [us]; never runs backwards."""

    def wall_seconds_until(self, time_us: int) -> float:
        """How long to sleep until `time_us` [s of real time]; 0 when it is past."""


class SteadyClock:
    """Unix time read once, then advanced by the monotonic clock: setting the system time has no effect."""

    def __init__(self) -> None:
        self._start_us = time.time_ns() // 1000
        self._start_ns = time.monotonic_ns()

    def now_us(self) -> int:
        """Unix time [us]."""
        return self._start_us + (time.monotonic_ns() - self._start_ns) // 1000

    def wall_seconds_until(self, time_us: int) -> float:
        """Seconds until `time_us`; 0 when it is past."""
        return max((time_us - self.now_us()) / 1e6, 0.0)
