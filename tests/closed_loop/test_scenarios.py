"""Every scenario of `configs/scenarios`, engine and fake ArduPlane in lockstep."""

import pytest

from companion.engine import Engine
from companion.model import Layer
from sim.closed_loop import ClosedLoop, Flight
from sim.scenario import load_scenario, scenario_names

CONFLICTS = [name for name in scenario_names() if name != "clear"]


def fly(name: str) -> Flight:
    return ClosedLoop(load_scenario(name), Engine()).run()


def test_the_scenarios_are_those_promised() -> None:
    assert set(scenario_names()) >= {
        "head-on", "crossing-right", "crossing-left", "overtaken", "climbing", "two-intruders", "clear",
    }  # fmt: skip


@pytest.mark.parametrize("name", CONFLICTS)
def test_a_conflict_is_avoided_and_the_mission_finished(name: str) -> None:
    flight = fly(name)
    for encounter in flight.score.encounters.values():
        assert not encounter.nmac
        assert not encounter.lowc
        assert encounter.first_action_s is not None
    assert flight.mission_completed
    assert flight.resumed
    assert flight.engagements == len(flight.score.encounters), "one engagement for each intruder"
    assert flight.setpoints_sent > 100
    assert flight.layers[0][1] is Layer.OUTER
    assert flight.texts[-1] == "Clear of traffic, back to AUTO"


def test_traffic_that_never_conflicts_is_left_alone() -> None:
    flight = fly("clear")
    assert flight.mission_completed
    assert flight.engagements == 0
    assert flight.setpoints_sent == 0
    assert flight.layers == []
    assert flight.score.max_deviation_m < 10.0


def test_the_same_seed_gives_the_same_flight() -> None:
    first, second = fly("head-on"), fly("head-on")
    assert first.decisions == second.decisions
    assert first.truth == second.truth
