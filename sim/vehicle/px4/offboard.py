"""OFFBOARD: the setpoint stream, entry conditions, and transitions that invalidate the setpoint."""

import math
from collections import deque

from sim.vehicle.px4.setpoint import ALONG_A_LINE, Kind, Setpoint

_STREAM_GAP_S = 0.5  # at least 2 Hz
_STREAM_BEFORE_ENTRY_S = 0.45  # "about 0.5 s", with room for the rhythm of a 10 Hz stream
# With the airframe's roll, courses begin to change 0.5 s after the setpoint.
_RESPONSE_S = 0.35
# Measured when leaving OFFBOARD: 15 m between commanded and flown height always made the attitude setpoint
# NaN, 0 m never did.
_INVALIDATING_M = 5.0
# An earlier setpoint still has that effect for this time.
_MEMORY_S = 0.3
_VELOCITY_FIRST_S = 0.4
_VELOCITY_TO_RECOVER_S = 1.45  # "1.5 s", with the same room
_KEPT = 64


class Offboard:
    """The received setpoints and their effect on the controller. Times are seconds of the flight.

    `setpoint_invalid`: the attitude setpoint is NaN. `strict`: entering directly with position and velocity
    always invalidates it; in measurements it did in 2 of 85 cases. Without `latches`, as in 1.18, neither
    entering nor leaving invalidates it.
    """

    def __init__(self, *, strict: bool = True, latches: bool = True) -> None:
        """Start without a stream, with a valid controller."""
        self.strict = strict and latches
        self.latches = latches
        self.setpoint_invalid = False
        self._setpoints: deque[Setpoint] = deque(maxlen=_KEPT)
        self._stream_since_s = math.inf
        self._frozen_since_s = math.inf
        self._velocity_came_first = False
        self._entered_s: float | None = None

    @property
    def last(self) -> Setpoint | None:
        """The last setpoint."""
        return self._setpoints[-1] if self._setpoints else None

    def silent_for_s(self, now_s: float) -> float:
        """Time since the last valid setpoint [s]; inf without one."""
        return math.inf if self.last is None else now_s - self.last.received_s

    def may_enter(self, now_s: float) -> bool:
        """True if the stream has run long enough to enter."""
        running = self.silent_for_s(now_s) <= _STREAM_GAP_S
        return running and now_s - self._stream_since_s >= _STREAM_BEFORE_ENTRY_S

    def enter(self, now_s: float) -> None:
        """Called on entering OFFBOARD."""
        self._entered_s = now_s
        if self.last is not None and self.last.kind in ALONG_A_LINE:
            self._begin_line(self.last)

    def leave(self, now_s: float, altitude_m: float) -> None:
        """Called on leaving OFFBOARD."""
        self._leave_line(now_s, altitude_m)
        self._entered_s = None
        self._velocity_came_first = False
        self._frozen_since_s = math.inf

    def receive(self, setpoint: Setpoint, altitude_m: float) -> None:
        """Store a valid setpoint; `altitude_m` is the aircraft's present height."""
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
        """The setpoint that the controller flies now, in OFFBOARD; one of Kind.INVALID invalidates it."""
        due = (s for s in reversed(self._setpoints) if s.received_s <= now_s - _RESPONSE_S)
        flown = next(due, None)
        if flown is not None and flown.kind is Kind.INVALID:
            self.setpoint_invalid = True
        return flown

    def _begin_line(self, setpoint: Setpoint) -> None:
        since_s = max(self._frozen_since_s, self._entered_s or 0.0)
        if self.setpoint_invalid:
            self.setpoint_invalid = not setpoint.received_s - since_s >= _VELOCITY_TO_RECOVER_S
        elif self.strict and not self._velocity_came_first:
            self.setpoint_invalid = True

    def _leave_line(self, now_s: float, altitude_m: float) -> None:
        """Invalidate the setpoint if a recent setpoint's height is far from the present one."""
        if self._entered_s is None or not self.latches:
            return
        replaced_s = now_s
        for setpoint in reversed(self._setpoints):
            if now_s - replaced_s > _MEMORY_S:
                return
            off_m = abs(setpoint.altitude_m - altitude_m)
            if setpoint.kind in ALONG_A_LINE and off_m >= _INVALIDATING_M:
                self.setpoint_invalid = True
            replaced_s = setpoint.received_s
