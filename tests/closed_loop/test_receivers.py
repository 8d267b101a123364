"""Scenarios with each format of receivers, from the encoder's bytes to the aircraft given back.

The formats fly in turn with both autopilots, and meet one aircraft head-on, or from the right. With
`make thorough` all of them fly every scenario, also with two intruders, with both autopilots. The same bytes
go over sockets in `tests/integration/test_receivers_on_the_wire.py`.
"""

from dataclasses import replace

import pytest

from companion.engine import Engine
from sim.closed_loop import ClosedLoop, Flight
from sim.metrics import EncounterScore
from sim.receivers import FORMATS
from sim.scenario import Autopilot, load_scenario
from tests.support.autopilots import BOTH, MISSION_MODE, in_turn
from tests.support.short_scenario import shorter
from tests.support.thorough import THOROUGH, sample

SCENARIOS = ("head-on", "crossing-right", "two-intruders")
# They reach an aircraft that comes head-on a minute before the meeting: 5 km for FLARM, the others more.
IN_TIME = tuple(name for name in FORMATS if name != "remoteid")


def _met(place: int) -> tuple[str, ...]:
    """The scenario of a format that is flown in turn; the autopilots change with each."""
    return SCENARIOS[place // 2 % 2 :][:1]


ROWS = [
    (name, scenario)
    for place, name in enumerate(IN_TIME)
    for scenario in (SCENARIOS if THOROUGH else _met(place))
]


def fly(scenario: str, name: str, autopilot: Autopilot) -> Flight:
    """The flight until the last intruder has passed and the aircraft is back on its mission."""
    flown = load_scenario(scenario) if scenario == "two-intruders" else shorter(scenario)
    loop = ClosedLoop(flown, Engine(), autopilot=autopilot, receivers=[name])
    loop.run(max(conflict.meet_at_s for conflict in flown.intruders))
    for _ in range(30):
        if loop.flight.truth.on_mission:
            break
        loop.run(3.0)
    return loop.flight


def encounters(flight: Flight) -> list[EncounterScore]:
    return list(flight.score.encounters.values())


@in_turn("row", ROWS, BOTH)
def test_traffic_of_a_receiver_is_avoided_and_the_mission_resumed(
    autopilot: Autopilot, row: tuple[str, str]
) -> None:
    name, scenario = row
    flight = fly(scenario, name, autopilot)
    assert not any(one.nmac or one.lowc for one in encounters(flight))
    assert flight.resumed
    assert not flight.uncontrolled
    # PX4 comes late to the second, as with its own receiver: that one passes behind.
    avoided = [one for one in encounters(flight) if one.first_action_s is not None]
    assert len(avoided) == (1 if autopilot == "px4" else len(encounters(flight)))
    assert flight.engagements == len(avoided)
    assert f"Clear of traffic, back to {MISSION_MODE[autopilot]}" in flight.texts


@in_turn("scenario", sample(SCENARIOS[:2], SCENARIOS), BOTH, first=1)
def test_remote_id_is_heard_too_late_to_stay_well_clear_but_there_is_no_collision(
    autopilot: Autopilot, scenario: str
) -> None:
    flight = fly(scenario, "remoteid", autopilot)
    assert not any(one.nmac for one in encounters(flight))
    assert any(one.lowc for one in encounters(flight))
    assert flight.engagements > 0
    assert flight.resumed
    assert not flight.uncontrolled


def test_remote_id_heard_from_afar_keeps_well_clear(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it lacks is the range of its radio: with ten times that, it is as good as the others."""
    monkeypatch.setitem(FORMATS, "remoteid", replace(FORMATS["remoteid"], range_m=10_000.0))
    flight = fly("head-on", "remoteid", "ardupilot")
    assert flight.engagements == 1
    assert not any(one.lowc for one in encounters(flight))
    assert flight.resumed


def test_the_name_of_an_aircraft_that_is_heard_by_remote_id(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FORMATS, "remoteid", replace(FORMATS["remoteid"], range_m=20_000.0))
    loop = ClosedLoop(load_scenario("head-on"), Engine(), receivers=["remoteid"])
    loop.run(10.0)
    assert loop.engine is not None
    (track,) = loop.engine.snapshot(loop.start_us / 1e6 + 10.0).tracks
    assert track.name == "HEAD1"


def test_three_receivers_at_once_give_one_engagement() -> None:
    loop = ClosedLoop(shorter("head-on"), Engine(), receivers=["gdl90", "readsb", "flarm"])
    loop.run(105.0)
    assert not any(one.lowc for one in encounters(loop.flight))
    assert loop.flight.engagements == 1
    assert loop.flight.resumed
