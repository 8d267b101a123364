"""Measures of a flight: safety value (eq. 3), collisions (def. 4), effort, length, jitter."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.paper.flight import Flight, UavFlight

Array = NDArray[np.float64]

# Turns below this per step are ignored: they are residuals of the roll lag.
_TURN_RAD = np.radians(0.2)


@dataclass(frozen=True, slots=True)
class Measures:
    """The measures of one flight. Lengths are the paper's.

    `safety_value` is eq. 3 averaged over the flight: the mean distance to all obstacles, or between all pairs
    of UAVs. `common_safety_value` averages only the steps in which all compared flights are under way, so
    that a flight does not gain from a long detour at the end. `min_separation` is the smallest of these
    distances, between centres; `min_clearance` between surfaces. `heading_effort` is the mean square of the
    commanded change of course (eq. 10) [rad^2], `speed_effort` that of the change of speed (eq. 12) [length^2
    per step^2]. `path_ratio` is flown length over straight length; `jitter` counts changes of the turn's
    side.
    """

    safety_value: float | None
    heading_effort: float
    speed_effort: float
    min_separation: float | None
    min_clearance: float | None
    collisions: int
    arrived: bool
    steps: int
    path_ratio: float
    jitter: int
    common_safety_value: float | None = None

    def report(self) -> dict[str, float | int | bool | None]:
        """The measures for JSON, rounded to six digits."""
        return {
            name: round(value, 6) if isinstance(value, float) else value
            for name in self.__slots__
            for value in (getattr(self, name),)
        }


def measure(flight: Flight, common_steps: int | None = None) -> Measures:
    """All measures of a flight; `common_steps`: steps in which all compared flights are under way."""
    contact, closest = contacts(flight), closest_distances(flight)
    straight = sum(math.dist(one.uav.start, one.uav.goal) for one in flight.uavs)
    straight -= len(flight.uavs) * flight.scene.arrival_radius
    safety = safety_values(flight)
    return Measures(
        safety_value=float(safety.mean()) if safety.size else None,
        heading_effort=_mean_square([one.turn_command[: one.steps] for one in flight.uavs]),
        speed_effort=_mean_square([one.speed_command[: one.steps] for one in flight.uavs]),
        min_separation=float(closest.min()) if closest.size else None,
        min_clearance=float((closest - contact).min()) if closest.size else None,
        collisions=int((closest <= contact).sum()),
        arrived=flight.arrived,
        steps=flight.steps,
        path_ratio=sum(path_length(one) for one in flight.uavs) / straight,
        jitter=sum(jitter(one) for one in flight.uavs),
        common_safety_value=(
            float(safety[: common_steps + 1].mean()) if safety.size and common_steps is not None else None
        ),
    )


def distances(flight: Flight) -> Array:
    """Distances between centres at every step: pairs of UAVs, then each UAV to all obstacles, (T, P)."""
    offsets = _offsets(flight)
    lengths: Array = np.sqrt(np.einsum("tpi,tpi->tp", offsets, offsets))
    return lengths


def safety_values(flight: Flight) -> Array:
    """Eq. 3 at every step, (T,): mean distance to the obstacles, or between several UAVs.

    Empty without obstacles and other UAVs.
    """
    columns = distances(flight)
    count = len(flight.uavs)
    if count > 1:
        columns = columns[:, : count * (count - 1) // 2]
    return columns.mean(axis=1) if columns.shape[1] else np.empty(0)


def contacts(flight: Flight) -> Array:
    """The collision distances (def. 4) for the columns of `distances`, (P,)."""
    own, count = flight.scene.uav_radius, len(flight.uavs)
    pairs = [2.0 * own] * (count * (count - 1) // 2)
    spheres = [own + sphere.radius for sphere in flight.scene.obstacles]
    return np.array(pairs + spheres * count)


def closest_distances(flight: Flight) -> Array:
    """Smallest distances, (P,), also between the samples, with straight motion between them."""
    offsets = _offsets(flight)
    start, along = offsets[:-1], np.diff(offsets, axis=0)
    length2 = np.einsum("tpi,tpi->tp", along, along)
    share = -np.einsum("tpi,tpi->tp", start, along) / np.where(length2 > 0.0, length2, 1.0)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * along
    smallest: Array = np.sqrt(np.einsum("tpi,tpi->tp", nearest, nearest)).min(axis=0)
    return smallest


def path_length(flown: UavFlight) -> float:
    """Flown length over ground."""
    way = np.diff(flown.position[: flown.steps + 1], axis=0)
    return float(np.hypot(way[:, 0], way[:, 1]).sum())


def jitter(flown: UavFlight) -> int:
    """Number of changes of the turn from one side to the other."""
    turns = np.diff(np.unwrap(flown.course[: flown.steps + 1]))
    sides = np.sign(turns[np.abs(turns) > _TURN_RAD])
    return int((np.diff(sides) != 0.0).sum())


def _offsets(flight: Flight) -> Array:
    """Vectors (T, P, 3) between pairs of UAVs, then from each UAV to all obstacles."""
    # Obstacles are at height zero, and so are UAVs that do not use height.
    places = [np.column_stack([one.position, one.height]) for one in flight.uavs]
    obstacles = np.concatenate([flight.obstacles, np.zeros((*flight.obstacles.shape[:2], 1))], axis=2)
    columns = [other - one for one, other in itertools.combinations(places, 2)]
    columns += [obstacles[:, m] - place for place in places for m in range(obstacles.shape[1])]
    return np.stack(columns, axis=1) if columns else np.empty((len(obstacles), 0, 3))


def _mean_square(values: list[Array]) -> float:
    joined = np.concatenate(values)
    return float(np.mean(joined**2)) if len(joined) else 0.0
