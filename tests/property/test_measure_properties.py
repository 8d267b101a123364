"""The paper's measures of a flight against brute force."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest

from sim.paper.flight import Flight, UavFlight
from sim.paper.measures import closest_distances, contacts, measure, safety_values
from sim.paper.methods import TWO_LAYER
from sim.paper.scene import Scene, Sphere, Uav


def random_flight(seed: int, uavs: int, obstacles: int, samples: int) -> Flight:
    """A flight of random positions; measures apply even if it cannot be flown."""
    chance = np.random.default_rng(seed)
    scene = Scene(
        "chance", 400.0, 1.0, 5.0, 1.5, 5.0, 10.0, 0.1, 0.25,
        tuple(Uav(f"U{i}", (float(i), 0.0), (float(i), 9.0), 0.05) for i in range(uavs)),
        obstacles=tuple(
            Sphere(f"S{m}", (-20.0 - m, 0.0), float(chance.uniform(0.05, 0.6))) for m in range(obstacles)
        ),
    )  # fmt: skip
    flown = []
    for uav in scene.uavs:
        way = np.cumsum(chance.normal(0.0, 0.4, (samples, 2)), axis=0)
        height = chance.normal(0.0, 0.2, samples)
        zeros = np.zeros(samples)
        flown.append(
            UavFlight(uav, way, height, zeros, zeros, zeros, zeros, zeros.astype(np.intp), samples - 1)
        )
    places = np.cumsum(chance.normal(0.0, 0.4, (samples, obstacles, 2)), axis=0)
    return Flight(scene, TWO_LAYER, tuple(flown), places)


def where(flight: Flight, uav: int, sample: int) -> tuple[float, float, float]:
    one = flight.uavs[uav]
    return float(one.position[sample, 0]), float(one.position[sample, 1]), float(one.height[sample])


def stone(flight: Flight, obstacle: int, sample: int) -> tuple[float, float, float]:
    return float(flight.obstacles[sample, obstacle, 0]), float(flight.obstacles[sample, obstacle, 1]), 0.0


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("obstacles", [1, 4])
def test_the_safety_value_of_a_single_uav_is_its_mean_distance_to_the_obstacles(
    seed: int, obstacles: int
) -> None:
    flight = random_flight(seed, 1, obstacles, 15)
    every = [
        sum(math.dist(where(flight, 0, t), stone(flight, m, t)) for m in range(obstacles)) / obstacles
        for t in range(15)
    ]
    assert safety_values(flight) == pytest.approx(every)
    assert measure(flight).safety_value == pytest.approx(sum(every) / len(every))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("uavs", [2, 3, 5])
@pytest.mark.parametrize("obstacles", [0, 2])
def test_the_safety_value_of_several_uavs_is_the_mean_distance_between_them(
    seed: int, uavs: int, obstacles: int
) -> None:
    flight = random_flight(seed, uavs, obstacles, 12)
    for t, value in enumerate(safety_values(flight)):
        apart = [math.dist(where(flight, i, t), where(flight, j, t)) for i in range(uavs) for j in range(i)]
        assert value == pytest.approx(sum(apart) / len(apart))


def spot(flight: Flight, kind: str, number: int, sample: int) -> tuple[float, float, float]:
    return (where if kind == "uav" else stone)(flight, number, sample)


def between(start: Sequence[float], end: Sequence[float], share: float) -> list[float]:
    return [a + share * (b - a) for a, b in zip(start, end, strict=True)]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("uavs", "obstacles"), [(1, 3), (3, 0), (2, 2)])
def test_collisions_are_those_of_definition_4_also_between_samples(
    seed: int, uavs: int, obstacles: int
) -> None:
    flight, samples, fine = random_flight(seed, uavs, obstacles, 10), 10, 100
    pairs = [(("uav", i), ("uav", j)) for i, j in itertools.combinations(range(uavs), 2)]
    pairs += [(("uav", i), ("stone", m)) for i in range(uavs) for m in range(obstacles)]
    closest, limits = [], []
    for one, other in pairs:
        sizes = [0.1 if kind == "uav" else flight.scene.obstacles[n].radius for kind, n in (one, other)]
        limits.append(sum(sizes))
        closest.append(math.inf)
        for t, k in itertools.product(range(samples - 1), range(fine + 1)):
            ends = [
                between(spot(flight, kind, n, t), spot(flight, kind, n, t + 1), k / fine)
                for kind, n in (one, other)
            ]
            closest[-1] = min(closest[-1], math.dist(*ends))
    assert contacts(flight) == pytest.approx(limits)
    # No sampled distance is smaller than the measured one, and the smallest sampled one is nearly as small.
    measured = closest_distances(flight)
    assert (measured <= np.array(closest) + 1e-12).all()
    assert measured == pytest.approx(closest, abs=0.02)
    if all(abs(c - limit) > 0.02 for c, limit in zip(closest, limits, strict=True)):
        assert measure(flight).collisions == sum(c <= limit for c, limit in zip(closest, limits, strict=True))
