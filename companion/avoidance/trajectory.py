"""Our own flight ahead: the times of a prediction, own state and mission, and where commands lead.

The motion is the paper's (§2.1, eq. 1-2, where y takes the sine; the cosine is printed twice): a point that
moves where its nose points, here with the limits of §3.2.3 and a response time. The aircraft answers a
command after `response_s`, turns at its bank limit, climbs and sinks at its limits, and holds what it has
reached. The wind carries it along. A command's course is over ground, and holding it takes a crab angle.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.cone import Array, position_at
from companion.avoidance.envelope import Envelope
from companion.avoidance.leg import ON_LINE_M, BesideLeg, beside_leg
from companion.compiled import kernels
from companion.model import Goal, Guidance, Ownship, Vec2, Vec3
from companion.units import wrap_pi, wrap_two_pi

# Fine where a turn happens, coarse where flight is straight: at a closing speed of 90 m/s a step of 2 s
# misjudges a miss distance of 600 m by 7 m at most.
TIMES_S = np.concatenate([np.arange(0.0, 12.0, 1.0), np.arange(12.0, 60.0, 2.0), np.arange(60.0, 91.0, 3.0)])
HORIZON_S = float(TIMES_S[-1])
_TIMES_S: list[float] = TIMES_S.tolist()  # for bisection
_STEPS_S = np.diff(TIMES_S)
_MIDDLES_S = TIMES_S[:-1] + 0.5 * _STEPS_S
# The share of the whole time that each step takes.
TIME_SHARES = _STEPS_S / HORIZON_S
# The end of a turn is unknown. In the encounter models of MIT Lincoln Laboratory a turning aircraft flies on,
# in the mean, like one whose turn rate decays with this time constant.
_TURN_DECAY_S = 35.0
# Times the initial turn rate, the change of course by the middle of each step.
_TURNED_S = _TURN_DECAY_S * (1.0 - np.exp(-_MIDDLES_S / _TURN_DECAY_S))
KERNEL_TIMES = kernels.Times(TIMES_S, _TURNED_S, TIME_SHARES)
# A circle is flown from this far outside; its radius where none is known.
_ON_CIRCLE_M = 60.0
_USUAL_RADIUS_M = 80.0
# At a smaller corner the mission counts as straight.
_STRAIGHT_RAD = math.radians(15.0)


def times_until(time_s: float) -> Array:
    """The times until the first one that is not before `time_s`, at least two, (T,)."""
    return TIMES_S[: index_at(time_s) + 1]


def index_at(time_s: float) -> int:
    """Index of the first time that is not before `time_s`, at least 1."""
    return min(max(bisect_left(_TIMES_S, time_s), 1), len(_TIMES_S) - 1)


def count_until(time_s: float) -> int:
    """Number of times that are not after `time_s`, at least 2."""
    return max(bisect_right(_TIMES_S, time_s), 2)


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
    the velocity over ground on it, north and east. `beside` is set on the way along a leg or back to it, and
    `circles` when the goal is circled now. Where the mission `bends`, `ahead` is its path, and `onward_mps`
    the mean velocity along it (see `mission_path`).
    """

    state: OwnState
    mission: Guidance
    onward_mps: Vec2
    goal: Goal
    beside: BesideLeg | None = None
    circles: bool = False
    bends: bool = False
    ahead: "Paths | None" = None
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


def require_finite(own: Ownship, goal: Goal) -> None:
    """Raise `ValueError` if ownship or goal is not finite: then no decision is safe."""
    numbers = [own.time_s, *own.position_m, *own.velocity_mps, own.airspeed_mps, own.heading_rad]
    numbers += [*(own.wind_mps or ()), *(goal.position_m if goal.position_m is not None else ())]
    numbers += [*(goal.leg_from_m or ()), *(goal.then_m or ())]
    values = goal.course_rad, goal.airspeed_mps, goal.altitude_m, goal.loiter_radius_m
    numbers += [x for x in values if x is not None]
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


def ground_velocity_mps(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> Vec2:
    """Velocity over ground, north and east, of an aircraft that holds a course in the wind.

    If the wind is too strong to hold the course, the nose points across the course, against the wind, and
    the aircraft drifts.
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


@dataclass(frozen=True, slots=True)
class Commands:
    """Rows of commands. Ground paths and heights that rows share are stored, and flown ahead, once.

    Ground paths are `course_rad` over ground and `airspeed_mps`, (H,). Heights are `altitude_m`, (Z,). Row k
    is the ground path at index `ground_of[k]` and the height at index `height_of[k]`, (K,) both.
    """

    course_rad: Array
    airspeed_mps: Array
    altitude_m: Array
    ground_of: NDArray[np.intp]
    height_of: NDArray[np.intp]

    @classmethod
    def of(cls, rows: Sequence[Guidance]) -> "Commands":
        """One ground path and one height for each row."""
        indices = _indices(len(rows))
        return cls(
            np.array([row.course_rad for row in rows]),
            np.array([row.airspeed_mps for row in rows]),
            np.array([row.altitude_m for row in rows]),
            indices,
            indices,
        )

    def __len__(self) -> int:
        return len(self.ground_of)

    def row(self, index: int) -> Guidance:
        """One row as a guidance."""
        ground, height = self.ground_of[index], self.height_of[index]
        return Guidance(
            wrap_two_pi(float(self.course_rad[ground])),
            float(self.airspeed_mps[ground]),
            float(self.altitude_m[height]),
        )

    def subset(self, indices: NDArray[np.intp]) -> "Commands":
        """The rows at the given indices, in that order."""
        return Commands(
            self.course_rad,
            self.airspeed_mps,
            self.altitude_m,
            self.ground_of[indices],
            self.height_of[indices],
        )

    def preceded_by(self, first: Guidance) -> "Commands":
        """The same rows after one more, which becomes row 0."""
        return Commands(
            np.concatenate([self.course_rad, [first.course_rad]]),
            np.concatenate([self.airspeed_mps, [first.airspeed_mps]]),
            np.concatenate([self.altitude_m, [first.altitude_m]]),
            np.concatenate([[len(self.course_rad)], self.ground_of]),
            np.concatenate([[len(self.altitude_m)], self.height_of]),
        )


@cache
def _indices(count: int) -> NDArray[np.intp]:
    indices = np.arange(count)
    indices.setflags(write=False)
    return indices


class Paths(NamedTuple):
    """Rows flown ahead: `ground_m` (H, T, 2) north and east, `altitude_m` (Z, T), rows as in `Commands`."""

    ground_m: Array
    altitude_m: Array
    ground_of: NDArray[np.intp]
    height_of: NDArray[np.intp]

    def row_m(self, row: int) -> Array:
        """Positions north-east-down along one row, (T, 3)."""
        ground, altitude = self.ground_m[self.ground_of[row]], self.altitude_m[self.height_of[row]]
        return np.column_stack([ground, -altitude])


def fly_ahead(own: OwnState, commands: Commands, envelope: Envelope) -> Paths:
    """Paths of all rows at the times of the prediction."""
    return Paths(
        _ground_m(own, commands.course_rad, commands.airspeed_mps, envelope),
        _altitude_m(own, commands.altitude_m, envelope),
        commands.ground_of,
        commands.height_of,
    )


def _ground_m(own: OwnState, target_rad: Array, target_mps: Array, envelope: Envelope) -> Array:
    """Ground paths by eq. 2, (H, T, 2): turn at the bank limit, change speed, hold.

    The nose turns in the direction in which the change of course is smaller, as autopilots do it.
    """
    path_m: Array = kernels.ground_paths(
        own.position_m[0],
        own.position_m[1],
        own.course_rad,
        own.crab_rad,
        own.airspeed_mps,
        own.wind_mps[0],
        own.wind_mps[1],
        target_rad,
        target_mps,
        envelope.turn_acceleration_mps2,
        envelope.max_turn_rate_radps,
        envelope.response_s,
        envelope.max_acceleration_mps2,
        KERNEL_TIMES,
    )
    return path_m


def _altitude_m(own: OwnState, target_m: Array, envelope: Envelope) -> Array:
    """Heights, (Z, T): the present climb during the response time, then the limit, then the target."""
    now_m = -own.position_m[2]
    climb_mps = min(max(own.climb_mps, -2.0 * envelope.max_sink_mps), 2.0 * envelope.max_climb_mps)
    altitude_m: Array = kernels.altitudes(
        now_m,
        climb_mps,
        target_m,
        envelope.response_s,
        envelope.max_sink_mps,
        envelope.max_climb_mps,
        KERNEL_TIMES,
    )
    return altitude_m


def turn_around_s(own: OwnState, envelope: Envelope) -> float:
    """Time to reach the opposite course at the present airspeed [s].

    In a crosswind the nose turns by half a circle and twice the largest crab angle.
    """
    wind = min(math.hypot(*own.wind_mps) / own.airspeed_mps, 1.0)
    turn_rad = math.pi + 2.0 * math.asin(wind)
    return envelope.response_s + turn_rad / envelope.turn_rate_radps(own.airspeed_mps)
