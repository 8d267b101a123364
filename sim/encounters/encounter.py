"""The path of an intruder, and the encounter of an aircraft on its mission with some intruders."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.model import Vec3

Array = NDArray[np.floating]

State = tuple[Vec3, Vec3]
"""Position [m] and velocity [m/s], north-east-down."""

DURATION_S = 120.0
_AHEAD_RAD, _BEHIND_RAD = math.radians(30.0), math.radians(110.0)
_HOVERING_MPS = 2.0


@dataclass(frozen=True, slots=True)
class Path:
    """Samples of an intruder's motion: `time_s` (n,) rising, north-east-down (n, 3) [m] and [m/s]."""

    time_s: Array
    position_m: Array
    velocity_mps: Array

    def positions_m(self, times_s: Array) -> Array:
        """Positions at many times, (m, 3): cubic between the samples, straight outside them."""
        inside = np.clip(times_s, self.time_s[0], self.time_s[-1])
        place = np.clip(np.searchsorted(self.time_s, inside, side="right") - 1, 0, len(self.time_s) - 2)
        step_s = (self.time_s[place + 1] - self.time_s[place])[:, None]
        share = (inside - self.time_s[place])[:, None] / step_s
        left, right = self.position_m[place], self.position_m[place + 1]
        pull_left, pull_right = self.velocity_mps[place] * step_s, self.velocity_mps[place + 1] * step_s
        square, cube = share**2, share**3
        position = (
            (2.0 * cube - 3.0 * square + 1.0) * left
            + (cube - 2.0 * square + share) * pull_left
            + (3.0 * square - 2.0 * cube) * right
            + (cube - square) * pull_right
        )
        beyond = (times_s - inside)[:, None]
        edge = np.where(beyond > 0.0, self.velocity_mps[-1], self.velocity_mps[0])
        result: Array = position + beyond * edge
        return result

    def state_at(self, time_s: float) -> State:
        """Position and velocity at a time."""
        return self.states_at(np.array([time_s]))[0]

    def states_at(self, times_s: Array) -> list[State]:
        """Position and velocity at each of many times (m,)."""
        axes = [np.interp(times_s, self.time_s, self.velocity_mps[:, axis]) for axis in range(3)]
        numbers = np.column_stack([self.positions_m(times_s), *axes]).tolist()
        return [((n, e, d), (n_mps, e_mps, d_mps)) for n, e, d, n_mps, e_mps, d_mps in numbers]

    def moved(self, by_m: Sequence[float] | Array) -> "Path":
        """The path shifted by a vector (3,) [m]."""
        return Path(self.time_s, self.position_m + np.asarray(by_m), self.velocity_mps)


@dataclass(frozen=True, slots=True)
class Encounter:
    """An aircraft on a straight level mission line, and its intruders.

    Positions are north-east-down [m] in one flat frame. `weight` is the encounter's real frequency relative
    to the frequency of its sampling. `nominal_horizontal_m` and `nominal_vertical_m` are the first
    intruder's distances at closest approach without avoidance. `source` is the model of the first intruder,
    or the kind of a generated encounter.
    """

    encounter_id: str
    own_position_m: Vec3
    own_course_rad: float
    own_airspeed_mps: float
    intruders: tuple[Path, ...]
    duration_s: float = DURATION_S
    weight: float = 1.0
    geometry: str = ""
    closing_mps: float = 0.0
    nominal_horizontal_m: float = 0.0
    nominal_vertical_m: float = 0.0
    source: str = ""

    @property
    def own_velocity_mps(self) -> Vec3:
        """Velocity over ground on the mission line, north-east-down [m/s]."""
        north, east = math.cos(self.own_course_rad), math.sin(self.own_course_rad)
        return self.own_airspeed_mps * north, self.own_airspeed_mps * east, 0.0


@dataclass(frozen=True, slots=True)
class Passing:
    """The closest approach of an intruder to an aircraft in straight flight."""

    geometry: str
    closing_mps: float
    horizontal_m: float
    vertical_m: float
    time_s: float


def passing(own_position_m: Vec3, own_velocity_mps: Vec3, path: Path, duration_s: float) -> Passing:
    """The closest approach, to 0.1 s, and the geometry by the courses at that time."""
    times_s = np.arange(round(duration_s * 10.0) + 1) * 0.1
    own_m = np.array(own_position_m) + times_s[:, None] * np.array(own_velocity_mps)
    off_m = path.positions_m(times_s) - own_m
    across_m = np.hypot(off_m[:, 0], off_m[:, 1])
    nearest = int(np.argmin(across_m))
    time_s = float(times_s[nearest])
    _, theirs = path.state_at(time_s)
    relative_mps = math.hypot(theirs[0] - own_velocity_mps[0], theirs[1] - own_velocity_mps[1])
    geometry = geometry_of(own_velocity_mps, theirs)
    return Passing(geometry, relative_mps, float(across_m[nearest]), float(abs(off_m[nearest, 2])), time_s)


def geometry_of(own_mps: Vec3, other_mps: Vec3) -> str:
    """The geometry in words, by the directions of flight: head-on, crossing, overtaking, hovering."""
    if math.hypot(other_mps[0], other_mps[1]) < _HOVERING_MPS:
        return "hovering"
    # The direction it comes from: opposite to its course, relative to ours.
    from_rad = math.remainder(
        math.atan2(other_mps[1], other_mps[0]) + math.pi - math.atan2(own_mps[1], own_mps[0]), math.tau
    )
    if abs(from_rad) < _AHEAD_RAD:
        return "head-on"
    if abs(from_rad) > _BEHIND_RAD:
        faster = math.hypot(*other_mps[:2]) > math.hypot(*own_mps[:2])
        return "overtaken" if faster else "overtaking"
    return "crossing from the right" if from_rad > 0.0 else "crossing from the left"
