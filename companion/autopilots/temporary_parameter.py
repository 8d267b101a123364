"""One parameter of the autopilot that is changed for a while and then restored."""

import math

_REPEAT_S = 1.0
# A change is dropped after this many unanswered requests; a restoration goes on at growing intervals.
_TRIES = 5
# A request may still be under way this long after it was sent.
_LATE_S = 10.0
_SAME = 0.01


class TemporaryParameter:
    """Sets a parameter until the autopilot reports the value, and restores the original one likewise."""

    def __init__(self) -> None:
        self.original: float | None = None  # while the parameter is changed
        self.value: float | None = None  # the newest reported
        self.refused = False  # a change was requested in vain: it is not requested again
        self._wanted: float | None = None  # until it is reported
        self._last_set: float | None = None  # other than the original
        self._restored: tuple[float, float] | None = None  # the original, and when [s] it was reported
        self._requested_s = -math.inf
        self._tries = 0
        self._answered = False  # a value was reported since the last change was requested

    def observe(self, value: float, now_s: float) -> None:
        """Process a reported value.

        After a restoration, our last request may arrive late or twice; then the original is restored again.
        """
        self.value, self._answered = value, True
        if self._is_reported(self._wanted):
            if self.original is not None and self._wanted == self.original:
                self._restored = self.original, now_s
                self.original = None
            self._wanted = None
        elif self._restored is not None and self.original is None:
            original, restored_s = self._restored
            if self._is_reported(self._last_set) and now_s - restored_s <= _LATE_S:
                self.restore(original)

    def change(self, value: float, tolerance: float) -> None:
        """Set the value, unless it is within `tolerance` of the present one or that one is unknown."""
        present = self.value if self._wanted is None else self._wanted
        if present is None or self.refused or abs(value - present) <= tolerance:
            return
        if self.original is None:
            self.original = self.value
        self._last_set = value
        self._want(value)

    def restore(self, original: float | None = None) -> None:
        """Set the original value, or the one given, which a former run stored."""
        if original is not None:
            self.original = original
        if self.original is not None and self._wanted != self.original:
            self._want(self.original)

    def due(self, now_s: float) -> float | None:
        """The value to set now, if any; a call counts as a request."""
        if self._wanted is None:
            return None
        wait_s = _REPEAT_S * 2.0 ** min(max(self._tries - _TRIES, 0), 5)
        if 0.0 <= now_s - self._requested_s < wait_s:
            return None
        if self._tries >= _TRIES and self._wanted != self.original:
            self._give_up(now_s)
            return None
        self._requested_s = now_s
        self._tries += 1
        return self._wanted

    def _give_up(self, now_s: float) -> None:
        """Drop a change that the autopilot did not accept.

        It is known to have the original only if it has reported that since. Otherwise it may have obeyed in
        silence, and the original is set again when it is restored.
        """
        self.refused, self._wanted = True, None
        if self.original is not None and self._answered and self._is_reported(self.original):
            self._restored, self.original = (self.original, now_s), None  # our requests may arrive late

    def _want(self, value: float) -> None:
        self._wanted, self._tries, self._answered = value, 0, False
        self._requested_s = -math.inf

    def _is_reported(self, value: float | None) -> bool:
        return value is not None and self.value is not None and abs(self.value - value) < _SAME
