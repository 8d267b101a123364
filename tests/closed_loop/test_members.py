"""Members of a formation in lockstep: they hear each other over their network, and avoid each other."""

import pytest

from companion.mavlink.dialect import mavlink
from companion.model import Layer
from sim.members.engines import engine_of
from sim.members.loop import FormationLoop, fly_formation
from tests.support.thorough import sample
from tests.support.two_members import two_members

POOR = {"loss": 0.3, "delay_s": 1.0}


def loop_of(seed: int = 0, clock_errors_s: tuple[float, ...] = (), **changes: object) -> FormationLoop:
    scenario = two_members(**changes)
    engines = [engine_of(member) for member in scenario.formation]
    return FormationLoop(scenario, engines, seed=seed, clock_errors_s=clock_errors_s)


def test_alone_they_meet() -> None:
    flight = fly_formation(two_members(), layers=None)
    assert flight.mission_completed
    assert flight.score.separation_lost
    (pair,) = flight.score.pairs.values()
    assert pair.min_slant_m < 5.0
    assert pair.min_slant_at_s == pytest.approx(48.0, abs=1.0)


@pytest.mark.parametrize("network", sample([POOR], [{}, POOR]))
def test_they_avoid_each_other_and_finish(network: dict[str, float]) -> None:
    flight = loop_of(network=network, clock_errors_s=(0.0, 1.234)).run()
    assert flight.mission_completed
    assert not flight.score.separation_lost
    assert all(member.engagements and member.resumed for member in flight.members.values())
    assert len(flight.score.safety.values_m) > 90


def test_the_same_seed_gives_the_same_flight() -> None:
    first, second = (loop_of(seed=3, network={"loss": 0.5}).run(14.0) for _ in range(2))
    for name, flight in first.members.items():
        assert flight.decisions == second.members[name].decisions
    other = loop_of(seed=4, network={"loss": 0.5}).run(14.0)
    assert first.members["EAST"].decisions != other.members["EAST"].decisions


def test_a_network_that_loses_everything_hides_them_from_each_other() -> None:
    flight = loop_of(network={"loss": 1.0}).run(52.0)
    assert flight.score.separation_lost
    assert all(member.layers == [] for member in flight.members.values())


def test_what_the_others_hear_is_a_vehicle_and_its_companion() -> None:
    loop = loop_of()
    heard = set()
    for _ in range(100):
        loop.step()
        for frames in loop.network._coming:
            heard |= {(raw[5], raw[6], int.from_bytes(raw[7:10], "little")) for _, raw in frames}
    for system_id in (7, 8):
        assert (system_id, 1, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT) in heard
        assert (system_id, 1, mavlink.MAVLINK_MSG_ID_HEARTBEAT) in heard
        assert (system_id, 196, mavlink.MAVLINK_MSG_ID_HEARTBEAT) in heard
    assert {component for _, component, _ in heard} == {1, 196}
    assert not any(message == mavlink.MAVLINK_MSG_ID_COMMAND_LONG for _, _, message in heard)
    engine = loop.members[0].engine
    assert engine is not None
    tracks = engine.snapshot(loop.members[0].start_us / 1e6 + 5.0).tracks
    assert [track.callsign for track in tracks] == ["system 8"]


def test_a_crewed_aircraft_is_avoided_by_the_member_it_meets() -> None:
    intruder = {
        "member": "NORTH",
        "icao": "A00001",
        "callsign": "CREWED",
        "meet_at_s": 40,
        "from_deg": 0,
        "speed_mps": 60,
    }
    loop = loop_of(intruders=[intruder], network={"loss": 1.0})
    flight = loop.run(48.0).members["NORTH"]
    (encounter,) = flight.score.encounters.values()
    assert encounter.first_action_s is not None
    assert not encounter.lowc
    assert flight.layers[0][1] is Layer.OUTER
