"""Scenario files and their worlds: errors, and the conflicts that they describe."""

import math
from pathlib import Path

import pytest

from companion.errors import ConfigError
from sim.files import checked_from
from sim.scenario import SCENARIO_FOLDER, Autopilot, Scenario, load_scenario, scenario_names
from sim.world import build_world, undisturbed

START_S = 1_800_000_000.0
NMAC_HORIZONTAL_M, NMAC_VERTICAL_M = 152.4, 30.48
CONFLICTS = {
    "head-on": 1,
    "crossing-right": 1,
    "crossing-left": 1,
    "overtaken": 1,
    "climbing": 1,
    "two-intruders": 2,
}

SMALL = {
    "description": "one",
    "duration_s": 100,
    "home": {"lat_deg": 47.0, "lon_deg": 8.0, "altitude_m": 400.0},
    "mission": {
        "takeoff_height_m": 60,
        "waypoints": [{"north_m": 3000.0, "east_m": 0.0, "height_m": 200.0}],
    },
    "start": {"where": "air", "height_m": 200.0},
}


AUTOPILOTS: tuple[Autopilot, ...] = ("ardupilot", "px4")


def nmacs(name: str, autopilot: Autopilot) -> int:
    """Number of intruders with an NMAC without avoidance."""
    scenario = load_scenario(name)
    world = build_world(scenario, START_S, autopilot=autopilot)
    met = set()
    for truth in undisturbed(scenario, START_S, autopilot=autopilot):
        for intruder in world.intruders:
            other_m, _ = intruder.state_at(truth.time_s)
            horizontal_m = math.dist(truth.position_m[:2], other_m[:2])
            if horizontal_m < NMAC_HORIZONTAL_M and abs(truth.position_m[2] - other_m[2]) < NMAC_VERTICAL_M:
                met.add(intruder.icao)
    return len(met)


def test_the_documented_scenarios_exist() -> None:
    assert set(scenario_names()) >= {*CONFLICTS, "clear"}


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@pytest.mark.parametrize(("name", "count"), CONFLICTS.items())
def test_without_avoidance_every_conflict_is_an_nmac(name: str, count: int, autopilot: Autopilot) -> None:
    assert nmacs(name, autopilot) == count


def test_clear_traffic_stays_well_clear() -> None:
    scenario = load_scenario("clear")
    world = build_world(scenario, START_S)
    assert world.intruders
    for truth in undisturbed(scenario, START_S):
        for intruder in world.intruders:
            other_m, _ = intruder.state_at(truth.time_s)
            assert (
                math.dist(truth.position_m[:2], other_m[:2]) > 1500.0
                or abs(truth.position_m[2] - other_m[2]) > 300.0
            )


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@pytest.mark.parametrize("name", [*CONFLICTS, "clear"])
def test_the_mission_is_completed_in_time(name: str, autopilot: Autopilot) -> None:
    scenario = load_scenario(name)
    truths = undisturbed(scenario, START_S, period_s=1.0, autopilot=autopilot)
    done_s = next(t.time_s - START_S for t in truths if t.mission_completed)
    assert done_s > max(c.meet_at_s for c in scenario.intruders) + 60.0
    assert done_s < scenario.duration_s - 100.0  # time left for avoiding
    assert truths[0].on_ground == (name == "two-intruders")
    assert truths[0].armed
    assert truths[0].on_mission


def test_the_miss_is_as_described() -> None:
    conflict = {
        "icao": "ABCDEF",
        "callsign": "MISS",
        "meet_at_s": 60,
        "from_deg": 60,
        "speed_mps": 50,
        "climb_mps": -2.0,
        "miss_m": 200.0,
        "miss_height_m": 40.0,
    }
    scenario = checked_from({**SMALL, "intruders": [conflict]}, Scenario, "test")
    (intruder,) = build_world(scenario, START_S).intruders
    assert intruder.icao == 0xABCDEF
    nearest = min(
        undisturbed(scenario, START_S, 0.05),
        key=lambda t: math.dist(t.position_m[:2], intruder.state_at(t.time_s)[0][:2]),
    )
    other_m, velocity_mps = intruder.state_at(nearest.time_s)
    assert nearest.time_s - START_S == pytest.approx(60.0, abs=0.06)
    assert math.dist(nearest.position_m[:2], other_m[:2]) == pytest.approx(200.0, abs=0.1)
    assert nearest.position_m[2] - other_m[2] == pytest.approx(40.0, abs=0.2)
    assert other_m[1] > nearest.position_m[1]  # to the right of a northbound aircraft
    assert velocity_mps[1] < 0.0  # from the right
    assert math.hypot(velocity_mps[0], velocity_mps[1]) == pytest.approx(50.0)
    assert velocity_mps[2] == 2.0


def test_building_is_deterministic() -> None:
    scenario = load_scenario("two-intruders")
    assert build_world(scenario, START_S).intruders == build_world(scenario, START_S).intruders


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"intruder": []}, "intruder: unknown key"),
        ({"wind": {"up_mps": 1.0}}, "wind.up_mps: unknown key"),
        ({"duration_s": -1}, "duration_s: Input should be greater than 0"),
        ({"duration_s": "long"}, "duration_s: Input should be a valid number"),
        ({"home": {"lat_deg": 95.0, "lon_deg": 0.0, "altitude_m": 0.0}}, "home.lat_deg: "),
        ({"home": {"lat_deg": float("nan"), "lon_deg": 0.0, "altitude_m": 0.0}}, "home.lat_deg: "),
        ({"mission": {"takeoff_height_m": 60, "waypoints": []}}, "mission.waypoints: "),
        (
            {"intruders": [{"icao": "XYZ", "callsign": "A", "meet_at_s": 1, "from_deg": 0, "speed_mps": 9}]},
            "intruders.0: Value error, icao 'XYZ' is no address",
        ),
        (
            {"intruders": [{"icao": "A1", "callsign": "A", "meet_at_s": 101, "from_deg": 0, "speed_mps": 9}]},
            "Value error, intruders: A meets us after duration_s",
        ),
        (
            {
                "intruders": [{"icao": "A1", "callsign": "A", "meet_at_s": 1, "from_deg": 0, "speed_mps": 9}]
                * 2
            },
            "Value error, intruders: two of them have the same icao",
        ),
    ],
)
def test_an_error_is_named(change: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        checked_from({**SMALL, **change}, Scenario, "file.yaml")
    assert str(caught.value).startswith("file.yaml: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"there are: .*head-on"):
        load_scenario("nose-dive")
    with pytest.raises(ConfigError, match=r"none\.yaml: No such file"):
        load_scenario(tmp_path / "none.yaml")
    broken = tmp_path / "broken.yaml"
    broken.write_text("home: [1, 2\nwind: }")
    with pytest.raises(ConfigError, match=r"broken\.yaml: .*line 2"):
        load_scenario(broken)
    broken.write_text("just text")
    with pytest.raises(ConfigError, match=r"broken\.yaml: "):
        load_scenario(broken)


def test_a_file_is_loaded_by_its_path() -> None:
    assert load_scenario(SCENARIO_FOLDER / "head-on.yaml") == load_scenario("head-on")
