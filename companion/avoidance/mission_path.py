"""The mission flown ahead: along a leg, its slope and the next leg, back to a leg, or around a circle."""

import math

import numpy as np

from companion.avoidance.cone import Array, Mask
from companion.avoidance.envelope import Envelope
from companion.avoidance.leg import ON_LINE_M, BesideLeg
from companion.avoidance.trajectory import (
    HORIZON_S,
    TIMES_S,
    Commands,
    OwnFlight,
    Paths,
    fly_ahead,
    ground_velocity_mps,
    index_at,
    loiter_radius_m,
)
from companion.model import Goal, Vec2, Vec3

# A slope leaves at least this much of the climb and sink limits to reach it.
_LEAST_RATE_MPS = 0.3
_LEVEL_M = 1.0
# An item counts as reached within this distance where it is flown to directly.
_REACHED_M = 90.0
_TURNING_M = 300.0
_MEAN_S = 30.0


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
