"""The way back to a circle or a course that the former mode holds, before that mode is entered again."""

import math
from dataclasses import dataclass

from companion.autopilots.adapter import Adapter
from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Guidance, PriorFlightState
from companion.ownship.aircraft import Aircraft
from companion.units import wrap_pi, wrap_two_pi

# A circle stays in place when its mode is entered at its centre; the mode change takes this long.
_LEAD_S = 1.5
_NEAR_M = 30.0
_ON_COURSE_RAD = math.radians(5.0)
_ON_HEIGHT_M = 10.0
# The way ends after this time, as in too strong a wind the place is never reached.
_LONGEST_S = 300.0


@dataclass(slots=True)
class Rejoin:
    """The way to a centre (`place`), or without one onto the former course at the former height."""

    prior: PriorFlightState
    place: GeoPoint | None
    began_s: float | None = None

    @classmethod
    def to(cls, prior: PriorFlightState, adapter: Adapter) -> "Rejoin | None":
        """The way that the former mode needs; `None` when the autopilot goes on by itself."""
        mode = adapter.mode_name(prior.mode)
        if mode in adapter.loiter_modes and prior.target is not None:
            return cls(prior, prior.target)
        return cls(prior, None) if mode in adapter.course_hold_modes else None

    def guidance(self, aircraft: Aircraft) -> Guidance:
        """Guidance towards the centre, or along the former course."""
        course_rad = self.prior.course_rad
        if self.place is not None:
            north_m, east_m = self._to_go_m(aircraft)
            course_rad = math.atan2(east_m, north_m)
        return Guidance(wrap_two_pi(course_rad), self.prior.airspeed_mps, self.prior.altitude_m)

    def is_done(self, aircraft: Aircraft, now_s: float) -> bool:
        """Whether the former mode can be entered here, or the time for the way is over."""
        if self.began_s is None or now_s < self.began_s:
            self.began_s = now_s
        position = aircraft.position
        if position is None or now_s - self.began_s > _LONGEST_S:
            return True
        north_mps, east_mps, _ = position.velocity_mps
        if self.place is not None:
            near_m = _NEAR_M + _LEAD_S * math.hypot(north_mps, east_mps)
            is_there = math.hypot(*self._to_go_m(aircraft)) <= near_m
        else:
            off_rad = wrap_pi(math.atan2(east_mps, north_mps) - self.prior.course_rad)
            is_there = abs(off_rad) <= _ON_COURSE_RAD
        # These modes hold the height at which they are entered.
        return is_there and abs(position.altitude_m - self.prior.altitude_m) <= _ON_HEIGHT_M

    def _to_go_m(self, aircraft: Aircraft) -> tuple[float, float]:
        place = aircraft.place()
        if place is None or self.place is None:
            return 0.0, 0.0
        return LocalFrame(place.lat_deg, place.lon_deg).to_ned_m(self.place)[:2]
