"""The mission flown ahead: straight on, along a leg and its slope, back to that leg, or around a circle."""

import math

import numpy as np

from companion.avoidance.cone import Array
from companion.avoidance.envelope import Envelope
from companion.avoidance.leg import BesideLeg
from companion.avoidance.trajectory import (
    TIMES_S,
    Commands,
    OwnFlight,
    Paths,
    fly_ahead,
    ground_velocity_mps,
    loiter_radius_m,
)
from companion.model import Vec2, Vec3

# A slope leaves at least this much of the climb and sink limits to reach it.
_LEAST_RATE_MPS = 0.3
_LEVEL_M = 1.0


def mission_path(flight: OwnFlight, envelope: Envelope) -> Paths:
    """The path of the mission as one row, at the times of the prediction."""
    paths = fly_ahead(flight.state, Commands.of([flight.mission]), envelope)
    goal, beside = flight.goal, flight.beside
    if goal.position_m is None or (beside is None and goal.loiter_radius_m is None):
        return paths
    ground_m, altitude_m = paths.ground_m[0], paths.altitude_m[0]
    if beside is not None and goal.leg_from_m is not None:
        if flight.bends:
            ground_m = _joined(ground_m, beside, goal.position_m, _along_mps(flight, beside))
        if abs(goal.leg_from_m[2] - goal.position_m[2]) > _LEVEL_M:
            altitude_m = _sloped(flight, beside, ground_m, envelope)
    if goal.loiter_radius_m is not None:
        ground_m = _circled(flight, ground_m, goal.position_m)
    return Paths(ground_m[None], altitude_m[None], paths.ground_of, paths.height_of)


def _along_mps(flight: OwnFlight, beside: BesideLeg) -> Vec2:
    return ground_velocity_mps(beside.course_rad, flight.mission.airspeed_mps, flight.state.wind_mps)


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


def _sloped(flight: OwnFlight, beside: BesideLeg, ground_m: Array, envelope: Envelope) -> Array:
    """Heights along the way: the difference from the slope shrinks at the limits, (T,)."""
    start_m, end_m = flight.goal.leg_from_m, flight.goal.position_m
    assert start_m is not None
    assert end_m is not None
    leg_n, leg_e = math.cos(beside.course_rad), math.sin(beside.course_rad)
    to_go_m = (end_m[0] - ground_m[:, 0]) * leg_n + (end_m[1] - ground_m[:, 1]) * leg_e
    leg_m = -end_m[2] + np.clip(to_go_m / beside.length_m, 0.0, 1.0) * (end_m[2] - start_m[2])
    rises_mps = float(leg_m[-1] - leg_m[0]) / float(TIMES_S[-1])
    off_m = -flight.state.position_m[2] - float(leg_m[0])
    rate_mps = envelope.max_sink_mps + rises_mps if off_m > 0.0 else envelope.max_climb_mps - rises_mps
    flown_s = np.maximum(TIMES_S - envelope.response_s, 0.0)
    left_m = np.maximum(abs(off_m) - max(rate_mps, _LEAST_RATE_MPS) * flown_s, 0.0)
    altitude_m: Array = leg_m + math.copysign(1.0, off_m) * left_m
    return altitude_m


def _circled(flight: OwnFlight, ground_m: Array, centre_m: Vec3) -> Array:
    """The way around the circle from where it is reached, (T, 2)."""
    radius_m = loiter_radius_m(flight.goal)
    off_m = ground_m - centre_m[:2]
    reached = 0 if flight.circles else _first(np.hypot(off_m[:, 0], off_m[:, 1]) <= radius_m)
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


def _first(mask: "np.ndarray[tuple[int], np.dtype[np.bool_]]") -> int | None:
    found = np.flatnonzero(mask)
    return int(found[0]) if len(found) else None


def _sense(flight: OwnFlight) -> float:
    """1 for a circle to the right, -1 to the left; where the radius is unknown, as we turn around it now."""
    radius_m, centre_m = flight.goal.loiter_radius_m, flight.goal.position_m
    if radius_m or centre_m is None or not flight.circles:
        return math.copysign(1.0, radius_m or 1.0)
    (north_m, east_m, _), (north_mps, east_mps) = flight.state.position_m, flight.state.ground_mps
    return math.copysign(1.0, (north_m - centre_m[0]) * east_mps - (east_m - centre_m[1]) * north_mps)
