"""OFFBOARD: the stream of setpoints, the right to enter, and the controller that wrong transitions poison."""

import math
from collections import deque

from sim.vehicle.px4_setpoint import ALONG_A_LINE, Kind, Setpoint

_STREAM_GAP_S = 0.5  # at least 2 Hz
_STREAM_BEFORE_ENTRY_S = 0.45  # "about 0.5 s", with room for the rhythm of a 10 Hz stream
# With the airframe's roll, courses begin to change 0.5 s after the setpoint.
_RESPONSE_S = 0.35
# Left with 15 m between the height asked for and the height flown it was always poisoned, with 0 m never.
_POISONING_M = 5.0
# How long the controller remembers what it was last told.
_MEMORY_S = 0.3
_VELOCITY_FIRST_S = 0.4
_VELOCITY_TO_RECOVER_S = 1.45  # "1.5 s", with the same room
_KEPT = 64


class Offboard:
    """The setpoints that came, and what they did to the controller. Times are seconds of the flight.

    `strict`: entering straight with position and velocity always poisons, as it did 2 times of 85.
    """

    def __init__(self, *, strict: bool = True) -> None:
        """Nothing heard, nothing poisoned."""
        self.strict = strict
        self.poisoned = False
        self._setpoints: deque[Setpoint] = deque(maxlen=_KEPT)
        self._stream_since_s = math.inf
        self._frozen_since_s = math.inf
        self._velocity_came_first = False
        self._entered_s: float | None = None

    @property
    def last(self) -> Setpoint | None:
        """The last setpoint that came."""
        return self._setpoints[-1] if self._setpoints else None

    def silent_for_s(self, now_s: float) -> float:
        """How long ago the last valid setpoint came; inf when none ever did."""
        return math.inf if self.last is None else now_s - self.last.received_s

    def may_enter(self, now_s: float) -> bool:
        """Whether a stream has run for long enough."""
        running = self.silent_for_s(now_s) <= _STREAM_GAP_S
        return running and now_s - self._stream_since_s >= _STREAM_BEFORE_ENTRY_S

    def enter(self, now_s: float) -> None:
        """The mode is OFFBOARD from now on."""
        self._entered_s = now_s
        if self.last is not None and self.last.kind in ALONG_A_LINE:
            self._begin_line(self.last)

    def leave(self, now_s: float, altitude_m: float) -> None:
        """The mode is another one from now on."""
        self._leave_line(now_s, altitude_m)
        self._entered_s = None
        self._velocity_came_first = False
        self._frozen_since_s = math.inf

    def receive(self, setpoint: Setpoint, altitude_m: float) -> None:
        """Take a valid setpoint; `altitude_m` is where the aircraft is."""
        now_s, before = setpoint.received_s, self.last
        if self.silent_for_s(now_s) > _STREAM_GAP_S:
            self._stream_since_s = now_s
            self._velocity_came_first = False
            self._frozen_since_s = math.inf
        in_line = before is not None and before.kind in ALONG_A_LINE
        if in_line and setpoint.kind not in ALONG_A_LINE:
            self._leave_line(now_s, altitude_m)
        self._setpoints.append(setpoint)
        if setpoint.kind is Kind.FROZEN:
            self._frozen_since_s = min(self._frozen_since_s, now_s)
        if now_s - self._frozen_since_s >= _VELOCITY_FIRST_S:
            self._velocity_came_first = True
        if setpoint.kind in ALONG_A_LINE and not in_line and self._entered_s is not None:
            self._begin_line(setpoint)
        if setpoint.kind is not Kind.FROZEN:
            self._frozen_since_s = math.inf

    def control(self, now_s: float) -> Setpoint | None:
        """What the controller flies now, in OFFBOARD; a setpoint that breaks it, breaks it."""
        due = (s for s in reversed(self._setpoints) if s.received_s <= now_s - _RESPONSE_S)
        flown = next(due, None)
        if flown is not None and flown.kind is Kind.BROKEN:
            self.poisoned = True
        return flown

    def _begin_line(self, setpoint: Setpoint) -> None:
        since_s = max(self._frozen_since_s, self._entered_s or 0.0)
        if self.poisoned:
            self.poisoned = not setpoint.received_s - since_s >= _VELOCITY_TO_RECOVER_S
        elif self.strict and not self._velocity_came_first:
            self.poisoned = True

    def _leave_line(self, now_s: float, altitude_m: float) -> None:
        """Poison the controller when it was lately told a height far from where it is."""
        if self._entered_s is None:
            return
        replaced_s = now_s
        for setpoint in reversed(self._setpoints):
            if now_s - replaced_s > _MEMORY_S:
                return
            off_m = abs(setpoint.altitude_m - altitude_m)
            if setpoint.kind in ALONG_A_LINE and off_m >= _POISONING_M:
                self.poisoned = True
            replaced_s = setpoint.received_s
