"""Scenarios with each format of receivers, from the encoder's bytes to the aircraft given back.

The same bytes go over sockets in `tests/integration/test_receivers_on_the_wire.py`.
"""

from dataclasses import replace
from functools import cache

import pytest

from companion.engine import Engine
from sim.closed_loop import ClosedLoop, Flight
from sim.metrics import EncounterScore
from sim.receivers import FORMATS
from sim.scenario import Autopilot, load_scenario
from tests.support.autopilots import MISSION_MODE, both

SCENARIOS = ("head-on", "crossing-right", "two-intruders")
# They say where an aircraft is, and are heard from afar.
FAR = tuple(name for name, each in FORMATS.items() if each.range_m > 10_000.0)

# The picture does not use relative positions yet.
waits_for_relative_positions = pytest.mark.xfail(
    strict=True, reason="companion.traffic does not place reports with relative_m yet"
)
formats = pytest.mark.parametrize("name", [*FAR, pytest.param("flarm", marks=waits_for_relative_positions)])
scenarios = pytest.mark.parametrize("scenario", SCENARIOS)


@cache
def fly(scenario: str, name: str, autopilot: Autopilot) -> Flight:
    """The flight until the last intruder has passed and the aircraft is back on its mission."""
    flown = load_scenario(scenario)
    loop = ClosedLoop(flown, Engine(), autopilot=autopilot, receivers=[name])
    loop.run(max(conflict.meet_at_s for conflict in flown.intruders))
    for _ in range(30):
        if loop.flight.truth.on_mission:
            break
        loop.run(3.0)
    return loop.flight


def encounters(flight: Flight) -> list[EncounterScore]:
    return list(flight.score.encounters.values())


@both
@scenarios
@formats
def test_traffic_of_a_receiver_is_avoided_and_the_mission_resumed(
    name: str, scenario: str, autopilot: Autopilot
) -> None:
    flight = fly(scenario, name, autopilot)
    assert not any(one.nmac or one.lowc for one in encounters(flight))
    assert flight.resumed
    assert not flight.uncontrolled
    # PX4 comes late to the second, as with its own receiver: that one passes behind.
    avoided = [one for one in encounters(flight) if one.first_action_s is not None]
    assert len(avoided) == (1 if autopilot == "px4" else len(encounters(flight)))
    assert flight.engagements == len(avoided)
    assert flight.texts[-1] == f"Clear of traffic, back to {MISSION_MODE[autopilot]}"


@both
@scenarios
def test_remote_id_is_heard_too_late_to_stay_well_clear_but_there_is_no_collision(
    scenario: str, autopilot: Autopilot
) -> None:
    flight = fly(scenario, "remoteid", autopilot)
    assert not any(one.nmac for one in encounters(flight))
    assert all(one.lowc for one in encounters(flight) if one.first_action_s is not None)
    assert flight.resumed
    assert not flight.uncontrolled


@both
def test_remote_id_heard_from_afar_keeps_well_clear(
    autopilot: Autopilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it lacks is the range of its radio: with ten times that, it is as good as the others."""
    monkeypatch.setitem(FORMATS, "remoteid", replace(FORMATS["remoteid"], range_m=10_000.0))
    flight = fly.__wrapped__("head-on", "remoteid", autopilot)
    (encounter,) = encounters(flight)
    assert encounter.first_action_s is not None
    assert not encounter.lowc
    assert flight.resumed


@both
def test_two_receivers_at_once_give_one_engagement(autopilot: Autopilot) -> None:
    loop = ClosedLoop(
        load_scenario("head-on"), Engine(), autopilot=autopilot, receivers=["gdl90", "readsb", "sbs"]
    )
    loop.run(125.0)
    assert not any(one.lowc for one in encounters(loop.flight))
    assert loop.flight.engagements == 1
    assert loop.flight.resumed


def test_the_errors_of_the_scenarios_receiver_hold_for_every_format() -> None:
    scenario = load_scenario("head-on")
    deaf = replace(scenario, receiver=replace(scenario.receiver, loss=1.0))
    for name in FAR:
        loop = ClosedLoop(deaf, Engine(), receivers=[name])
        loop.run(20.0)
        assert loop.engine is not None
        assert not loop.engine.snapshot(loop.start_us / 1e6 + 20.0).tracks, name
