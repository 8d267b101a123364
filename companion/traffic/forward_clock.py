"""A clock that never runs backwards, made from one that may."""

# Smaller steps back are jitter between callers, not a clock that was set.
_JITTER_S = 1.0


class ForwardClock:
    """Time that stands still through jitter and goes on through a step back.

    After a step back of the caller's clock, ages continue from where they were, instead of being negative
    until the caller's clock has caught up.
    """

    def __init__(self) -> None:
        self._offset_s = 0.0
        self._latest_s: float | None = None

    def at(self, now_s: float) -> float:
        """The steady time of the caller's now."""
        steady_s = now_s + self._offset_s
        if self._latest_s is not None and steady_s < self._latest_s:
            if self._latest_s - steady_s > _JITTER_S:
                self._offset_s = self._latest_s - now_s
            return self._latest_s
        self._latest_s = steady_s
        return steady_s

    def of(self, time_s: float) -> float:
        """The steady time of a moment that the caller's clock dated; not later than the latest now."""
        steady_s = time_s + self._offset_s
        return steady_s if self._latest_s is None else min(steady_s, self._latest_s)
