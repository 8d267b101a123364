"""A change of mode, requested until the heartbeat shows it, and never against the heartbeat.

An acknowledgement does not name the mode, and may arrive late or not at all. Only the heartbeat shows who has
the aircraft. A request is sent only after a heartbeat that is fresh, newer than the last try, and still
shows the mode we started from. Sent blindly, it could take the aircraft from a pilot who changed the mode
meanwhile.
"""

import math
from enum import Enum

_RESEND_S = 1.0
# A mode that has been shown for this long is certain enough for the service to end.
CERTAIN_S = 0.5
# A mode is requested only on a heartbeat no older than this.
EVIDENCE_S = 1.5
# An accepted request shows in the heartbeat soon, on a slow link within this time.
_ACCEPTED_S = 3.0
_FIRST_REFUSAL_S, _LONGEST_REFUSAL_S = 1.0, 5.0
_NOT_YET_S = 0.4


class Progress(Enum):
    """Where a request stands, according to the heartbeats since it was made."""

    WAITING = "waiting"
    CONFIRMED = "confirmed"
    OVERRULED = "overruled"  # a third mode: someone else chose it


class ModeRequest:
    """One request, from `start` to `wanted` (custom modes), made at `now_s`.

    It is first sent after `delay_s`. With `settle_s`, the wanted mode counts only when it is seen that long
    after the request was made, as an older request may still be under way. `in_failsafe`: the autopilot had
    entered the start by itself; without the failsafe, someone chose the same mode.
    """

    def __init__(
        self,
        start: int,
        wanted: int,
        now_s: float,
        *,
        delay_s: float = 0.0,
        settle_s: float = 0.0,
        in_failsafe: bool = False,
    ) -> None:
        self.start = start
        self.in_failsafe = in_failsafe
        self.wanted = wanted
        self.made_s = now_s
        self.asked_s = now_s + delay_s
        self.tries = 0
        self.refusals = 0
        self.postponements = 0
        self._settle_s = settle_s
        self.sent_s = -math.inf
        self._not_before_s = self.asked_s

    def progress(self, mode: int, heartbeat_s: float) -> Progress:
        """The progress according to the newest heartbeat, received at `heartbeat_s`."""
        if heartbeat_s <= self.made_s:
            return Progress.WAITING
        if mode == self.wanted:
            settled = heartbeat_s - self.made_s >= self._settle_s
            return Progress.CONFIRMED if settled else Progress.WAITING
        return Progress.WAITING if mode == self.start else Progress.OVERRULED

    def due(self, mode: int, heartbeat_s: float, now_s: float) -> bool:
        """Whether to send now; the request counts as sent then."""
        fresh = heartbeat_s > self.sent_s and now_s - heartbeat_s <= EVIDENCE_S
        if now_s < self._not_before_s or mode != self.start or not fresh:
            return False
        self.tries += 1
        self.sent_s = now_s
        self._not_before_s = now_s + _RESEND_S
        return True

    def accepted(self, now_s: float) -> None:
        """Acknowledged: back off, so that a later change by the pilot is not overridden."""
        self._not_before_s = max(self._not_before_s, now_s + _ACCEPTED_S)

    def postponed(self, now_s: float) -> None:
        """Temporarily rejected: request again soon."""
        self.postponements += 1
        self._not_before_s = now_s + _NOT_YET_S

    def refused(self, now_s: float) -> None:
        """Refused: request again after a wait that doubles each time, up to 5 s."""
        wait_s = min(_FIRST_REFUSAL_S * 2.0**self.refusals, _LONGEST_REFUSAL_S)
        self.refusals += 1
        self._not_before_s = now_s + wait_s
