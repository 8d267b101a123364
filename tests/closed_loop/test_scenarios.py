"""Every scenario of `sim/scenarios`, engine and every way of flying in lockstep."""

import pytest

from companion.engine import Engine
from companion.model import Layer
from sim.closed_loop import ClosedLoop, Flight
from sim.scenario import Autopilot, load_scenario, scenario_names
from tests.support.autopilots import MISSION_MODE, every

CONFLICTS = [name for name in scenario_names() if name != "clear"]


def fly(name: str, autopilot: Autopilot) -> Flight:
    return ClosedLoop(load_scenario(name), Engine(), autopilot=autopilot).run()


def test_the_documented_scenarios_exist() -> None:
    assert set(scenario_names()) >= {
        "head-on", "crossing-right", "crossing-left", "overtaken", "climbing", "two-intruders", "clear",
    }  # fmt: skip


@every
@pytest.mark.parametrize("name", CONFLICTS)
def test_a_conflict_is_avoided_and_the_mission_finished(name: str, autopilot: Autopilot) -> None:
    flight = fly(name, autopilot)
    for encounter in flight.score.encounters.values():
        assert not encounter.nmac
        assert not encounter.lowc
    # The way around the first one makes PX4 half a minute late: the second then passes well behind it.
    avoided = [one for one in flight.score.encounters.values() if one.first_action_s is not None]
    passes_behind = name == "two-intruders" and autopilot != "ardupilot"
    assert len(avoided) == len(flight.score.encounters) or passes_behind
    assert flight.mission_completed
    assert flight.resumed
    assert not flight.uncontrolled
    assert flight.engagements == len(avoided) > 0, "one engagement for each intruder"
    # GUIDED_COURSE takes a command for each change, and a course every two seconds.
    assert flight.setpoints_sent > (20 if autopilot == "px4-1.18" else 100)
    assert flight.layers[0][1] is Layer.OUTER
    assert flight.texts[-1] == f"Clear of traffic, back to {MISSION_MODE[autopilot]}"


@every
def test_traffic_without_conflict_is_not_avoided(autopilot: Autopilot) -> None:
    flight = fly("clear", autopilot)
    assert flight.mission_completed
    assert flight.engagements == 0
    assert flight.setpoints_sent == 0
    assert flight.layers == []
    assert flight.score.max_deviation_m < 10.0


@every
def test_the_same_seed_gives_the_same_flight(autopilot: Autopilot) -> None:
    # Only the part with the avoidance.
    first, second = (
        ClosedLoop(load_scenario("head-on"), Engine(), autopilot=autopilot).run(60.0) for _ in range(2)
    )
    assert first.engagements == 1
    assert first.decisions == second.decisions
    assert first.truth == second.truth
