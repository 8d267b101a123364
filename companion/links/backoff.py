"""When a link that failed is tried again, and what of it is news. Knows no clock: the time is an argument."""

import logging
from enum import StrEnum

SHORTEST_WAIT_S, LONGEST_WAIT_S = 0.5, 5.0
# A link that fails sooner after it was opened has not been up: saying so would alternate with its failures.
STEADY_S = 2.0


class LinkState(StrEnum):
    """How it is with a link that is kept open."""

    OPENING = "opening"
    ON_TRIAL = "on trial"  # open, but not for long enough to be believed
    UP = "up"
    WAITING = "waiting"  # down; tried again when the wait is over


class Backoff:
    """The state of one link. Waits double from `SHORTEST_WAIT_S` to the longest, until it was up."""

    def __init__(self, longest_wait_s: float = LONGEST_WAIT_S) -> None:
        self.state = LinkState.OPENING
        self._longest_wait_s = longest_wait_s
        self._wait_s = SHORTEST_WAIT_S
        self._retry_at_s = 0.0
        self._steady_at_s = 0.0
        self._told = False

    def opening(self) -> None:
        """It is tried now."""
        self.state = LinkState.OPENING

    def opened(self, now_s: float) -> None:
        """It could be opened."""
        self.state = LinkState.ON_TRIAL
        self._steady_at_s = now_s + STEADY_S

    def failed(self, now_s: float) -> int:
        """It could not be opened, or was lost; how loudly to say so, as a level of `logging`."""
        if self._been_up(now_s):
            self._wait_s = SHORTEST_WAIT_S
            self._told = False
        self.state = LinkState.WAITING
        self._retry_at_s = now_s + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._longest_wait_s)
        level = logging.DEBUG if self._told else logging.WARNING
        self._told = True
        return level

    def steady(self, now_s: float) -> bool:
        """Ask `STEADY_S` after `opened`: true if that it is back is news."""
        if self.state is not LinkState.ON_TRIAL or not self._been_up(now_s):
            return False
        self.state = LinkState.UP
        self._wait_s = SHORTEST_WAIT_S
        news, self._told = self._told, False
        return news

    def wait_s(self, now_s: float) -> float:
        """How long to wait until the next try."""
        return max(self._retry_at_s - now_s, 0.0) if self.state is LinkState.WAITING else 0.0

    def _been_up(self, now_s: float) -> bool:
        on_trial = self.state is LinkState.ON_TRIAL
        return self.state is LinkState.UP or (on_trial and now_s >= self._steady_at_s)
