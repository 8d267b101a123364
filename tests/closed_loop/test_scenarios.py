"""Every scenario of `sim/scenarios`: avoided, finished, and announced as it is flown.

Each is flown in one way of flying after the other (`make thorough`: in every way).
Engine and vehicle fly in lockstep, once for all tests of a flight, which run in one process.
"""

import math

import pytest

from companion.engine import Engine
from companion.geodesy import wrap_pi
from companion.model import Guidance, Layer
from companion.output.notice import TEXT_BYTES
from sim.closed_loop import ClosedLoop
from sim.scenario import Autopilot, load_scenario, scenario_names
from tests.support.autopilots import ALL, MISSION_MODE
from tests.support.scenario_flight import MOMENT_S, scenario_flight
from tests.support.thorough import THOROUGH

SCENARIOS = scenario_names()
# Pairs of a scenario and a way of flying.
FLOWN = [
    (name, way)
    for place, name in enumerate(SCENARIOS)
    for way in (ALL if THOROUGH else (ALL[(place + 1) % len(ALL)],))
]
CONFLICTS = [(name, way) for name, way in FLOWN if name != "clear"]
MANEUVERS = ("CLIMB", "DESCEND", "RIGHT", "LEFT", "FASTER", "SLOWER", "HOLD")
# Changes of course and height that need no text, and the longest wait of a text in a row of many.
SMALL_RAD, SMALL_M, LATE_S = math.radians(20.1), 15.1, 3.1


def test_the_documented_scenarios_exist() -> None:
    assert set(SCENARIOS) >= {
        "head-on", "crossing-right", "crossing-left", "overtaken", "climbing", "two-intruders", "clear",
    }  # fmt: skip


@pytest.mark.parametrize(("name", "autopilot"), CONFLICTS)
def test_a_conflict_is_avoided_and_the_mission_finished(name: str, autopilot: Autopilot) -> None:
    flight = scenario_flight(name, autopilot).flight
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


@pytest.mark.parametrize(("name", "autopilot"), [pair for pair in FLOWN if pair[0] == "clear"])
def test_traffic_without_conflict_is_not_avoided(name: str, autopilot: Autopilot) -> None:
    flight = scenario_flight(name, autopilot).flight
    assert flight.mission_completed
    assert flight.engagements == 0
    assert flight.setpoints_sent == 0
    assert flight.layers == []
    assert flight.score.max_deviation_m < 10.0


@pytest.mark.parametrize(("name", "autopilot"), [pair for pair in FLOWN if pair[0] == "head-on"])
def test_the_same_seed_gives_the_same_flight(name: str, autopilot: Autopilot) -> None:
    first = scenario_flight(name, autopilot)
    # Only the part with the avoidance.
    second = ClosedLoop(load_scenario(name), Engine(), autopilot=autopilot).run(60.0)
    assert second.engagements == 1
    assert len(second.decisions) > 500
    assert second.decisions == first.flight.decisions[: len(second.decisions)]
    assert second.truth == first.moments[599].truth


@pytest.mark.parametrize(("name", "autopilot"), FLOWN)
def test_each_change_of_what_is_flown_is_announced_in_one_message(name: str, autopilot: Autopilot) -> None:
    known: Guidance | None = None
    unannounced_s, count = 0.0, 0
    for moment in scenario_flight(name, autopilot).moments:
        maneuvers = [text for text in moment.texts if text.text.split()[0].strip(",:") in MANEUVERS]
        assert all(message.id == 0 and len(message.text) <= TEXT_BYTES for message in maneuvers)
        count += len(maneuvers)
        if maneuvers and moment.guidance is not None:
            known = moment.guidance
        if not moment.flying or moment.guidance is None:
            continue
        assert known is not None
        small = (
            abs(wrap_pi(moment.guidance.course_rad - known.course_rad)) < SMALL_RAD
            and abs(moment.guidance.altitude_m - known.altitude_m) < SMALL_M
        )
        unannounced_s = 0.0 if small else unannounced_s + MOMENT_S
        assert unannounced_s < LATE_S, maneuvers
    assert count < 20
