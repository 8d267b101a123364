"""Ownship and its mission, as the prediction needs them."""

import math
from typing import NamedTuple

import numpy as np

from companion.avoidance.geometry import Array, position_at
from companion.avoidance.prediction_times import HORIZON_S
from companion.model import Goal, Guidance, Ownship, Vec2, Vec3


class OwnState(NamedTuple):
    """Ownship now: position north-east-down, course over ground, airspeed, climb, wind (north, east).

    `heading_rad` is `None` where the heading follows from the course and the wind. In a wind stronger than
    the airspeed it does not, and is given.
    """

    position_m: Vec3
    course_rad: float
    airspeed_mps: float
    climb_mps: float
    wind_mps: Vec2
    heading_rad: float | None = None

    @property
    def crab_rad(self) -> float:
        """Angle from the heading to the course, positive where the nose is left of the course."""
        if self.heading_rad is None:
            return _steady_crab_rad(self.course_rad, self.airspeed_mps, self.wind_mps)
        return math.remainder(self.course_rad - self.heading_rad, math.tau)

    @property
    def ground_mps(self) -> Vec2:
        """Present velocity over ground: north and east."""
        return _over_ground_mps(self.course_rad - self.crab_rad, self.airspeed_mps, self.wind_mps)

    @property
    def velocity_mps(self) -> Array:
        """Present velocity north-east-down, (3,)."""
        return np.array([*self.ground_mps, -self.climb_mps])

    def distance_m(self, place_m: Vec3) -> float:
        """Horizontal distance to a place."""
        return math.hypot(place_m[0] - self.position_m[0], place_m[1] - self.position_m[1])


class OwnFlight(NamedTuple):
    """Ownship and what its mission asks for from here.

    `mission` is the guidance that leads to `goal`, not limited to what the aircraft can fly; `onward_mps` is
    the velocity over ground on it, north and east.
    """

    state: OwnState
    mission: Guidance
    onward_mps: Vec2
    goal: Goal

    @classmethod
    def at(cls, now_s: float, own: Ownship, goal: Goal) -> "OwnFlight":
        """The flight of ownship towards a goal at `now_s`."""
        state = own_state(now_s, own)
        mission = mission_guidance(state, own, goal)
        onward_mps = ground_velocity_mps(mission.course_rad, mission.airspeed_mps, state.wind_mps)
        return cls(state, mission, onward_mps, goal)

    @property
    def horizon_s(self) -> float:
        """How far ahead flights are judged [s]: no further than to the end of the flight."""
        return self.time_to_goal_s if self.goal.is_end else HORIZON_S

    @property
    def time_to_goal_s(self) -> float:
        """Time to the goal's position, at most the prediction horizon; the horizon if it has none [s]."""
        if self.goal.position_m is None:
            return HORIZON_S
        north_mps, east_mps = self.onward_mps
        course_rad = self.mission.course_rad
        made_good_mps = north_mps * math.cos(course_rad) + east_mps * math.sin(course_rad)
        # An aircraft that is blown back as fast as it flies, or faster, never arrives.
        return min(HORIZON_S, self.state.distance_m(self.goal.position_m) / max(made_good_mps, 1e-3))


def require_finite(own: Ownship, goal: Goal) -> None:
    """`ValueError` if ownship or goal is not finite: then no decision is safe."""
    numbers = [own.time_s, *own.position_m, *own.velocity_mps, own.airspeed_mps, own.heading_rad]
    numbers += [*(own.wind_mps or ()), *(goal.position_m if goal.position_m is not None else ())]
    numbers += [x for x in (goal.course_rad, goal.airspeed_mps, goal.altitude_m) if x is not None]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("ownship or goal is not finite")


def own_state(now_s: float, own: Ownship) -> OwnState:
    """Ownship at `now_s`, with the wind that it reports or that its motion implies."""
    north_mps, east_mps, down_mps = own.velocity_mps
    ground_speed = math.hypot(north_mps, east_mps)
    airspeed = own.airspeed_mps if own.airspeed_mps > 1.0 else max(ground_speed, 1.0)
    if own.wind_mps is not None:
        wind = own.wind_mps
    else:
        # Wind is the part of the ground velocity that is not airspeed.
        wind = (
            north_mps - airspeed * math.cos(own.heading_rad),
            east_mps - airspeed * math.sin(own.heading_rad),
        )
        # Rejects wind above 60 % of airspeed: the heading is wrong.
        if math.hypot(*wind) > 0.6 * airspeed:
            wind = (0.0, 0.0)
    course = math.atan2(east_mps, north_mps) if ground_speed > 1.0 else own.heading_rad
    # In a wind stronger than the airspeed two headings fly the same course; otherwise the course has one.
    heading = own.heading_rad if math.hypot(*wind) >= airspeed else None
    return OwnState(position_at(own, now_s), course, airspeed, -down_mps, wind, heading)


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


def ground_velocity_mps(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> Vec2:
    """Velocity over ground, north and east, of an aircraft that holds a course in the wind.

    If the wind is too strong for the course, the nose points as far into it as helps, and the aircraft
    drifts.
    """
    heading_rad = course_rad - _steady_crab_rad(course_rad, airspeed_mps, wind_mps)
    return _over_ground_mps(heading_rad, airspeed_mps, wind_mps)


def _over_ground_mps(heading_rad: float, airspeed_mps: float, wind_mps: Vec2) -> Vec2:
    north_mps, east_mps = wind_mps
    return (
        airspeed_mps * math.cos(heading_rad) + north_mps,
        airspeed_mps * math.sin(heading_rad) + east_mps,
    )


def _steady_crab_rad(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> float:
    """Angle by which the nose must be left of a course to hold it (wind triangle)."""
    north_mps, east_mps = wind_mps
    across_mps = east_mps * math.cos(course_rad) - north_mps * math.sin(course_rad)
    return math.asin(min(max(across_mps / max(airspeed_mps, 1e-3), -1.0), 1.0))
