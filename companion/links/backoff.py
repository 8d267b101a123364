"""Backoff: when a failed link is opened again, and which failures are logged. Time is an argument."""

import logging
from enum import StrEnum

SHORTEST_WAIT_S, LONGEST_WAIT_S = 0.5, 5.0
# A link that fails sooner than this after it was opened does not count as up; otherwise a link that flaps
# would log "works again" after each failure.
STEADY_S = 2.0


class LinkState(StrEnum):
    """The state of a link that is kept open."""

    OPENING = "opening"
    ON_TRIAL = "on trial"  # open, but for less than `STEADY_S`
    UP = "up"
    WAITING = "waiting"  # down, until the wait is over


class Backoff:
    """The state of one link. Waits double, from `SHORTEST_WAIT_S` to `longest_wait_s`, until it is up."""

    def __init__(self, longest_wait_s: float = LONGEST_WAIT_S) -> None:
        self.state = LinkState.OPENING
        self._longest_wait_s = longest_wait_s
        self._wait_s = SHORTEST_WAIT_S
        self._retry_at_s = 0.0
        self._steady_at_s = 0.0
        self._failure_logged = False

    def opening(self) -> None:
        """The link is being opened."""
        self.state = LinkState.OPENING

    def opened(self, now_s: float) -> None:
        """The link was opened."""
        self.state = LinkState.ON_TRIAL
        self._steady_at_s = now_s + STEADY_S

    def failed(self, now_s: float) -> int:
        """The link could not be opened, or was lost; returns the `logging` level of the message about it."""
        if self._was_up(now_s):
            self._wait_s = SHORTEST_WAIT_S
            self._failure_logged = False
        self.state = LinkState.WAITING
        self._retry_at_s = now_s + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._longest_wait_s)
        level = logging.DEBUG if self._failure_logged else logging.WARNING
        self._failure_logged = True
        return level

    def steady(self, now_s: float) -> bool:
        """Call this `STEADY_S` after `opened`; True if the recovery of the link should be logged."""
        if self.state is not LinkState.ON_TRIAL or not self._was_up(now_s):
            return False
        self.state = LinkState.UP
        self._wait_s = SHORTEST_WAIT_S
        recovered, self._failure_logged = self._failure_logged, False
        return recovered

    def wait_s(self, now_s: float) -> float:
        """How long to wait before the link is opened again [s]."""
        return max(self._retry_at_s - now_s, 0.0) if self.state is LinkState.WAITING else 0.0

    def _was_up(self, now_s: float) -> bool:
        on_trial = self.state is LinkState.ON_TRIAL
        return self.state is LinkState.UP or (on_trial and now_s >= self._steady_at_s)
