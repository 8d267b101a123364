"""Flying ahead: where rows of commands lead, and how well they keep clear of the predicted tracks.

The motion is the paper's (§2.1, eq. 1-2; its print has the cosine twice, y takes the sine), a point that
flies where its nose points, with the limits of §3.2.3 and lags added. Rows come first, then tracks, then
time: (K, N, T). The aircraft answers a command after `response_s`, turns at its bank limit, climbs and sinks
at its limits and holds what it reached. It does so in the air, which the wind carries along; a course is over
ground, and holding it takes a crab angle. Tracks fly on, and go on for a while with the turn they are in.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array, RelativeMotion
from companion.compiled import kernels
from companion.model import Goal, Guidance, Vec2, Vec3
from companion.units import wrap_two_pi

# Fine where a turn happens, coarse where flight is straight: at 90 m/s of closing speed a step of 2 s
# misjudges a miss distance of 600 m by 7 m at most.
TIMES_S = np.concatenate([np.arange(0.0, 12.0, 1.0), np.arange(12.0, 60.0, 2.0), np.arange(60.0, 91.0, 3.0)])
_TIMES_S: list[float] = TIMES_S.tolist()  # to be looked up in
_STEPS_S = np.diff(TIMES_S)
_MIDDLES_S = TIMES_S[:-1] + 0.5 * _STEPS_S
HORIZON_S = float(TIMES_S[-1])
# Turns end at a time that nobody knows: in the encounter models of MIT Lincoln Laboratory an aircraft that is
# in a turn goes on, in the mean, like one whose rate of turn fades with this time constant.
_TURN_FADES_S = 35.0
# What is left of a rate of turn, as a time: with it the course has changed by the middle of each step.
_TURNED_S = _TURN_FADES_S * (1.0 - np.exp(-_MIDDLES_S / _TURN_FADES_S))
# Of the whole time, what lies before each moment but the first.
TIME_SHARES = _STEPS_S / HORIZON_S
# Who hardly moves against us does not keep us from a height for ever.
_LONGEST_CROSSING_S = 30.0
# Slightly more than priced as clear, so that arriving at the height is enough.
_ROOM = 1.02
_TIMES = kernels.Times(TIMES_S, _TURNED_S, TIME_SHARES)


class OwnState(NamedTuple):
    """Ownship as the prediction needs it: position north-east-down, course over ground, wind (north, east).

    `heading_rad`, where the nose points, is `None` when it is what holds the course in this wind. A wind that
    is stronger than the airspeed leaves that open.
    """

    position_m: Vec3
    course_rad: float
    airspeed_mps: float
    climb_mps: float
    wind_mps: Vec2
    heading_rad: float | None = None

    @property
    def crab_rad(self) -> float:
        """How far the nose is left of the course."""
        if self.heading_rad is None:
            return _steady_crab_rad(self.course_rad, self.airspeed_mps, self.wind_mps)
        return math.remainder(self.course_rad - self.heading_rad, math.tau)

    @property
    def ground_mps(self) -> Vec2:
        """Velocity over ground as flown now: north and east."""
        return _over_ground_mps(self.course_rad - self.crab_rad, self.airspeed_mps, self.wind_mps)


@dataclass(frozen=True, slots=True)
class Commands:
    """Rows of commands. Many rows share a ground path or a height, so each of those is kept, and flown, once.

    Ground paths are `course_rad` over ground and `airspeed_mps`, (H,); heights `altitude_m`, (Z,).
    `ground_of` and `height_of`, (K,), say which of them a row consists of.
    """

    course_rad: Array
    airspeed_mps: Array
    altitude_m: Array
    ground_of: NDArray[np.intp]
    height_of: NDArray[np.intp]

    @classmethod
    def of(cls, rows: Sequence[Guidance]) -> "Commands":
        """One ground path and one height for each row."""
        places = _places(len(rows))
        return cls(
            np.array([row.course_rad for row in rows]),
            np.array([row.airspeed_mps for row in rows]),
            np.array([row.altitude_m for row in rows]),
            places,
            places,
        )

    def __len__(self) -> int:
        return len(self.ground_of)

    def row(self, index: int) -> Guidance:
        """The guidance that flies a row."""
        ground, height = self.ground_of[index], self.height_of[index]
        return Guidance(
            wrap_two_pi(float(self.course_rad[ground])),
            float(self.airspeed_mps[ground]),
            float(self.altitude_m[height]),
        )

    def only(self, places: NDArray[np.intp]) -> "Commands":
        """The rows at the given places, in that order."""
        return Commands(
            self.course_rad,
            self.airspeed_mps,
            self.altitude_m,
            self.ground_of[places],
            self.height_of[places],
        )

    def after(self, first: Guidance) -> "Commands":
        """The same rows after one more, which becomes row 0."""
        return Commands(
            np.concatenate([self.course_rad, [first.course_rad]]),
            np.concatenate([self.airspeed_mps, [first.airspeed_mps]]),
            np.concatenate([self.altitude_m, [first.altitude_m]]),
            np.concatenate([[len(self.course_rad)], self.ground_of]),
            np.concatenate([[len(self.altitude_m)], self.height_of]),
        )


@cache
def _places(count: int) -> NDArray[np.intp]:
    places = np.arange(count)
    places.setflags(write=False)
    return places


class Paths(NamedTuple):
    """Where rows lead: `ground_m` (H, T, 2) north and east, `altitude_m` (Z, T), and rows made of them."""

    ground_m: Array
    altitude_m: Array
    ground_of: NDArray[np.intp]
    height_of: NDArray[np.intp]

    def row_m(self, row: int) -> Array:
        """Positions north-east-down along one row, shape (T, 3)."""
        ground, altitude = self.ground_m[self.ground_of[row]], self.altitude_m[self.height_of[row]]
        return np.column_stack([ground, -altitude])


@dataclass(frozen=True, slots=True)
class Tracks:
    """The predicted traffic: positions and velocities (N, 3) now, protected volumes (N,).

    `turn_radps`, (N,), is positive to the right. `ValueError` for arrays that do not belong together.
    """

    ids: tuple[str, ...]
    position_m: Array
    velocity_mps: Array
    protected_horizontal_m: Array
    protected_vertical_m: Array
    grounded: NDArray[np.bool_]
    shell_m: Array  # around the volume, to be kept clear of where possible; 0 where there is none
    turn_radps: Array
    others: kernels.Others = field(init=False, repr=False, compare=False)  # the same, for the kernels

    def __post_init__(self) -> None:
        object.__setattr__(self, "others", kernels.Others(self))

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def none(cls) -> "Tracks":
        """No traffic."""
        nothing = np.zeros(0)
        nowhere, none = np.zeros((0, 3)), np.zeros(0, dtype=bool)
        return cls((), nowhere, nowhere, nothing, nothing, none, nothing, nothing)

    def subset(self, index: NDArray[np.intp]) -> "Tracks":
        """The tracks at the given places, in that order."""
        return Tracks(
            tuple(self.ids[i] for i in index.tolist()),
            self.position_m[index],
            self.velocity_mps[index],
            self.protected_horizontal_m[index],
            self.protected_vertical_m[index],
            self.grounded[index],
            self.shell_m[index],
            self.turn_radps[index],
        )

    def velocity_until_closest_mps(self, path_m: Array) -> Array:
        """Velocities until the closest approach to a ground path (T, 2); the mean, if one turns, (N, 3)."""
        velocity_mps: Array = kernels.velocities_until_closest(self, path_m, _TIMES)
        return velocity_mps

    def ground_m(self) -> Array:
        """Where they are at the times of the prediction, north and east, shape (N, T, 2)."""
        ahead_m: Array = kernels.tracks_ahead(self, _TIMES)
        return ahead_m


class Surprises(NamedTuple):
    """What tracks may do instead of flying on as they do, (M,): turn and sink at other rates.

    `of` is the place of the track; `turn_radps` is positive to the right, `sink_mps` down; `likely` is the
    share of times that it comes true.
    """

    of: NDArray[np.intp]
    turn_radps: Array
    sink_mps: Array
    likely: Array


class LossWeights(Protocol):
    """What it costs to come near."""

    @property
    def margin(self) -> float:
        """Times the penetration of the margin, 0 at its edge."""

    @property
    def loss(self) -> float:
        """Flat, for entering the bare volume."""

    @property
    def depth(self) -> float:
        """Times the deepest penetration of the bare volume."""

    @property
    def exposure(self) -> float:
        """Times the mean penetration over time."""


class Separation(NamedTuple):
    """How rows keep clear, shape (K, N). One is the edge of the protected volume, with its margin.

    `closest` is the smallest over time of max(horizontal / protected, vertical / protected); `exposure` the
    mean over time of how deep the volume is penetrated, which tells rows apart that start inside it;
    `nearness` the mean over time of how deep a shell around the volume is penetrated, 1 within the volume;
    `entered_s` the first time in the volume [s], inf where it is kept clear of.
    """

    closest: Array
    exposure: Array
    nearness: Array
    entered_s: Array


def times_until(time_s: float) -> Array:
    """The times of the prediction until the first that is not before `time_s`, two at least, (T,)."""
    return TIMES_S[: moment_at(time_s) + 1]


def moment_at(time_s: float) -> int:
    """Place of the first time of the prediction that is not before `time_s`; the first step at least."""
    return min(max(bisect_left(_TIMES_S, time_s), 1), len(_TIMES_S) - 1)


def turn_around_s(own: OwnState, envelope: Envelope) -> float:
    """How long it takes to fly back on the opposite course at the present airspeed [s].

    Against wind from the side the nose turns by more than half a circle, by twice the largest crab angle.
    """
    wind = min(math.hypot(*own.wind_mps) / own.airspeed_mps, 1.0)
    turn_rad = math.pi + 2.0 * math.asin(wind)
    return envelope.response_s + turn_rad / envelope.turn_rate_radps(own.airspeed_mps)


def to_goal(position_m: Vec3, course_rad: float, goal: Goal) -> tuple[float, float]:
    """Course and height that lead to a goal from a north-east-down position on a present course [rad, m]."""
    north_m, east_m, down_m = position_m
    altitude_m = -down_m if goal.altitude_m is None else goal.altitude_m
    if goal.position_m is None:
        return course_rad if goal.course_rad is None else goal.course_rad, altitude_m
    north, east = goal.position_m[0] - north_m, goal.position_m[1] - east_m
    if math.hypot(north, east) > 1.0:  # on top of the goal its bearing means nothing
        course_rad = math.atan2(east, north)
    return course_rad, -goal.position_m[2] if goal.altitude_m is None else altitude_m


def fly_ahead(own: OwnState, commands: Commands, envelope: Envelope) -> Paths:
    """Fly all rows ahead, at the times of the prediction."""
    return Paths(
        _ground_m(own, commands.course_rad, commands.airspeed_mps, envelope),
        _altitude_m(own, commands.altitude_m, envelope),
        commands.ground_of,
        commands.height_of,
    )


def _ground_m(own: OwnState, target_rad: Array, target_mps: Array, envelope: Envelope) -> Array:
    """Ground paths by eq. 2, shape (H, T, 2): turn at the bank limit, speed up or slow down, hold.

    The nose turns the way round that is short for the course, as autopilots fly it.
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
        _TIMES,
    )
    return path_m


def ground_velocity_mps(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> Vec2:
    """Velocity over ground, north and east, of holding a course in the wind.

    Where the wind is too strong for the course the nose points as far into it as helps, and the aircraft goes
    where it is blown.
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
    """How far left of a course the nose must point to hold it: the wind triangle."""
    north_mps, east_mps = wind_mps
    across_mps = east_mps * math.cos(course_rad) - north_mps * math.sin(course_rad)
    return math.asin(min(max(across_mps / max(airspeed_mps, 1e-3), -1.0), 1.0))


def _altitude_m(own: OwnState, target_m: Array, envelope: Envelope) -> Array:
    """Heights, shape (Z, T): the present climb until the command bites, then at the limit, then hold."""
    now_m = -own.position_m[2]
    climb_mps = min(max(own.climb_mps, -2.0 * envelope.max_sink_mps), 2.0 * envelope.max_climb_mps)
    altitude_m: Array = kernels.altitudes(
        now_m,
        climb_mps,
        target_m,
        envelope.response_s,
        envelope.max_sink_mps,
        envelope.max_climb_mps,
        _TIMES,
    )
    return altitude_m


def separation(
    paths: Paths, tracks: Tracks, *, horizon_s: float = HORIZON_S, shells: bool = False
) -> Separation:
    """How rows keep clear of the tracks flying on, and of the shells around them if asked for.

    Only what happens within `horizon_s` counts.
    """
    return Separation(*kernels.separation(paths, tracks, _TIMES, _count_until(horizon_s), shells))


def losses(
    paths: Paths,
    tracks: Tracks,
    surprises: Surprises,
    weights: LossWeights,
    lost: float,
    *,
    horizon_s: float,
    soon_s: float,
) -> tuple[Array, Array]:
    """What rows cost by how they keep clear, (K,), and how close they come to what is predicted, (K,).

    That is the tracks flying on, within `horizon_s`; each surprise may come true, as likely as it is, and
    counts within `soon_s`. `lost` is the separation at which the bare volume is entered.
    """
    cost, closest = kernels.losses(
        paths, tracks, surprises, weights, lost, _TIMES, _count_until(horizon_s), _count_until(soon_s)
    )
    return cost, closest


def _count_until(time_s: float) -> int:
    """How many times of the prediction are not after this, two at least."""
    return max(bisect_right(_TIMES_S, time_s), 2)


def heights_to_pass(
    tracks: Tracks, motion: RelativeMotion, conflict: NDArray[np.bool_]
) -> tuple[float, float, float]:
    """Heights that pass over, and under, all tracks in conflict, (N,) [m], and when all are passed [s].

    A track's height matters while it is within the horizontal volume, around the closest approach.
    """
    over_m, under_m, passed_s = kernels.heights_to_pass(
        tracks,
        motion.own_velocity_mps,
        motion.time_to_closest_s,
        conflict,
        _LONGEST_CROSSING_S,
        HORIZON_S,
        _ROOM,
    )
    return over_m, under_m, min(passed_s, HORIZON_S)


def outcomes(
    paths: Paths,
    tracks: Tracks,
    then: int,
    mission_m: Array,
    onward_mps: Vec2,
    altitude_m: float,
    *,
    aside: float,
    unresolved: float,
) -> Array:
    """What ground paths cost by where they are at moment `then`, and by what is left to do, shape (H,).

    `aside` is for each metre from where the mission would be, (2,). `unresolved` is for how deep the worst
    volume is entered by who flies straight on from there, over ground and at a height: 1 through its middle.
    """
    price: Array = kernels.outcomes(
        paths, tracks, then, mission_m, aside, unresolved, *onward_mps, altitude_m, _TIMES
    )
    return price
