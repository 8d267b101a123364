"""The way back to where the former mode belongs: the mission's leg, a circle or a course.

Both autopilots begin a new line to the next waypoint where the mission's mode is entered, sideways and in
height. So the aircraft flies back to its leg first, still avoiding, and is given back there.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

from companion.autopilots.adapter import Adapter
from companion.avoidance.leg import BesideLeg
from companion.geodesy import GeoPoint, LocalFrame, wrap_pi, wrap_two_pi
from companion.model import Guidance, PriorFlightState, Vec3
from companion.ownship.aircraft import Aircraft
from companion.ownship.legs import Leg, same_items
from companion.ownship.mission import Mission

# A circle stays in place when its mode is entered at its centre; the mode change takes this long.
_LEAD_S = 1.5
_NEAR_M = 30.0
_ON_COURSE_RAD = math.radians(5.0)
_ON_HEIGHT_M = 10.0
# The way ends after this time, as in too strong a wind the place is never reached.
_LONGEST_S = 300.0
# Given back this near to the leg, the aircraft stays within 30 m and 10 m of it.
_ON_LEG_M, _ON_LEG_HEIGHT_M, _ON_LEG_RAD = 20.0, 7.0, math.radians(12.0)
# The way to a leg ends after this time in any case, and this time before its end, for the autopilot to turn.
_LONGEST_TO_LEG_S = 180.0
# On the leg below an item to which the autopilot would climb in a loiter, the leg is flown for this long.
_LONGEST_CLIMB_S = 600.0
_BEFORE_END_S = 6.0
# A pause longer than this between two ticks of the way is another avoidance: the time begins again.
_PAUSE_S = 3.0
_USUAL_RADIUS_M, _AROUND_CIRCLE_M = 80.0, 60.0
# How steeply a circle is joined; along it the course is commanded in steps, as each restarts a controller.
_APPROACH, _STEP_RAD = 2.0, math.radians(5.0)
# The autopilot's own threshold for a climb in a loiter, and our errors of height.
_BELOW_CLIMB_M = 2.0
# The aircraft flies at the mission's speed again if it did so within this at the take-over.
_SAME_SPEED_MPS = 2.0

RejoinMode = Literal["line", "direct", "off"]


@dataclass(frozen=True)
class ControlParams:
    """How the aircraft is given back."""

    # After an avoidance on a mission: `line` flies back to the leg's line and height first; `direct` only to
    # the height of the next item, on the straight way to it; `off` gives back at once.
    rejoin: RejoinMode = "line"


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

    def destination(self, _aircraft: Aircraft) -> str:
        """Where it leads, in words."""
        return "circle" if self.place is not None else "course"

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
        position = aircraft.kinematics.position
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
        place = aircraft.kinematics.place()
        if place is None or self.place is None:
            return 0.0, 0.0
        return LocalFrame(place.lat_deg, place.lon_deg).to_ned_m(self.place)[:2]


@dataclass(slots=True)
class LegRejoin:
    """The way to the leg that was flown at the take-over, as long as it is still the mission's.

    If another item is selected or the mission is changed meanwhile, or the rest of the leg is too short, the
    next item is flown to directly, at its height.
    """

    prior: PriorFlightState
    leg: Leg
    mission: Mission
    lowest_m: float | None  # above mean sea level
    began_s: float | None = None
    last_s: float | None = None
    # The mission and its item of which is known that the leg is theirs.
    leg_of: tuple[Mission, int] | None = field(default=None, compare=False)

    def present_leg(self, aircraft: Aircraft) -> Leg | None:
        """The leg, or the straight way to the item that is now the mission's; `None`: unknown."""
        navigation = aircraft.navigation
        mission, sequence = navigation.mission, navigation.sequence
        if mission is None or sequence is None:
            return None
        if sequence == self.leg.sequence and (mission is self.mission or same_items(mission, self.mission)):
            self.leg_of = mission, sequence
            return self.leg
        return navigation.legs.straight_to(mission, sequence, aircraft.kinematics.home_altitude_m())

    def destination(self, aircraft: Aircraft) -> str:
        """Where it leads, in words."""
        leg = self.present_leg(aircraft)
        return "next item" if leg is None or leg.start is None else "leg"

    def guidance(self, aircraft: Aircraft) -> Guidance:
        """Guidance along the leg or onto it, otherwise straight to its end."""
        leg, place = self.present_leg(aircraft), aircraft.kinematics.place()
        if leg is None or place is None:
            return aircraft.kinematics.guidance()
        speed_mps = _ground_speed_mps(aircraft)
        beside = self._beside(leg, place, speed_mps)
        course_rad, altitude_m = _course_to_end_rad(place, leg), leg.end.altitude_m
        if beside is not None and leg.start is not None:
            course_rad = beside.join_rad(speed_mps)
            frame = LocalFrame(leg.end.lat_deg, leg.end.lon_deg)
            altitude_m = beside.altitude_ahead_m(
                speed_mps, frame.to_ned_m(leg.start), frame.to_ned_m(leg.end)
            )
        if self.lowest_m is not None:
            altitude_m = max(altitude_m, self.lowest_m)
        return Guidance(wrap_two_pi(course_rad), self.prior.airspeed_mps, altitude_m)

    def is_done(self, aircraft: Aircraft, now_s: float) -> bool:
        """Whether the mission can be resumed here, or the way has to end."""
        if self.began_s is None or self.last_s is None or not 0.0 <= now_s - self.last_s <= _PAUSE_S:
            self.began_s = now_s
        self.last_s = now_s
        leg, position = self.present_leg(aircraft), aircraft.kinematics.position
        place = aircraft.kinematics.place()
        if leg is None or place is None or position is None or aircraft.adapter is None:
            return True
        speed_mps = _ground_speed_mps(aircraft)
        beside = self._beside(leg, place, speed_mps)
        near_end_m = leg.acceptance_m + _BEFORE_END_S * speed_mps
        on_leg = beside is not None and self._is_on(beside, place, position.velocity_mps)
        if now_s - self.began_s > (_LONGEST_CLIMB_S if on_leg else _LONGEST_TO_LEG_S):
            return True
        if beside is None:
            # A circle may be flown until the height is reached; a waypoint is never passed.
            at_end = leg.loiter_radius_m is None and _distance_m(place, leg.end) <= near_end_m
            return at_end or abs(place.altitude_m - leg.end.altitude_m) <= _ON_LEG_HEIGHT_M
        if leg.loiter_radius_m is None and beside.to_go_m <= near_end_m:
            return True
        climb_m = leg.end.altitude_m - place.altitude_m
        return on_leg and climb_m <= aircraft.adapter.climbs_first_m - _BELOW_CLIMB_M

    @staticmethod
    def _is_on(beside: BesideLeg, place: GeoPoint, velocity_mps: Vec3) -> bool:
        """Whether a place and a motion are on the leg, at its height and along it."""
        off_rad = wrap_pi(math.atan2(velocity_mps[1], velocity_mps[0]) - beside.course_rad)
        return (
            abs(beside.aside_m) <= _ON_LEG_M
            and abs(off_rad) <= _ON_LEG_RAD
            and abs(place.altitude_m - beside.altitude_m) <= _ON_LEG_HEIGHT_M
        )

    def _beside(self, leg: Leg, place: GeoPoint, speed_mps: float) -> BesideLeg | None:
        """Our place beside the leg; `None` where its end is flown to directly."""
        radius_m = _radius_m(leg)
        if radius_m and _distance_m(place, leg.end) <= radius_m + _AROUND_CIRCLE_M:
            return None
        beside = leg.beside(place)
        return None if beside is None or beside.is_too_short(speed_mps) else beside


AnyRejoin = Rejoin | LegRejoin


def way_back(
    prior: PriorFlightState, aircraft: Aircraft, mode: RejoinMode, min_height_m: float
) -> AnyRejoin | None:
    """The way back from an avoidance that begins now; `None` when the aircraft is given back at once."""
    adapter, mission = aircraft.adapter, aircraft.navigation.mission
    if adapter is None:
        return None
    leg = aircraft.leg() if mode != "off" and adapter.is_mission(prior.mode) else None
    if leg is None or mission is None:
        return Rejoin.to(prior, adapter)
    home_m = aircraft.kinematics.home_altitude_m()
    lowest_m = None if home_m is None else home_m + min_height_m
    return LegRejoin(prior, leg if mode == "line" else leg.straight(), mission, lowest_m)


def mission_airspeed_mps(prior: PriorFlightState, aircraft: Aircraft) -> float | None:
    """The airspeed of the mission's DO_CHANGE_SPEED that is flown now, if the autopilot will forget it."""
    adapter, mission = aircraft.adapter, aircraft.navigation.mission
    if adapter is None or mission is None or prior.sequence is None:
        return None
    if not (adapter.forgets_mission_speed and adapter.is_mission(prior.mode)):
        return None
    speeds_mps = [item.params[1] or 0.0 for item in mission.speed_changes(prior.sequence)]
    return next((mps for mps in speeds_mps if abs(mps - prior.airspeed_mps) <= _SAME_SPEED_MPS), None)


def _radius_m(leg: Leg) -> float:
    """Radius of the circle at the leg's end, positive; 0 without a circle."""
    return 0.0 if leg.loiter_radius_m is None else abs(leg.loiter_radius_m or _USUAL_RADIUS_M)


def _ground_speed_mps(aircraft: Aircraft) -> float:
    return math.hypot(*aircraft.kinematics.velocity_mps()[:2])


def _distance_m(here: GeoPoint, there: GeoPoint) -> float:
    return math.hypot(*LocalFrame(here.lat_deg, here.lon_deg).to_ned_m(there)[:2])


def _course_to_end_rad(here: GeoPoint, leg: Leg) -> float:
    """Course straight to the leg's end, or onto the circle around it and along that."""
    north_m, east_m, _ = LocalFrame(here.lat_deg, here.lon_deg).to_ned_m(leg.end)
    bearing_rad, radius_m = math.atan2(east_m, north_m), _radius_m(leg)
    off_m = math.hypot(north_m, east_m) - radius_m
    if not radius_m or off_m > radius_m + _AROUND_CIRCLE_M:
        return bearing_rad
    side = math.copysign(1.0, leg.loiter_radius_m or 1.0)
    aim_rad = bearing_rad - side * (math.pi / 2.0 - math.atan(_APPROACH * off_m / radius_m))
    return round(aim_rad / _STEP_RAD) * _STEP_RAD
