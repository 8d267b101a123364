"""Scenes of the paper's experiments: UAVs, obstacles and scale.

Scenes use the paper's conventions: x to the right, y up, lengths without unit, speeds in lengths per step.
`Scale` converts them to metres and seconds, north-east-down, for the avoidance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt, Le, Len
from pydantic import dataclasses as checked

from companion.errors import ConfigError
from companion.model import Vec2, Vec3
from sim.files import STRICT, read_checked

SCENE_FOLDER = Path(__file__).with_name("scenes")

Length = Annotated[float, Ge(-1e4), Le(1e4)]
Positive = Annotated[float, Gt(0.0), Le(1e4)]
Point = tuple[Length, Length]


@checked.dataclass(frozen=True, config=STRICT)
class Uav:
    """A UAV; `step` is its speed in lengths per step."""

    id: Annotated[str, Len(1, 16)]
    start: Point
    goal: Point
    step: Positive


@checked.dataclass(frozen=True, config=STRICT)
class Sphere:
    """An obstacle (def. 2): centre at the first step, radius R_b, and velocity."""

    id: Annotated[str, Len(1, 16)]
    at: Point
    radius: Positive
    velocity: Point = (0.0, 0.0)

    def centre(self, step: int) -> Vec2:
        """The centre after some steps."""
        return self.at[0] + self.velocity[0] * step, self.at[1] + self.velocity[1] * step


@checked.dataclass(frozen=True, config=STRICT)
class RandomFields:
    """The distribution of random obstacles; ranges are (from, to)."""

    fields: Annotated[int, Ge(1), Le(100_000)]
    seed: Annotated[int, Ge(0)]
    study_seed: Annotated[int, Ge(0)]
    standing: tuple[Annotated[int, Ge(0)], Annotated[int, Le(1000)]]
    moving: tuple[Annotated[int, Ge(0)], Annotated[int, Le(1000)]]
    radius: tuple[Positive, Positive]
    speed: tuple[Positive, Positive]
    clearance: Positive

    def __post_init__(self) -> None:
        """Refuse reversed ranges."""
        for name in ("standing", "moving", "radius", "speed"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name}: from {low} to {high} is not a range")


@checked.dataclass(frozen=True, config=STRICT)
class Scene:
    """The content of a scene file."""

    description: str
    unit_m: Annotated[float, Gt(0.0), Le(1e5)]
    step_s: Annotated[float, Gt(0.0), Le(10.0)]
    outer_radius: Positive
    inner_radius: Positive
    attraction_gain: Positive
    repulsion_gain: Positive
    uav_radius: Positive
    arrival_radius: Positive
    uavs: Annotated[tuple[Uav, ...], Len(1, 50)]
    # V_min and V_max of §3.2.2, as shares of `step`.
    slowest: Annotated[float, Gt(0.0), Le(1.0)] = 0.8
    fastest: Annotated[float, Ge(1.0), Le(5.0)] = 1.4
    obstacles: Annotated[tuple[Sphere, ...], Len(0, 20_000)] = ()
    random: RandomFields | None = None

    def __post_init__(self) -> None:
        """Refuse duplicate ids, and starts or goals inside obstacles."""
        ids = [uav.id for uav in self.uavs] + [obstacle.id for obstacle in self.obstacles]
        if len(set(ids)) < len(ids):
            twice = next(one for one in ids if ids.count(one) > 1)
            raise ValueError(f"the id {twice} is used twice")
        if self.inner_radius > self.outer_radius:
            raise ValueError("inner_radius must not exceed outer_radius")
        for uav in self.uavs:
            self._check(uav)
        for i, uav in enumerate(self.uavs):
            for other in self.uavs[:i]:
                if math.dist(uav.start, other.start) <= 2.0 * self.uav_radius:
                    raise ValueError(f"{uav.id} starts where {other.id} starts")

    def _check(self, uav: Uav) -> None:
        if math.dist(uav.start, uav.goal) <= self.arrival_radius:
            raise ValueError(f"{uav.id} starts at its goal")
        for obstacle in self.obstacles:
            contact = obstacle.radius + self.uav_radius
            if math.dist(uav.start, obstacle.at) <= contact:
                raise ValueError(f"{uav.id} starts inside the obstacle {obstacle.id}")
            standing = obstacle.velocity == (0.0, 0.0)
            if standing and math.dist(uav.goal, obstacle.at) <= contact:
                raise ValueError(f"the goal of {uav.id} is inside the obstacle {obstacle.id}")

    @property
    def scale(self) -> "Scale":
        """The conversion to metres and seconds."""
        return Scale(self.unit_m, self.step_s)

    @property
    def straight_steps(self) -> int:
        """Number of steps of the longest straight path."""
        return max(math.ceil(math.dist(uav.start, uav.goal) / uav.step) for uav in self.uavs)


@dataclass(frozen=True, slots=True)
class Scale:
    """Conversion from the paper's lengths and steps to metres and seconds; y is north and x is east."""

    unit_m: float
    step_s: float

    def place_m(self, point: Vec2) -> Vec3:
        """A point as north, east, down [m], at height zero (§2.1: flight at one altitude)."""
        return point[1] * self.unit_m, point[0] * self.unit_m, 0.0

    def point(self, place_m: Sequence[float]) -> Vec2:
        """x and y of a position north-east(-down) [m]."""
        return place_m[1] / self.unit_m, place_m[0] / self.unit_m

    def speed_mps(self, per_step: float) -> float:
        """A speed in lengths per step as m/s."""
        return per_step * self.unit_m / self.step_s

    def velocity_mps(self, per_step: Vec2) -> Vec3:
        """A velocity in lengths per step as north, east, down [m/s]."""
        return self.speed_mps(per_step[1]), self.speed_mps(per_step[0]), 0.0


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a scene by its name in `sim/paper/scenes` or from a file; `ConfigError` names file and key."""
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = SCENE_FOLDER / f"{name_or_path}.yaml"
        if not path.is_file():
            raise ConfigError(f"{name_or_path}: no such scene in {SCENE_FOLDER}")
    return read_checked(path, Scene)


def minima_scenes() -> dict[str, Scene]:
    """The scenes of local minima, by name."""
    return {path.stem: load_scene(path) for path in sorted((SCENE_FOLDER / "minima").glob("*.yaml"))}
