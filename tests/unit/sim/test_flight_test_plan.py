"""The files of flight tests."""

import re
from pathlib import Path

import pytest

from companion.errors import ConfigError
from sim.flight_test.plan import Action, load_set, set_names

MINIMAL = """
description: one
mission: {takeoff_height_m: 60, waypoints: [{north_m: 1000, east_m: 0, height_m: 100}]}
encounters:
  - name: head-on
    intruders: [{speed_mps: 60}]
"""


@pytest.mark.parametrize("name", set_names())
def test_the_sets_that_come_with_the_project_are_valid(name: str) -> None:
    test = load_set(name)
    assert len(test.encounters) >= 9
    assert {"ardupilot", "px4"} == set(test.parameters)


def test_three_sets_come_with_the_project() -> None:
    assert set_names() == ["authority", "basic", "hard"]


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(MINIMAL)
    (encounter,) = load_set(path).encounters
    assert encounter.intruders[0].speed_mps == 60.0
    assert encounter.expect.well_clear


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ("speed_mps: 60", "encounters.0.intruders.0.speed_mps"),
        ("name: head-on", "encounters.0.name"),
    ],
)
def test_what_is_missing_is_named(tmp_path: Path, change: str, complaint: str) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(MINIMAL.replace(change, "unknown: 1"))
    with pytest.raises(ConfigError, match=rf"own\.yaml: {re.escape(complaint)}"):
        load_set(path)


@pytest.mark.parametrize("judged", ["well_clear: false", "back: false"])
def test_an_expectation_that_would_not_be_judged_is_refused(tmp_path: Path, judged: str) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(f"{MINIMAL}    expect: {{{judged}}}\n")
    with pytest.raises(ConfigError, match="expect"):
        load_set(path)


def test_an_unknown_set_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ConfigError, match="no such set; there are: authority, basic, hard"):
        load_set("nosuch")


def test_an_action_does_one_thing() -> None:
    with pytest.raises(ValueError, match="exactly one of"):
        Action()
    with pytest.raises(ValueError, match="exactly one of"):
        Action(mode="hold", stall_s=2.0)


def test_two_encounters_of_one_name_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(MINIMAL + "  - {name: head-on}\n")
    with pytest.raises(ConfigError, match="two of them have the same name"):
        load_set(path)
