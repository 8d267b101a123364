"""Random fields of obstacles, and a search for a collision-free path through them."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from companion.errors import ConfigError
from sim.paper.scene import RandomFields, Scene, Sphere

# Cell size and margin around start and goal of the path search, in lengths.
_CELL = 0.1
_AROUND = 3.0

_Draw = Callable[[str, Scene, RandomFields, np.random.Generator], Sphere]


def random_field(scene: Scene, seed: int) -> Scene:
    """The scene with random obstacles around the straight path of its UAV.

    Standing obstacles lie along the path, up to 3 lengths beside it. Moving obstacles come from any direction
    to a point within one length of the UAV's undisturbed position at that time. `ConfigError` if the file has
    no section `random`.
    """
    drawn = scene.random
    if drawn is None:
        raise ConfigError(f"{scene.description}: has no section `random`")
    chance = np.random.default_rng(seed)
    kinds = [*_kinds(_standing, "S", drawn.standing, chance), *_kinds(_moving, "M", drawn.moving, chance)]
    spheres = tuple(_clear(draw, name, scene, drawn, chance) for draw, name in kinds)
    return replace(scene, obstacles=spheres, random=None, description=f"random field {seed}")


def _kinds(
    draw: _Draw, letter: str, numbers: tuple[int, int], chance: np.random.Generator
) -> list[tuple[_Draw, str]]:
    number = int(chance.integers(numbers[0], numbers[1], endpoint=True))
    return [(draw, f"{letter}{i + 1}") for i in range(number)]


def _clear(draw: _Draw, name: str, scene: Scene, drawn: RandomFields, chance: np.random.Generator) -> Sphere:
    """An obstacle that leaves start and goal clear at the first step, by repeated drawing."""
    uav = scene.uavs[0]
    for _ in range(1000):
        sphere = draw(name, scene, drawn, chance)
        clear = sphere.radius + drawn.clearance
        if math.dist(sphere.at, uav.start) > clear and math.dist(sphere.at, uav.goal) > clear:
            return sphere
    raise ConfigError(f"{scene.description}: random.clearance leaves no room for obstacles")


def _standing(name: str, scene: Scene, drawn: RandomFields, chance: np.random.Generator) -> Sphere:
    place = _beside_path(scene, float(chance.uniform(0.05, 1.0)), float(chance.uniform(-3.0, 3.0)))
    return Sphere(name, place, float(chance.uniform(*drawn.radius)))


def _moving(name: str, scene: Scene, drawn: RandomFields, chance: np.random.Generator) -> Sphere:
    uav = scene.uavs[0]
    share = float(chance.uniform(0.15, 0.95))
    meeting = _beside_path(scene, share, float(chance.uniform(-1.0, 1.0)))
    steps = share * math.dist(uav.start, uav.goal) / uav.step
    course, speed = float(chance.uniform(-math.pi, math.pi)), float(chance.uniform(*drawn.speed))
    velocity = (speed * math.cos(course), speed * math.sin(course))
    at = (meeting[0] - velocity[0] * steps, meeting[1] - velocity[1] * steps)
    return Sphere(name, at, float(chance.uniform(*drawn.radius)), velocity)


def _beside_path(scene: Scene, share: float, left: float) -> tuple[float, float]:
    start, goal = np.array(scene.uavs[0].start), np.array(scene.uavs[0].goal)
    ahead = (goal - start) / np.hypot(*(goal - start))
    x, y = start + share * (goal - start) + left * np.array([-ahead[1], ahead[0]])
    return float(x), float(y)


def path_exists(scene: Scene, steps: int) -> bool:
    """True if a path within the maximum speed leads the first UAV to its goal without collision.

    The set of reachable cells grows from the start, step by step, over the cells free of obstacles at that
    step. Turning on the spot is allowed, so an aircraft may be unable to fly the path; gaps narrower than a
    cell count as closed.
    """
    uav = scene.uavs[0]
    corners = np.array([uav.start, uav.goal])
    low, high = corners.min(axis=0) - _AROUND, corners.max(axis=0) + _AROUND
    x, y = (np.arange(low[i], high[i], _CELL) for i in (0, 1))
    reached = np.hypot(*np.meshgrid(x - uav.start[0], y - uav.start[1], indexing="ij")) < _CELL
    at_goal = np.hypot(*np.meshgrid(x - uav.goal[0], y - uav.goal[1], indexing="ij")) < scene.arrival_radius
    look_steps = max(int(_CELL / (uav.step * scene.fastest)), 1)
    for step in range(0, steps, look_steps):
        reached = _grown(reached) & ~_covered(scene, step, x, y)
        if (reached & at_goal).any():
            return True
    return False


def _covered(scene: Scene, step: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    covered = np.zeros((len(x), len(y)), dtype=bool)
    for sphere in scene.obstacles:
        cx, cy = sphere.centre(step)
        radius = sphere.radius + scene.uav_radius
        i = slice(*np.searchsorted(x, (cx - radius, cx + radius)).tolist())
        j = slice(*np.searchsorted(y, (cy - radius, cy + radius)).tolist())
        covered[i, j] |= (x[i, None] - cx) ** 2 + (y[None, j] - cy) ** 2 <= radius**2
    return covered


def _grown(reached: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The cells and their four neighbours."""
    wider = reached.copy()
    wider[1:] |= reached[:-1]
    wider[:-1] |= reached[1:]
    wider[:, 1:] |= reached[:, :-1]
    wider[:, :-1] |= reached[:, 1:]
    return wider
