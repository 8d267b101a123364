"""A clock for ages, which never runs backwards."""

# Smaller steps back of a clock are jitter between callers; a larger step means that the clock was set.
_CLOCK_JITTER_S = 1.0


class MonotonicClock:
    """Time that stands still during jitter of the caller's clock and continues after a step back of it.

    Without it, ages would be negative after a step back, until the caller's clock has caught up.
    """

    def __init__(self) -> None:
        self._offset_s = 0.0
        self._latest_s: float | None = None

    def advance(self, now_s: float) -> float:
        """The monotonic time of the caller's present time."""
        monotonic_s = now_s + self._offset_s
        if self._latest_s is not None and monotonic_s < self._latest_s:
            if self._latest_s - monotonic_s > _CLOCK_JITTER_S:
                self._offset_s = self._latest_s - now_s
            return self._latest_s
        self._latest_s = monotonic_s
        return monotonic_s

    def convert(self, time_s: float) -> float:
        """The monotonic time of a time stamp of the caller's clock, at most the latest present time."""
        monotonic_s = time_s + self._offset_s
        return monotonic_s if self._latest_s is None else min(monotonic_s, self._latest_s)
