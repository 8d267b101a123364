"""A simulation clock: Unix time that may run faster than real time, shared within one process."""

import asyncio
import math
import time
from collections.abc import Callable

_MICROSECONDS = 1_000_000


class ScaledClock:
    """Unix time in whole microseconds, `speedup` times as fast as real time; never backwards.

    `hold_at` sets a time at which the clock stops until the next call; of the times of several holders the
    first counts. `slipped_s` is the time lost by that: on a machine that is too slow for the speedup the
    clock waits, so that nothing flies on old data.
    """

    def __init__(
        self,
        speedup: float = 1.0,
        *,
        start_s: float | None = None,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Start at `start_s`, by default now."""
        if not (math.isfinite(speedup) and speedup > 0.0):
            raise ValueError(f"speedup {speedup} is not a positive number")
        self.speedup = speedup
        self.overruns = 0
        self._monotonic_s = monotonic_s
        self._origin_s = monotonic_s()
        self._start_us = round((time.time() if start_s is None else start_s) * _MICROSECONDS)
        self._slipped_us = 0
        self._limit_us: int | None = None
        self._limits_us: dict[object, int] = {}
        self._held = False

    def __call__(self) -> float:
        """The same as `now_s`."""
        return self.now_s()

    @property
    def slipped_s(self) -> float:
        """Simulated seconds by which the clock is behind its speedup."""
        return self._slipped_us / _MICROSECONDS

    def now_s(self) -> float:
        """The simulated Unix time."""
        elapsed_s = (self._monotonic_s() - self._origin_s) * self.speedup
        now_us = self._start_us + round(elapsed_s * _MICROSECONDS) - self._slipped_us
        if self._limit_us is not None and now_us > self._limit_us:
            self._slipped_us += now_us - self._limit_us
            now_us = self._limit_us
            if not self._held:
                self._held = True
                self.overruns += 1
        return now_us / _MICROSECONDS

    def now_us(self) -> int:
        """The simulated Unix time [us], for the companion's `Clock` protocol."""
        return round(self.now_s() * _MICROSECONDS)

    def wall_seconds_until(self, time_us: int) -> float:
        """Real seconds until a simulated time, for the companion's `Clock` protocol."""
        return max((time_us / _MICROSECONDS - self.now_s()) / self.speedup, 0.0)

    def hold_at(self, limit_s: float, holder: object = None) -> None:
        """Stop at this time until the holder's next call; a limit in the past stops the clock at once."""
        now_us = round(self.now_s() * _MICROSECONDS)  # time until now counts under the old limit
        self._limits_us[holder] = round(limit_s * _MICROSECONDS)
        limit_us = max(min(self._limits_us.values()), now_us)
        if self._limit_us is None or limit_us > self._limit_us:
            self._limit_us = limit_us
            self._held = False

    def let_go(self, holder: object = None) -> None:
        """Stop no longer for this holder, which has ended; the limit of the last holder stays."""
        if len(self._limits_us) > 1 and holder in self._limits_us:
            now_us = round(self.now_s() * _MICROSECONDS)
            del self._limits_us[holder]
            self._limit_us = max(min(self._limits_us.values()), now_us)
            self._held = False

    async def sleep_until(self, time_s: float) -> None:
        """Wait for a simulated time; if it has passed, let other tasks run once."""
        await asyncio.sleep(max((time_s - self.now_s()) / self.speedup, 0.0))
