"""The paper's scenes: refused files, extreme scenes that must fly, and random fields."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from companion.errors import ConfigError
from sim.files import checked_from
from sim.paper.fields import path_exists, random_field
from sim.paper.flight import Flight, fly
from sim.paper.measures import Measures, measure
from sim.paper.methods import INNER, OUTER, TWO_LAYER
from sim.paper.scene import SCENE_FOLDER, Scene, Sphere, load_scene

UAV = {"id": "U1", "start": [0.0, 0.0], "goal": [3.0, 3.0], "step": 0.05}
OTHER = {"id": "U2", "start": [1.0, 0.0], "goal": [0.0, 3.0], "step": 0.05}
STONE = {"id": "S1", "at": [1.5, 1.5], "radius": 0.3}
SMALL: dict[str, Any] = {
    "description": "small",
    "unit_m": 400.0,
    "step_s": 1.0,
    "outer_radius": 5.0,
    "inner_radius": 1.5,
    "attraction_gain": 5.0,
    "repulsion_gain": 10.0,
    "uav_radius": 0.1,
    "arrival_radius": 0.25,
    "uavs": [UAV],
    "obstacles": [STONE],
}


def scene(**changes: Any) -> Scene:
    return checked_from(SMALL | changes, Scene, "small.yaml")


def stones(*places: tuple[float, float], radius: float = 0.3) -> tuple[Sphere, ...]:
    return tuple(Sphere(f"S{i}", place, radius) for i, place in enumerate(places))


def has_no_nan(flight: Flight) -> bool:
    arrays = [
        array
        for one in flight.uavs
        for array in (one.position, one.course, one.speed, one.height, one.turn_command, one.speed_command)
    ]
    return all(bool(np.isfinite(array).all()) for array in [*arrays, flight.obstacles])


def reports_no_nan(measures: Measures) -> bool:
    return all(value is None or math.isfinite(value) for value in measures.report().values())


MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    "start in an obstacle": ({"obstacles": [STONE | {"at": [0.2, 0.2]}]}, "U1 starts inside the obstacle S1"),
    "start touching an obstacle": ({"obstacles": [STONE | {"at": [0.4, 0.0]}]}, "U1 starts inside"),
    "goal in an obstacle": (
        {"obstacles": [STONE | {"at": [3.1, 3.0]}]},
        "goal of U1 is inside the obstacle S1",
    ),
    "start at the goal": ({"uavs": [UAV | {"goal": [0.1, 0.1]}]}, "U1 starts at its goal"),
    "two at one start": ({"uavs": [UAV, OTHER | {"start": [0.1, 0.1]}]}, "U2 starts where U1 starts"),
    "no speed": ({"uavs": [UAV | {"step": 0.0}]}, "uavs.0.step"),
    "speed backwards": ({"uavs": [UAV | {"step": -0.05}]}, "uavs.0.step"),
    "one id for two UAVs": ({"uavs": [UAV, OTHER | {"id": "U1"}]}, "the id U1 is used twice"),
    "one id for two obstacles": (
        {"obstacles": [STONE, STONE | {"at": [2.5, 0.0]}]},
        "the id S1 is used twice",
    ),
    "one id for UAV and obstacle": ({"obstacles": [STONE | {"id": "U1"}]}, "the id U1 is used twice"),
    "unknown key": ({"colour": "red"}, "colour: unknown key"),
    "unknown key within": ({"obstacles": [STONE | {"colour": "red"}]}, "obstacles.0.colour: unknown key"),
    "NaN": ({"obstacles": [STONE | {"radius": math.nan}]}, "obstacles.0.radius"),
    "infinity": ({"uavs": [UAV | {"goal": [math.inf, 0.0]}]}, "uavs.0.goal.0"),
    "three coordinates": ({"uavs": [UAV | {"goal": [1.0, 2.0, 3.0]}]}, "uavs.0.goal"),
    "inner larger than outer": ({"inner_radius": 6.0}, "inner_radius must not exceed outer_radius"),
    "no radius": ({"obstacles": [STONE | {"radius": 0.0}]}, "obstacles.0.radius"),
    "no UAV": ({"uavs": []}, "uavs"),
    "no step": ({"step_s": 0.0}, "step_s"),
    "words for numbers": ({"unit_m": "far"}, "unit_m"),
    "empty id": ({"uavs": [UAV | {"id": ""}]}, "uavs.0.id"),
}


@pytest.mark.parametrize(("changes", "why"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_one_line_that_names_file_and_key(
    tmp_path: Path, changes: dict[str, Any], why: str
) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(yaml.safe_dump(SMALL | changes), encoding="utf-8")
    with pytest.raises(ConfigError) as error:
        load_scene(path)
    line = str(error.value)
    assert line.startswith(f"{path}: ")
    assert why in line
    assert "\n" not in line


@pytest.mark.parametrize("key", [key for key in SMALL if key != "obstacles"])
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    path = tmp_path / "missing.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in SMALL.items() if k != key}), encoding="utf-8")
    with pytest.raises(ConfigError, match=f"missing.yaml: {key}: ") as error:
        load_scene(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "content",
    [
        b"uavs: [\n",
        b"a: b: c\n",
        b"\xff\xfe\x00",
        b"",
        b"- 1\n- 2\n",
        b"just words",
        b"\t- x: {",
        b"!!python/x y",
    ],
)
def test_a_damaged_file_is_one_line_that_names_it(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "damaged.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as error:
        load_scene(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_a_missing_scene_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nowhere: no such scene"):
        load_scene("nowhere")
    with pytest.raises(ConfigError, match="No such file"):
        load_scene(tmp_path / "nowhere.yaml")


def test_a_moving_obstacle_may_start_at_the_goal() -> None:
    """The goal is free when the UAV arrives."""
    moving = STONE | {"at": [3.0, 3.0], "velocity": [0.05, 0.0]}
    assert scene(obstacles=[moving]).obstacles[0].centre(10) == pytest.approx((3.5, 3.0))


@pytest.mark.parametrize("path", sorted(SCENE_FOLDER.rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_published_scene_loads(path: Path) -> None:
    assert load_scene(path).uavs


@pytest.mark.parametrize("method", [TWO_LAYER, INNER, OUTER], ids=lambda method: method.name)
def test_without_obstacles_it_flies_straight_and_arrives(method: Any) -> None:
    flight = fly(scene(obstacles=[]), method)
    measures = measure(flight)
    assert measures.arrived
    assert measures.safety_value is None
    assert measures.min_separation is None
    assert measures.min_clearance is None
    assert measures.collisions == 0
    assert measures.heading_effort == pytest.approx(0.0, abs=1e-12)
    across = flight.uavs[0].position @ np.array([1.0, -1.0])
    assert np.abs(across).max() < 1e-6
    assert reports_no_nan(measures)


# A goal a few steps ahead: the test is the cost of one step with very many obstacles.
NEAR_GOAL = UAV | {"goal": [0.42, 0.42], "step": 0.15}


def test_ten_thousand_distant_obstacles_have_no_effect() -> None:
    far = stones(*((50.0 + i % 100, 50.0 + i // 100) for i in range(10_000)))
    flight = fly(replace(scene(uavs=[NEAR_GOAL], obstacles=[]), obstacles=far), TWO_LAYER)
    assert flight.arrived
    assert has_no_nan(flight)
    assert (flight.uavs[0].layer == 0).all(), "no obstacle within the outer layer"
    assert reports_no_nan(measure(flight))


@pytest.mark.parametrize("method", [TWO_LAYER, OUTER], ids=lambda method: method.name)
def test_ten_thousand_near_obstacles_can_be_flown(method: Any) -> None:
    """A ring around the UAV, all within the outer layer."""
    near = stones(
        *(
            ((1.5 + 0.03 * (i // 250)) * math.cos(0.025 * i), (1.5 + 0.03 * (i // 250)) * math.sin(0.025 * i))
            for i in range(10_000)
        ),
        radius=0.01,
    )
    flight = fly(replace(scene(uavs=[NEAR_GOAL], obstacles=[]), obstacles=near), method)
    assert flight.steps >= 2
    assert has_no_nan(flight)
    assert flight.uavs[0].layer.max() > 0
    assert reports_no_nan(measure(flight))


FIELDS = load_scene("fields")


def test_a_seed_draws_the_same_field_every_time() -> None:
    assert random_field(FIELDS, 7) == random_field(FIELDS, 7)
    assert random_field(FIELDS, 7) != random_field(FIELDS, 8)


@pytest.mark.parametrize("seed", range(40))
def test_a_random_field_is_within_the_ranges_of_the_file(seed: int) -> None:
    drawn, field = FIELDS.random, random_field(FIELDS, seed)
    assert drawn is not None
    uav = field.uavs[0]
    moving = [sphere for sphere in field.obstacles if sphere.velocity != (0.0, 0.0)]
    assert drawn.moving[0] <= len(moving) <= drawn.moving[1]
    assert drawn.standing[0] <= len(field.obstacles) - len(moving) <= drawn.standing[1]
    for sphere in field.obstacles:
        assert drawn.radius[0] <= sphere.radius <= drawn.radius[1]
        assert math.dist(sphere.at, uav.start) > sphere.radius + drawn.clearance
        assert math.dist(sphere.at, uav.goal) > sphere.radius + drawn.clearance
    for sphere in moving:
        assert drawn.speed[0] <= math.hypot(*sphere.velocity) <= drawn.speed[1] + 1e-12


def test_a_scene_without_random_section_is_refused() -> None:
    with pytest.raises(ConfigError, match="random"):
        random_field(load_scene("single"), 1)


def test_a_clearance_that_leaves_no_room_is_refused() -> None:
    drawn = FIELDS.random
    assert drawn is not None
    with pytest.raises(ConfigError, match=r"random\.clearance"):
        random_field(replace(FIELDS, random=replace(drawn, clearance=50.0, moving=(0, 0))), 1)


def test_reversed_ranges_are_refused() -> None:
    drawn = yaml.safe_load((SCENE_FOLDER / "fields.yaml").read_text(encoding="utf-8"))
    drawn["random"]["radius"] = [0.6, 0.2]
    with pytest.raises(ConfigError, match=r"random: .*radius: from 0\.6 to 0\.2"):
        checked_from(drawn, Scene, "fields.yaml")


def test_a_path_exists_over_an_open_field() -> None:
    assert path_exists(scene(obstacles=[]), 200)
    assert path_exists(scene(), 200)


def ring(around: tuple[float, float], gap: int = 0) -> tuple[Sphere, ...]:
    """A closed wall of 32 stones, or with `gap` stones missing on the side away from the start."""
    angles = [math.pi / 4.0 + 2.0 * math.pi * (i + 0.5) / 32 for i in range(32)]
    kept = angles[gap:]
    return stones(*((around[0] + math.cos(a), around[1] + math.sin(a)) for a in kept), radius=0.15)


def test_no_path_exists_to_a_goal_that_is_walled_in() -> None:
    assert not path_exists(replace(scene(obstacles=[]), obstacles=ring((3.0, 3.0))), 500)


def test_a_path_exists_through_a_gap_in_the_wall() -> None:
    assert path_exists(replace(scene(obstacles=[]), obstacles=ring((3.0, 3.0), gap=6)), 1000)


def test_no_path_exists_from_a_start_that_is_walled_in() -> None:
    assert not path_exists(replace(scene(obstacles=[]), obstacles=ring((0.0, 0.0))), 500)


def test_no_path_exists_if_time_is_too_short() -> None:
    """The straight path takes 84.9 steps at cruise, 60.6 at the maximum speed."""
    assert not path_exists(scene(obstacles=[]), 45)


def test_a_wall_that_moves_away_opens_the_path() -> None:
    wall = ring((3.0, 3.0))
    leaving = tuple(replace(stone, velocity=(0.05, 0.05)) for stone in wall)
    assert path_exists(replace(scene(obstacles=[]), obstacles=leaving), 1000)
