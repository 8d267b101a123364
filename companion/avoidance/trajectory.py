"""How our own aircraft flies: its controls and limits, its state, and where commands lead.

The motion is the paper's (§2.1, eq. 1-2, where y takes the sine; the cosine is printed twice): a point that
moves where its nose points, here with the limits of §3.2.3 and a response time. The aircraft answers a
command after `response_s`, turns at its bank limit, climbs and sinks at its limits, and holds what it has
reached. The wind carries it along. A command's course is over ground, and holding it takes a crab angle.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from numpy.typing import NDArray

from companion.compiled import kernels
from companion.geodesy import wrap_two_pi
from companion.model import Guidance, Ownship, Track, Vec2, Vec3
from companion.units import STANDARD_GRAVITY_MPS2

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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


def times_until(time_s: float) -> Array:
    """The times until the first one that is not before `time_s`, at least two, (T,)."""
    return TIMES_S[: index_at(time_s) + 1]


def index_at(time_s: float) -> int:
    """Index of the first time that is not before `time_s`, at least 1."""
    return min(max(bisect_left(_TIMES_S, time_s), 1), len(_TIMES_S) - 1)


def count_until(time_s: float) -> int:
    """Number of times that are not after `time_s`, at least 2."""
    return max(bisect_right(_TIMES_S, time_s), 2)


class Control(StrEnum):
    """A quantity that an avoidance can change."""

    HEADING = "heading"
    SPEED = "speed"
    HEIGHT = "height"


ALL_CONTROLS = frozenset(Control)


class Pace(StrEnum):
    """A choice of airspeed."""

    KEEP = "keep"  # the mission's
    SLOWEST = "slowest"
    FASTEST = "fastest"


@dataclass(frozen=True)
class Envelope:
    """Limits and response of the aircraft. The defaults suit a small fixed wing of 20-25 m/s."""

    min_airspeed_mps: Annotated[float, Gt(0), Le(200)] = 16.0
    max_airspeed_mps: Annotated[float, Gt(0), Le(200)] = 28.0
    max_bank_rad: Annotated[float, Gt(0), Lt(math.radians(80))] = math.radians(30.0)
    max_turn_rate_radps: Annotated[float, Gt(0), Le(math.radians(90))] = math.radians(20.0)
    max_climb_mps: Annotated[float, Gt(0), Le(50)] = 2.5
    max_sink_mps: Annotated[float, Gt(0), Le(50)] = 2.5
    # Time from a command to the turn or climb that it causes. ArduPlane turned 77 degrees in 9.5 s at a bank
    # of 27 degrees, which a delay of one second and then the full rate describe well.
    response_s: Annotated[float, Ge(0), Le(10)] = 1.0
    max_acceleration_mps2: Annotated[float, Gt(0), Le(20)] = 1.0
    # Heights above the zero of the local frame that no row may leave; `None`: no limit.
    min_altitude_m: float | None = None
    max_altitude_m: float | None = None

    def __post_init__(self) -> None:
        if self.min_airspeed_mps > self.max_airspeed_mps:
            raise ValueError("min_airspeed_mps must not exceed max_airspeed_mps")
        if (
            self.min_altitude_m is not None
            and self.max_altitude_m is not None
            and self.min_altitude_m > self.max_altitude_m
        ):
            raise ValueError("min_altitude_m must not exceed max_altitude_m")

    @property
    def turn_acceleration_mps2(self) -> float:
        """Lateral acceleration of a coordinated turn at the bank limit: g tan(bank)."""
        return STANDARD_GRAVITY_MPS2 * math.tan(self.max_bank_rad)

    def turn_rate_radps(self, airspeed_mps: float) -> float:
        """Turn rate of a coordinated turn at the bank limit, g tan(bank) / V, within the rate limit."""
        return min(self.turn_acceleration_mps2 / max(airspeed_mps, 1.0), self.max_turn_rate_radps)

    def within_limits(self, guidance: Guidance) -> Guidance:
        """The guidance, with airspeed and height within the limits."""
        return Guidance(
            guidance.course_rad,
            self.clamp_airspeed_mps(guidance.airspeed_mps),
            self.clamp_altitude_m(guidance.altitude_m),
        )

    def clamp_airspeed_mps(self, airspeed_mps: float) -> float:
        """The nearest airspeed that can be flown."""
        return min(max(airspeed_mps, self.min_airspeed_mps), self.max_airspeed_mps)

    def airspeed_mps(self, pace: Pace, wanted_mps: float) -> float:
        """The airspeed of a pace, within the limits; `wanted_mps` is that of `Pace.KEEP`."""
        if pace is Pace.KEEP:
            return self.clamp_airspeed_mps(wanted_mps)
        return self.min_airspeed_mps if pace is Pace.SLOWEST else self.max_airspeed_mps

    def clamp_altitude_m(self, altitude_m: float) -> float:
        """The nearest height between floor and ceiling."""
        if self.max_altitude_m is not None:
            altitude_m = min(altitude_m, self.max_altitude_m)
        if self.min_altitude_m is not None:
            altitude_m = max(altitude_m, self.min_altitude_m)
        return altitude_m


def position_at(moving: Ownship | Track, now_s: float) -> Vec3:
    """Position at `now_s` [m] after straight flight from the time of the state."""
    since_s = now_s - moving.time_s
    (north_m, east_m, down_m), (north_mps, east_mps, down_mps) = moving.position_m, moving.velocity_mps
    return north_m + north_mps * since_s, east_m + east_mps * since_s, down_m + down_mps * since_s


def any_of(values: Array | Mask) -> bool:
    """Whether any value is not 0. For short arrays this is five times as fast as `ndarray.any`."""
    return bool(np.count_nonzero(values))


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
