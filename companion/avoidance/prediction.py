"""Flying ahead: where rows of commands lead, and how well they keep clear of the predicted tracks.

The motion is the paper's (§2.1, eq. 1-2; its print has the cosine twice, y takes the sine), a point that
flies where its nose points, with the limits of §3.2.3 and lags added. Rows come first, then tracks, then
time: (K, N, T). The aircraft answers a command after `response_s`, turns at its bank limit, climbs and sinks
at its limits and holds what it reached. It does so in the air, which the wind carries along; a course is over
ground, and holding it takes a crab angle. Tracks fly on, and go on for a while with the turn they are in.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array, vertical_distance_m, wrap_pi
from companion.model import Goal, Guidance
from companion.units import wrap_two_pi

# Fine where a turn happens, coarse where flight is straight: at 90 m/s of closing speed a step of 2 s
# misjudges a miss distance of 600 m by 7 m at most.
TIMES_S = np.concatenate([np.arange(0.0, 12.0, 1.0), np.arange(12.0, 60.0, 2.0), np.arange(60.0, 91.0, 3.0)])
_STEPS_S = np.diff(TIMES_S)
_MIDDLES_S = TIMES_S[:-1] + 0.5 * _STEPS_S
HORIZON_S = float(TIMES_S[-1])
# Millimetres over ten kilometres, and half the memory to walk through.
_Float = np.float32
# Turns end at a time that nobody knows: in the encounter models of MIT Lincoln Laboratory an aircraft that is
# in a turn goes on, in the mean, like one whose rate of turn fades with this time constant.
_TURN_FADES_S = 35.0
# What is left of a rate of turn, as a time: with it the course has changed by the middle of each step.
_TURNED_S = _TURN_FADES_S * (1.0 - np.exp(-_MIDDLES_S / _TURN_FADES_S))
# Of the whole time, what lies before each moment but the first.
TIME_SHARES = _STEPS_S / HORIZON_S
_EXPOSURE_WEIGHTS = TIME_SHARES.astype(_Float)


@dataclass(frozen=True, slots=True)
class OwnState:
    """Ownship as the prediction needs it: position north-east-down, course over ground, wind (north, east).

    `heading_rad`, where the nose points, is `None` when it is what holds the course in this wind. A wind that
    is stronger than the airspeed leaves that open.
    """

    position_m: Array
    course_rad: float
    airspeed_mps: float
    climb_mps: float
    wind_mps: Array
    heading_rad: float | None = None

    @property
    def crab_rad(self) -> float:
        """How far the nose is left of the course."""
        if self.heading_rad is None:
            return _steady_crab_rad(self.course_rad, self.airspeed_mps, self.wind_mps)
        return math.remainder(self.course_rad - self.heading_rad, math.tau)

    @property
    def ground_mps(self) -> Array:
        """Velocity over ground as flown now: north and east, (2,)."""
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
        places = np.arange(len(rows))
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


@dataclass(frozen=True, slots=True)
class Paths:
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

    `turn_radps`, (N,), is positive to the right.
    """

    ids: tuple[str, ...]
    position_m: Array
    velocity_mps: Array
    protected_horizontal_m: Array
    protected_vertical_m: Array
    grounded: NDArray[np.bool_]
    shell_m: Array  # around the volume, to be kept clear of where possible; 0 where there is none
    turn_radps: Array

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

    def but(self, *, turn_radps: Array | None = None, climb_mps: Array | None = None) -> "Tracks":
        """The same with other rates of turn, or of climb, (N,)."""
        velocity_mps = self.velocity_mps
        if climb_mps is not None:
            velocity_mps = np.column_stack([velocity_mps[:, :2], -climb_mps])
        return replace(
            self,
            velocity_mps=velocity_mps,
            turn_radps=self.turn_radps if turn_radps is None else turn_radps,
        )

    def followed_by(self, *others: "Tracks") -> "Tracks":
        """These, and others after them."""
        listed = (self, *others)
        return Tracks(
            tuple(track_id for tracks in listed for track_id in tracks.ids),
            np.concatenate([tracks.position_m for tracks in listed]),
            np.concatenate([tracks.velocity_mps for tracks in listed]),
            np.concatenate([tracks.protected_horizontal_m for tracks in listed]),
            np.concatenate([tracks.protected_vertical_m for tracks in listed]),
            np.concatenate([tracks.grounded for tracks in listed]),
            np.concatenate([tracks.shell_m for tracks in listed]),
            np.concatenate([tracks.turn_radps for tracks in listed]),
        )

    def ground_m(self) -> Array:
        """Where they are at the times of the prediction, north and east, shape (N, T, 2)."""
        ahead: Array = self.position_m[:, None, :2] + self.velocity_mps[:, None, :2] * TIMES_S[:, None]
        for track in np.flatnonzero(self.turn_radps).tolist():
            north_mps, east_mps = self.velocity_mps[track, :2].tolist()
            turned = np.exp(1j * self.turn_radps[track] * _TURNED_S) * complex(north_mps, east_mps)
            flown = np.cumsum(turned * _STEPS_S)
            ahead[track, 1:, 0] = self.position_m[track, 0] + flown.real
            ahead[track, 1:, 1] = self.position_m[track, 1] + flown.imag
        return ahead


@dataclass(frozen=True, slots=True)
class Separation:
    """How rows keep clear, shape (K, N). One is the edge of the protected volume, with its margin.

    `closest` is the smallest over time of max(horizontal / protected, vertical / protected); `exposure` the
    mean over time of how deep the volume is penetrated, which tells rows apart that start inside it;
    `nearness` the mean over time of how deep a shell around the volume is penetrated, 1 within the volume.
    """

    closest: Array
    exposure: Array
    nearness: Array


def times_until(time_s: float) -> Array:
    """The times of the prediction until the first that is not before `time_s`, two at least, (T,)."""
    return TIMES_S[: max(int(np.searchsorted(TIMES_S, time_s)) + 1, 2)]


def turn_around_s(own: OwnState, envelope: Envelope) -> float:
    """How long it takes to fly back on the opposite course at the present airspeed [s].

    Against wind from the side the nose turns by more than half a circle, by twice the largest crab angle.
    """
    wind = min(math.hypot(own.wind_mps[0], own.wind_mps[1]) / own.airspeed_mps, 1.0)
    turn_rad = math.pi + 2.0 * math.asin(wind)
    return envelope.response_s + turn_rad / envelope.turn_rate_radps(own.airspeed_mps)


def to_goal(position_m: Sequence[float], course_rad: float, goal: Goal) -> tuple[float, float]:
    """Course and height that lead to a goal from a north-east-down position on a present course [rad, m]."""
    north_m, east_m, down_m = (float(x) for x in position_m)
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
    turning_s = np.maximum(_MIDDLES_S - envelope.response_s, 0.0)
    # Who speeds up in a turn turns slower: the rate of the greater speed is within the limits at both.
    rate_radps = envelope.turn_rates_radps(np.maximum(target_mps, own.airspeed_mps))[:, None]
    most_rad = rate_radps * turning_s
    gained_mps = envelope.max_acceleration_mps2 * _MIDDLES_S
    airspeed_mps = own.airspeed_mps + _within(target_mps[:, None] - own.airspeed_mps, -gained_mps, gained_mps)
    turn_rad = wrap_pi(target_rad - own.course_rad)[:, None]
    crab_rad = own.crab_rad
    if own.wind_mps.any():
        turn_rad = turn_rad + crab_rad - _crab_rad(target_rad[:, None], airspeed_mps, own.wind_mps)
    heading_rad = own.course_rad - crab_rad + _within(turn_rad, -most_rad, most_rad)
    through_m = _STEPS_S * airspeed_mps
    path = np.empty((len(target_rad), len(TIMES_S), 2))
    path[:, 0] = own.position_m[:2]
    for axis, direction in enumerate((np.cos(heading_rad), np.sin(heading_rad))):
        carried_m = own.position_m[axis] + own.wind_mps[axis] * TIMES_S[1:]
        path[:, 1:, axis] = carried_m + np.cumsum(through_m * direction, axis=1)
    return path


def _within(values: Array, low: Array, high: Array) -> Array:
    """As `np.clip`, without its overhead, which counts for arrays as small as these."""
    clipped: Array = np.minimum(np.maximum(values, low), high)
    return clipped


def ground_velocity_mps(course_rad: float, airspeed_mps: float, wind_mps: Array) -> Array:
    """Velocity over ground, north and east, of holding a course in the wind, (2,).

    Where the wind is too strong for the course the nose points as far into it as helps, and the aircraft goes
    where it is blown.
    """
    crab_rad = _steady_crab_rad(course_rad, airspeed_mps, wind_mps)
    return _over_ground_mps(course_rad - crab_rad, airspeed_mps, wind_mps)


def _over_ground_mps(heading_rad: float, airspeed_mps: float, wind_mps: Array) -> Array:
    north, east = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([airspeed_mps * north + wind_mps[0], airspeed_mps * east + wind_mps[1]])


def _steady_crab_rad(course_rad: float, airspeed_mps: float, wind_mps: Array) -> float:
    if not wind_mps.any():
        return 0.0
    return float(_crab_rad(np.array(course_rad), np.array(airspeed_mps), wind_mps))


def _crab_rad(course_rad: Array, airspeed_mps: Array, wind_mps: Array) -> Array:
    """How far left of a course the nose must point to hold it: the wind triangle."""
    across_mps = wind_mps[1] * np.cos(course_rad) - wind_mps[0] * np.sin(course_rad)
    crab: Array = np.arcsin(
        _within(across_mps / np.maximum(airspeed_mps, 1e-3), np.array(-1.0), np.array(1.0))
    )
    return crab


def _altitude_m(own: OwnState, target_m: Array, envelope: Envelope) -> Array:
    """Heights, shape (Z, T): the present climb until the command bites, then at the limit, then hold."""
    now_m = -float(own.position_m[2])
    climb_mps = min(max(own.climb_mps, -2.0 * envelope.max_sink_mps), 2.0 * envelope.max_climb_mps)
    before_m = now_m + climb_mps * np.minimum(TIMES_S, envelope.response_s)
    acting_s = np.maximum(TIMES_S - envelope.response_s, 0.0)
    to_go_m = target_m[:, None] - (now_m + climb_mps * envelope.response_s)
    gained_m = _within(to_go_m, -envelope.max_sink_mps * acting_s, envelope.max_climb_mps * acting_s)
    altitude: Array = before_m + gained_m
    return altitude


def separation(
    paths: Paths, tracks: Tracks, *, horizon_s: float = HORIZON_S, shells: bool = False
) -> Separation:
    """How rows keep clear of the tracks flying on, and of the shells around them if asked for.

    Only what happens within `horizon_s` counts.
    """
    count = max(int(np.searchsorted(TIMES_S, horizon_s, side="right")), 2)
    # Single precision needs numbers of moderate size, so all is measured from where we are.
    here = np.array([*paths.ground_m[0, 0], -paths.altitude_m[0, 0]])
    others = (tracks.ground_m()[:, :count] - here[:2]).astype(_Float)
    start_down = (tracks.position_m[:, 2:3] - here[2]).astype(_Float)
    rate_down = tracks.velocity_mps[:, 2:3].astype(_Float)
    times = TIMES_S[:count].astype(_Float)
    ground = (paths.ground_m[:, :count] - here[:2]).astype(_Float)
    height = (paths.altitude_m[:, :count] + here[2]).astype(_Float)
    north = ground[:, None, :, 0] - others[..., 0]
    east = ground[:, None, :, 1] - others[..., 1]
    horizontal = np.sqrt(north * north + east * east)
    horizontal *= (1.0 / tracks.protected_horizontal_m).astype(_Float)[:, None]
    above = height[:, None, :] + (start_down + rate_down * times)
    vertical = vertical_distance_m(above, tracks.grounded[:, None])
    vertical *= (1.0 / tracks.protected_vertical_m).astype(_Float)[:, None]
    ratio = np.maximum(horizontal[paths.ground_of], vertical[paths.height_of])
    closest = ratio.min(axis=2)
    depth = np.maximum(1.0 - ratio[..., 1:], 0.0, dtype=_Float)
    weights = _EXPOSURE_WEIGHTS[: count - 1]
    exposure = (depth @ weights).astype(np.float64)
    if not shells:
        return Separation(closest.astype(np.float64), exposure, np.zeros_like(exposure))
    volumes = (tracks.protected_horizontal_m / np.maximum(tracks.shell_m, 1.0)).astype(_Float)[:, None]
    in_shell = np.clip(1.0 - (ratio[..., 1:] - 1.0) * volumes, 0.0, 1.0, dtype=_Float)
    nearness = (in_shell @ weights).astype(np.float64)
    return Separation(closest.astype(np.float64), exposure, nearness)
