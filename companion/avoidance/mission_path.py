"""The mission from here: what it asks for, and where it leads: along legs and slopes, or around a circle."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from companion.avoidance.leg import ON_LINE_M, BesideLeg, beside_leg
from companion.avoidance.trajectory import (
    HORIZON_S,
    TIMES_S,
    Array,
    Commands,
    Envelope,
    Mask,
    OwnState,
    Paths,
    fly_ahead,
    ground_velocity_mps,
    index_at,
    own_state,
)
from companion.geodesy import wrap_pi
from companion.model import Goal, Guidance, Ownship, Vec2, Vec3

# A circle is flown from this far outside; its radius where none is known.
_ON_CIRCLE_M = 60.0
_USUAL_RADIUS_M = 80.0
# An avoidance ends up this far beyond the bound on its changes of height at most, by overshooting.
_BEYOND_M = 50.0
# Without a height of the mission, the height flown for this long after an avoidance is the pilot's choice.
_FOLLOWS_AFTER_S = 60.0
# At a smaller corner the mission counts as straight.
_STRAIGHT_RAD = math.radians(15.0)
# A slope leaves at least this much of the climb and sink limits to reach it.
_LEAST_RATE_MPS = 0.3
_LEVEL_M = 1.0
# An item counts as reached within this distance where it is flown to directly.
_REACHED_M = 90.0
_TURNING_M = 300.0
_MEAN_S = 30.0


class HeightReference:
    """The mission's height, from which the bound on changes of height counts.

    While the mission is flown it follows the aircraft, but only towards the mission's height. An aircraft
    that an avoidance left beside that height therefore does not take the bound along, however many avoidances
    follow each other. Where no height of the mission is known, it follows the aircraft once there has been no
    avoidance for a while.
    """

    def __init__(self) -> None:
        self._height_m: float | None = None
        self._avoided_s = -math.inf

    def update(
        self, now_s: float, own_m: float, mission_m: float | None, change_m: float, *, avoiding: bool
    ) -> None:
        """Follow the flight. `mission_m` is `None` when the mission states no height."""
        if self._height_m is None:
            self._height_m = own_m
        if avoiding:
            self._avoided_s = now_s
            return
        low_m, high_m = self._span_m(mission_m)
        if mission_m is None and not 0.0 <= now_s - self._avoided_s <= _FOLLOWS_AFTER_S:
            self._height_m = own_m
        elif not low_m - change_m - _BEYOND_M <= own_m <= high_m + change_m + _BEYOND_M:
            self._height_m = own_m  # no avoidance led here: someone else flew it
        else:
            self._height_m = min(max(own_m, low_m), high_m)

    def limit(self, envelope: Envelope, mission_m: float | None, change_m: float) -> Envelope:
        """The envelope with floor and ceiling no further than `change_m` from the mission's heights.

        The envelope's own floor takes precedence, as the ground is below it.
        """
        low_m, high_m = self._span_m(mission_m)
        floor_m, ceiling_m = low_m - change_m, high_m + change_m
        if envelope.max_altitude_m is not None:
            ceiling_m = min(ceiling_m, envelope.max_altitude_m)
            floor_m = min(floor_m, ceiling_m)
        if envelope.min_altitude_m is not None:
            floor_m = max(floor_m, envelope.min_altitude_m)
            ceiling_m = max(ceiling_m, floor_m)
        return _within(envelope, floor_m, ceiling_m)

    def _span_m(self, mission_m: float | None) -> tuple[float, float]:
        """The lowest and the highest of the mission's heights: where it was, and where it leads."""
        height_m = 0.0 if self._height_m is None else self._height_m
        if mission_m is None:
            return height_m, height_m
        return min(height_m, mission_m), max(height_m, mission_m)


@lru_cache(maxsize=4)
def _within(envelope: Envelope, floor_m: float, ceiling_m: float) -> Envelope:
    """Cached, because the limits rarely change during an avoidance."""
    return replace(envelope, min_altitude_m=floor_m, max_altitude_m=ceiling_m)


class OwnFlight(NamedTuple):
    """Ownship and what its mission asks for from here.

    `mission` is the guidance that leads to `goal`, not limited to what the aircraft can fly; `onward_mps` is
    the velocity over ground on it, north and east. `beside` is set on the way along a leg or back to it, and
    `circles` when the goal is circled now. Where the mission `bends`, `ahead` is its path, and `onward_mps`
    the mean velocity along it (see `with_path`).
    """

    state: OwnState
    mission: Guidance
    onward_mps: Vec2
    goal: Goal
    beside: BesideLeg | None = None
    circles: bool = False
    bends: bool = False
    ahead: Paths | None = None
    judged_s: float = HORIZON_S  # how far ahead the mission is judged, where it bends

    @classmethod
    def at(cls, now_s: float, own: Ownship, goal: Goal) -> "OwnFlight":
        """The flight of ownship towards a goal at `now_s`."""
        state = own_state(now_s, own)
        mission = mission_guidance(state, own, goal)
        beside, circles = None, is_circling(state, goal)
        if circles:
            mission = replace(mission, course_rad=state.course_rad)
        elif goal.leg_from_m is not None and goal.position_m is not None:
            beside = beside_leg(goal.leg_from_m, goal.position_m, state.position_m)
            if beside is not None and beside.is_too_short(mission.airspeed_mps):
                beside = None
            if beside is not None:
                mission = _along(beside, mission, goal.leg_from_m, goal.position_m)
        onward_mps = ground_velocity_mps(mission.course_rad, mission.airspeed_mps, state.wind_mps)
        bends = _bends(state, mission, goal, beside)
        return cls(state, mission, onward_mps, goal, beside, circles, bends)

    @property
    def horizon_s(self) -> float:
        """How far ahead flights are judged [s]: no further than to the end of the flight."""
        return self.time_to_goal_s if self.goal.is_end else HORIZON_S

    @property
    def mission_altitude_m(self) -> float | None:
        """The height that the mission states here; `None` if it states none, or that is unknown [m]."""
        goal = self.goal
        states_height = goal.altitude_m is not None or goal.position_m is not None
        return self.mission.altitude_m if states_height and goal.height_is_known else None

    @property
    def time_to_goal_s(self) -> float:
        """Time to the goal's position, at most the prediction horizon; the horizon if it has none [s]."""
        if self.goal.position_m is None or self.circles:
            return HORIZON_S
        north_mps, east_mps = self.onward_mps
        course_rad = self.mission.course_rad
        made_good_mps = north_mps * math.cos(course_rad) + east_mps * math.sin(course_rad)
        # An aircraft that is blown back as fast as it flies, or faster, never arrives.
        return min(HORIZON_S, self.state.distance_m(self.goal.position_m) / max(made_good_mps, 1e-3))


def _along(beside: BesideLeg, mission: Guidance, start_m: Vec3, end_m: Vec3) -> Guidance:
    """Guidance along a leg or onto it, at its height."""
    speed_mps = mission.airspeed_mps
    on_line = abs(beside.aside_m) <= ON_LINE_M
    course_rad = beside.course_rad if on_line else beside.join_rad(speed_mps)
    return Guidance(course_rad, speed_mps, beside.altitude_ahead_m(speed_mps, start_m, end_m))


def _bends(state: OwnState, mission: Guidance, goal: Goal, beside: BesideLeg | None) -> bool:
    """Whether the mission leads from here by other than one straight line, within the horizon."""
    if goal.loiter_radius_m is not None or (beside is not None and abs(beside.aside_m) > ON_LINE_M):
        return True
    if goal.then_m is None or goal.position_m is None:
        return False
    if state.distance_m(goal.position_m) > mission.airspeed_mps * HORIZON_S:
        return False
    north_m, east_m = goal.then_m[0] - goal.position_m[0], goal.then_m[1] - goal.position_m[1]
    return abs(wrap_pi(math.atan2(east_m, north_m) - mission.course_rad)) > _STRAIGHT_RAD


def is_circling(state: OwnState, goal: Goal) -> bool:
    """Whether the goal is a circle, and we are on it or within it."""
    if goal.loiter_radius_m is None or goal.position_m is None:
        return False
    return state.distance_m(goal.position_m) <= loiter_radius_m(goal) + _ON_CIRCLE_M


def loiter_radius_m(goal: Goal) -> float:
    """Radius of the circle around the goal, positive; a usual one if it is unknown."""
    return abs(goal.loiter_radius_m or _USUAL_RADIUS_M)


def mission_guidance(state: OwnState, own: Ownship, goal: Goal) -> Guidance:
    """Course, airspeed and height that lead to the goal from here."""
    airspeed = own.airspeed_mps if goal.airspeed_mps is None else goal.airspeed_mps
    course_rad, altitude_m = course_and_altitude_to(goal, state.position_m, state.course_rad)
    return Guidance(course_rad, airspeed, altitude_m)


def course_and_altitude_to(goal: Goal, position_m: Vec3, course_rad: float) -> tuple[float, float]:
    """Course and height [rad, m] that lead to a goal from a north-east-down position and a present course."""
    north_m, east_m, down_m = position_m
    altitude_m = -down_m if goal.altitude_m is None else goal.altitude_m
    if goal.position_m is None:
        return course_rad if goal.course_rad is None else goal.course_rad, altitude_m
    north, east = goal.position_m[0] - north_m, goal.position_m[1] - east_m
    if math.hypot(north, east) > 1.0:  # right at the goal its bearing means nothing
        course_rad = math.atan2(east, north)
    return course_rad, -goal.position_m[2] if goal.altitude_m is None else altitude_m


def with_path(flight: OwnFlight, envelope: Envelope, beyond_s: float = HORIZON_S) -> OwnFlight:
    """The flight with its path ahead, and the mean velocity of the next `_MEAN_S` along that.

    After the goal's position the path is judged for `beyond_s`.
    """
    ahead, reached = _flown(flight, envelope)
    moved_m = ahead.ground_m[0, index_at(_MEAN_S)] - ahead.ground_m[0, 0]
    onward_mps = float(moved_m[0]) / _MEAN_S, float(moved_m[1]) / _MEAN_S
    judged_s = HORIZON_S if reached is None else min(float(TIMES_S[reached]) + beyond_s, HORIZON_S)
    return flight._replace(ahead=ahead, onward_mps=onward_mps, judged_s=judged_s)


def mission_path(flight: OwnFlight, envelope: Envelope) -> Paths:
    """The path of the mission as one row, at the times of the prediction."""
    return _flown(flight, envelope)[0] if flight.ahead is None else flight.ahead


def _flown(flight: OwnFlight, envelope: Envelope) -> tuple[Paths, int | None]:
    """The path, and when it reaches the goal's position and goes on, as an index."""
    paths = fly_ahead(flight.state, Commands.of([flight.mission]), envelope)
    goal, beside = flight.goal, flight.beside
    if goal.position_m is None or (beside is None and not flight.bends and goal.then_m is None):
        return paths, None
    ground_m, altitude_m, reached = paths.ground_m[0], paths.altitude_m[0], None
    if beside is not None and abs(beside.aside_m) > ON_LINE_M:
        ground_m = _joined(ground_m, beside, goal.position_m, _along_mps(flight, beside.course_rad))
    if goal.loiter_radius_m is not None:
        ground_m = _circled(flight, ground_m, goal.position_m)
    elif goal.then_m is not None:
        reached = _reached(ground_m, goal.position_m, beside)
        if reached is not None:
            ground_m = _continued(flight, ground_m, reached, goal.position_m, goal.then_m)
    wanted_m = _wanted_altitudes_m(goal, beside, ground_m, reached)
    if wanted_m is not None:
        altitude_m = _approached(flight, wanted_m, envelope)
    return Paths(ground_m[None], altitude_m[None], paths.ground_of, paths.height_of), reached


def _along_mps(flight: OwnFlight, course_rad: float) -> Vec2:
    return ground_velocity_mps(course_rad, flight.mission.airspeed_mps, flight.state.wind_mps)


def _to_go_m(ground_m: Array, end_m: Vec3, beside: BesideLeg | None) -> Array:
    """Distance to the end along the leg; without one, to the circle in which an item counts as reached."""
    if beside is None:
        to_go_m: Array = np.hypot(end_m[0] - ground_m[:, 0], end_m[1] - ground_m[:, 1]) - _REACHED_M
        return to_go_m
    leg_n, leg_e = math.cos(beside.course_rad), math.sin(beside.course_rad)
    along_m: Array = (end_m[0] - ground_m[:, 0]) * leg_n + (end_m[1] - ground_m[:, 1]) * leg_e
    return along_m


def _reached(ground_m: Array, end_m: Vec3, beside: BesideLeg | None) -> int | None:
    """When the end is reached, as an index; `None`: not within the prediction."""
    to_go_m = _to_go_m(ground_m, end_m, beside)
    return _near(to_go_m) if beside is None else _first(to_go_m <= 0.0)


def _near(to_go_m: Array) -> int | None:
    """When a place is reached that is flown to directly, as an index.

    A turn may first lead past a near one: then the way goes on from the closest place.
    """
    found = _first(to_go_m <= 0.0)
    closest = int(to_go_m.argmin())
    return closest if found is None and to_go_m[closest] <= _TURNING_M else found


def _continued(flight: OwnFlight, ground_m: Array, reached: int, end_m: Vec3, then_m: Vec3) -> Array:
    """The way along the next leg from the time at which this one's end is reached, (T, 2)."""
    along_mps = _along_mps(flight, math.atan2(then_m[1] - end_m[1], then_m[0] - end_m[0]))
    continued = ground_m.copy()
    since_s = TIMES_S[reached:] - TIMES_S[reached]
    continued[reached:] = ground_m[reached] + np.outer(since_s, along_mps)
    return continued


def _wanted_altitudes_m(
    goal: Goal, beside: BesideLeg | None, ground_m: Array, reached: int | None
) -> Array | None:
    """Heights of the legs along the way, (T,); `None` where they are level."""
    end_m, start_m, then_m = goal.position_m, goal.leg_from_m, goal.then_m
    if end_m is None:
        return None
    slopes = beside is not None and start_m is not None and abs(start_m[2] - end_m[2]) > _LEVEL_M
    goes_on = reached is not None and then_m is not None and abs(then_m[2] - end_m[2]) > _LEVEL_M
    if not (slopes or goes_on):
        return None
    wanted_m = np.full(len(ground_m), -end_m[2])
    if slopes and beside is not None and start_m is not None:
        share = np.clip(_to_go_m(ground_m, end_m, beside) / beside.length_m, 0.0, 1.0)
        wanted_m += share * (end_m[2] - start_m[2])
    if goes_on and then_m is not None:
        off_m = ground_m[reached:] - end_m[:2]
        share = np.hypot(off_m[:, 0], off_m[:, 1]) / max(math.dist(end_m[:2], then_m[:2]), 1.0)
        wanted_m[reached:] = -end_m[2] + np.minimum(share, 1.0) * (end_m[2] - then_m[2])
    return wanted_m


def _joined(ground_m: Array, beside: BesideLeg, end_m: Vec3, along_mps: Vec2) -> Array:
    """The way along the leg from where a straight way meets it, (T, 2)."""
    leg_n, leg_e = math.cos(beside.course_rad), math.sin(beside.course_rad)
    aside = (end_m[0] - ground_m[:, 0]) * leg_e - (end_m[1] - ground_m[:, 1]) * leg_n
    there = np.flatnonzero(aside * beside.aside_m <= 0.0)
    if not len(there):
        return ground_m
    after = max(int(there[0]), 1)
    share = aside[after - 1] / (aside[after - 1] - aside[after])
    met_m = ground_m[after - 1] + share * (ground_m[after] - ground_m[after - 1])
    met_s = TIMES_S[after - 1] + share * (TIMES_S[after] - TIMES_S[after - 1])
    joined = ground_m.copy()
    joined[after:] = met_m + np.outer(TIMES_S[after:] - met_s, along_mps)
    return joined


def _approached(flight: OwnFlight, wanted_m: Array, envelope: Envelope) -> Array:
    """Heights flown: the difference from the wanted ones shrinks at the limits, (T,).

    A slope steeper than the limits is left behind.
    """
    rises_mps = float(wanted_m[-1] - wanted_m[0]) / float(TIMES_S[-1])
    own_m = -flight.state.position_m[2]
    off_m = own_m - float(wanted_m[0])
    rate_mps = envelope.max_sink_mps + rises_mps if off_m > 0.0 else envelope.max_climb_mps - rises_mps
    flown_s = np.maximum(TIMES_S - envelope.response_s, 0.0)
    left_m = np.maximum(abs(off_m) - max(rate_mps, _LEAST_RATE_MPS) * flown_s, 0.0)
    altitude_m: Array = wanted_m + math.copysign(1.0, off_m) * left_m
    lowest_m, highest_m = own_m - envelope.max_sink_mps * TIMES_S, own_m + envelope.max_climb_mps * TIMES_S
    return np.minimum(np.maximum(altitude_m, lowest_m), highest_m)


def _circled(flight: OwnFlight, ground_m: Array, centre_m: Vec3) -> Array:
    """The way around the circle from where it is reached, (T, 2)."""
    radius_m = loiter_radius_m(flight.goal)
    off_m = ground_m - centre_m[:2]
    reached = 0 if flight.circles else _near(np.hypot(off_m[:, 0], off_m[:, 1]) - radius_m)
    if reached is None:
        return ground_m
    left_s = TIMES_S[reached:] - TIMES_S[reached]
    turned_rad = _sense(flight) * flight.mission.airspeed_mps / radius_m * left_s
    bearing_rad = math.atan2(off_m[reached, 1], off_m[reached, 0]) + turned_rad
    # From beside the circle the radius is approached in about a quarter of it.
    here_m = math.hypot(*off_m[reached])
    reach_m = radius_m + (here_m - radius_m) * np.exp(-np.abs(turned_rad))
    circled = ground_m.copy()
    circled[reached:, 0] = centre_m[0] + reach_m * np.cos(bearing_rad)
    circled[reached:, 1] = centre_m[1] + reach_m * np.sin(bearing_rad)
    return circled


def _first(mask: Mask) -> int | None:
    found = np.flatnonzero(mask)
    return int(found[0]) if len(found) else None


def _sense(flight: OwnFlight) -> float:
    """1 for a circle to the right, -1 to the left; where the radius is unknown, as we turn around it now."""
    radius_m, centre_m = flight.goal.loiter_radius_m, flight.goal.position_m
    if radius_m or centre_m is None or not flight.circles:
        return math.copysign(1.0, radius_m or 1.0)
    (north_m, east_m, _), (north_mps, east_mps) = flight.state.position_m, flight.state.ground_mps
    return math.copysign(1.0, (north_m - centre_m[0]) * east_mps - (east_m - centre_m[1]) * north_mps)
