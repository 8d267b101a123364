"""The figures are not blank and fit a page, for ordinary and for unusual flights."""

import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from sim.paper import methods, plots
from sim.paper.flight import Flight, UavFlight, fly
from sim.paper.scene import Scene, Sphere, Uav, load_scene
from sim.paper.studies import TransitionPoint

_PNG = b"\x89PNG\r\n\x1a\n"
_ENDS = [(0.0, 0.0), (0.0, 1.0), (0.0, 2.0), (10.0, 10.0), (10.0, 9.0), (10.0, 8.0)]


def assert_drawn(path: Path) -> None:
    """A PNG between half a column and two pages, with ink on 1 to 90 % of it."""
    head = path.read_bytes()[:24]
    assert head.startswith(_PNG)
    width, height = struct.unpack(">II", head[16:24])
    assert 400 <= width <= 3000
    assert 200 <= height <= 3500
    pixels = imread(path)[..., :3]
    assert 0.01 < (pixels.min(axis=2) < 0.97).mean() < 0.9


def scene(*obstacles: Sphere, uavs: int = 1) -> Scene:
    flown = tuple(Uav(f"U{i}", (0.0, float(i)), (10.0, 10.0 - i), 0.05) for i in range(uavs))
    return replace(load_scene("single"), uavs=flown, obstacles=obstacles)


def flown(of: Scene, steps: int, *, arrives: bool = True) -> Flight:
    """A synthetic flight straight to the goals, with every layer for a while."""
    ramp = np.linspace(0.0, 1.0, steps + 1)
    one = [
        UavFlight(
            uav,
            np.outer(1.0 - ramp, uav.start) + np.outer(ramp, uav.goal),
            np.zeros(steps + 1),
            np.sin(6.0 * ramp),
            np.full(steps + 1, uav.step),
            np.cos(6.0 * ramp),
            0.01 * ramp,
            (np.arange(steps + 1) // 10 % 3).astype(np.intp),
            steps if arrives else None,
        )
        for uav in of.uavs
    ]
    centres = [[sphere.centre(step) for sphere in of.obstacles] for step in range(steps + 1)]
    places = np.array(centres).reshape(steps + 1, len(of.obstacles), 2)
    return Flight(of, methods.TWO_LAYER, tuple(one), places)


def many(count: int) -> tuple[Sphere, ...]:
    chance = np.random.default_rng(1)
    places = chance.uniform(-2.0, 12.0, (count, 2)).tolist()
    velocities = chance.uniform(-0.02, 0.02, (count, 2)).tolist()
    spheres = [
        Sphere(f"B{i}", (x, y), 0.1 + 0.2 * (i % 2), (vx, vy) if i % 3 else (0.0, 0.0))
        for i, ((x, y), (vx, vy)) in enumerate(zip(places, velocities, strict=True))
    ]
    return tuple(one for one in spheres if min(math.dist(one.at, end) for end in _ENDS) > 1.0)


UNUSUAL = {
    "no obstacles": flown(scene(), 100),
    "one step": flown(scene(Sphere("S", (5.0, 5.0), 0.5), Sphere("M", (3.0, 3.0), 0.3, (0.1, 0.0))), 1),
    "never arrived": flown(scene(Sphere("M", (900.0, 900.0), 0.5, (0.1, 0.0))), 850, arrives=False),
    "two thousand obstacles": flown(scene(*many(2000)), 100),
    "group among obstacles": flown(scene(*many(3), uavs=3), 200),
    "large group": flown(scene(uavs=12), 60),
}


@pytest.mark.parametrize("name", [name for name in UNUSUAL if name != "large group"])
def test_odd_flights_are_drawn_from_above(name: str, tmp_path: Path) -> None:
    plots.trajectory(UNUSUAL[name], tmp_path / "map.png")
    assert_drawn(tmp_path / "map.png")


def test_periods_are_drawn(tmp_path: Path) -> None:
    plots.trajectories_in_time(UNUSUAL["one step"], tmp_path / "periods.png")
    assert_drawn(tmp_path / "periods.png")


@pytest.mark.parametrize("name", ["one step", "large group"])
def test_commands_are_drawn(name: str, tmp_path: Path) -> None:
    plots.commands_over_time(UNUSUAL[name], tmp_path / "commands.png")
    assert_drawn(tmp_path / "commands.png")


@pytest.mark.parametrize("name", ["no obstacles", "group among obstacles"])
def test_safety_is_drawn(name: str, tmp_path: Path) -> None:
    plots.safety_over_time([UNUSUAL[name], UNUSUAL[name]], tmp_path / "safety.png")
    assert_drawn(tmp_path / "safety.png")


def test_a_flight_of_the_paper_is_drawn(tmp_path: Path) -> None:
    plots.trajectory(fly(load_scene("single"), methods.NONE), tmp_path / "map.png")
    assert_drawn(tmp_path / "map.png")


def test_minima_are_drawn_with_rows_of_different_lengths(tmp_path: Path) -> None:
    trapped = UNUSUAL["never arrived"]
    plots.minima({"in-line": [trapped, UNUSUAL["no obstacles"]], "gap": [trapped]}, tmp_path / "minima.png")
    assert_drawn(tmp_path / "minima.png")


def test_the_transition_domain_is_drawn_in_any_order_and_of_a_single_width(tmp_path: Path) -> None:
    points = [
        TransitionPoint(method, width, (4.0, 3.9, 4.2), (1.0, 1.0, 1.0), (0.5, 0.4, 0.6), (1.1, 1.0, 1.2))
        for method, widths_deg in (("outer layer only", (180.0, 0.0, 90.0)), ("two layers", (90.0,)))
        for width in widths_deg
    ]
    plots.transition(points, 90.0, tmp_path / "transition.png")
    assert_drawn(tmp_path / "transition.png")


def test_shares_are_drawn_at_both_ends(tmp_path: Path) -> None:
    rows = [("no avoidance", 0.0, 0.0, 0.01), ("two layers, inner sphere not cleared", 1.0, 0.99, 1.0)]
    plots.shares(rows, tmp_path / "shares.png")
    assert_drawn(tmp_path / "shares.png")
