"""The vehicle's own time, followed between its messages: a simulation may run slower or faster than we do."""

import math
import time
from collections import deque
from collections.abc import Callable

_WINDOW_S = 20.0
# The vehicle's time is not carried on for longer than this without a message: it may stand still.
_LONGEST_S = 1.0
# A boot time that steps back by more is a restart.
_RESTART_S = 1.0


class VehicleTime:
    """Seconds since the vehicle started, by its `time_boot_ms`; it never runs backwards before a restart."""

    def __init__(self, monotonic_s: Callable[[], float] = time.monotonic) -> None:
        self._monotonic_s = monotonic_s
        self._heard: deque[tuple[float, float]] = deque()  # our time, its time
        self._shown_s = -math.inf
        self.restarts = 0

    def observe(self, boot_s: float) -> None:
        """Take in the time of a message that has just arrived."""
        now_s, heard = self._monotonic_s(), self._heard
        if heard and boot_s < heard[-1][1] - _RESTART_S:
            heard.clear()
            self._shown_s = -math.inf
            self.restarts += 1
        if heard and boot_s <= heard[-1][1]:
            return
        heard.append((now_s, boot_s))
        while heard[-1][0] - heard[0][0] > _WINDOW_S:
            heard.popleft()

    @property
    def known(self) -> bool:
        """Whether a time was heard."""
        return bool(self._heard)

    @property
    def rate(self) -> float:
        """Seconds of the vehicle in one of ours; 1 until it is known."""
        if len(self._heard) < 2:
            return 1.0
        (first_s, first_boot_s), (last_s, last_boot_s) = self._heard[0], self._heard[-1]
        passed_s = last_s - first_s
        return (last_boot_s - first_boot_s) / passed_s if passed_s > 1.0 else 1.0

    def now_s(self) -> float:
        """The vehicle's time now; `nan` before the first message."""
        if not self._heard:
            return math.nan
        at_s, boot_s = self._heard[-1]
        since_s = min(self._monotonic_s() - at_s, _LONGEST_S)
        self._shown_s = max(self._shown_s, boot_s + since_s * self.rate)
        return self._shown_s

    @property
    def silent_s(self) -> float:
        """How long no message has arrived, in our time; infinite before the first."""
        return self._monotonic_s() - self._heard[-1][0] if self._heard else math.inf
