"""The fault table, what goes wrong on the way: link lost, loss, delay, repetition, and who is on it."""

import asyncio

import pytest

from companion.control.state_machine import State
from companion.engine import EngineConfig, EngineParams
from companion.links import open_link
from sim.faults import Faults
from sim.scenario import Autopilot
from sim.server import VehicleServer
from tests.support.autopilots import (
    ALL,
    ARDUPILOT,
    BOTH,
    GUIDED_MODE,
    MISSION_MODE,
    PX4,
    PX4_1_18,
    paired,
    ways,
)
from tests.support.faulty_flight import CLIMBS, FaultyFlight, faulty_flight, world_of
from tests.support.thorough import pairs, sample
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

FOUND = "Avoidance: found, giving back to MISSION"


async def lose_the_link(flight: FaultyFlight, seconds: float) -> None:
    flight.relay.cut()
    await flight.fly(seconds)
    flight.relay.mend()


@paired("seconds", [3.0, 12.0], (ARDUPILOT, PX4_1_18))
@in_virtual_time
async def test_guided_and_guided_course_fly_on_while_the_link_is_lost(
    autopilot: Autopilot, seconds: float
) -> None:
    """Up to five seconds the decision stands; after that it is given back as soon as it is heard again."""
    engagements = 1 if seconds < 5.0 else 2
    async with faulty_flight(autopilot) as flight:
        await flight.engaged()
        await lose_the_link(flight, seconds)
        assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot]]
        told = any(text.startswith("Avoidance: autopilot lost") for text in flight.notes.texts())
        assert told is (engagements == 2)
        await flight.fly(3.0)
        assert flight.engine.supervisor.flying
        await flight.resumed()
        assert flight.engagements == engagements
        assert not flight.nmac
        assert not flight.lowc


@pytest.mark.parametrize("seconds", sample([12.0], [3.0, 12.0]))
@in_virtual_time
async def test_px4_holds_while_the_link_is_lost_and_is_taken_from_there(seconds: float) -> None:
    async with faulty_flight("px4") as flight:
        await flight.engaged()
        await lose_the_link(flight, seconds)
        assert flight.modes == ["MISSION", "OFFBOARD", "HOLD"]
        await flight.fly(6.0)
        assert flight.modes == ["MISSION", "OFFBOARD", "HOLD", "MISSION", "OFFBOARD"]
        assert FOUND in flight.notes.texts()
        await flight.resumed()
        assert flight.engagements == 2
        assert not flight.nmac
        assert not flight.lowc


@in_virtual_time
async def test_px4_that_lost_the_link_in_a_climb_has_lost_itself_and_is_recovered() -> None:
    async with faulty_flight("px4", below_m=30.0, engine=CLIMBS) as flight:
        await flight.engaged()
        await flight.fly(3.0)
        flight.receiver.deaf = True
        flight.relay.cut()
        await flight.fly(3.0)
        assert flight.vehicle.truth.uncontrolled, "the real one: 36 times of 36"
        flight.relay.mend()
        await flight.until(lambda: not flight.vehicle.truth.uncontrolled, 8.0)
        flight.was_uncontrolled = False
        assert "Avoidance: attitude setpoint lost, recovering" in flight.notes.texts()
        await flight.resumed()


@in_virtual_time
async def test_px4_that_waits_for_sticks_without_a_link_is_the_pilots() -> None:
    """COM_OBL_RC_ACT 0: where it goes to is where a pilot would be found."""
    async with faulty_flight("px4", lost_stream=0) as flight:
        await flight.engaged()
        await lose_the_link(flight, 12.0)
        assert flight.modes == ["MISSION", "OFFBOARD", "POSCTL"]
        await flight.until(lambda: flight.state is State.HANDS_OFF, 5.0)
        left_s = flight.now_s
        await flight.fly(10.0)
        assert flight.modes == ["MISSION", "OFFBOARD", "POSCTL"]
        assert flight.notes.commands(left_s + 0.2) == []


@ways(ARDUPILOT, among=BOTH)
@in_virtual_time
async def test_a_link_lost_before_a_conflict_is_no_reason_to_fly(autopilot: Autopilot) -> None:
    """Where it was flying to is remembered: no phantom of a mission makes a conflict of its own."""
    async with faulty_flight(autopilot) as flight:
        flight.receiver.deaf = True
        await flight.until(lambda: flight.state is State.MONITOR)
        await flight.fly(3.0)
        await lose_the_link(flight, 12.0)
        await flight.fly(4.0)
        assert flight.state is State.MONITOR
        assert flight.modes == [MISSION_MODE[autopilot]]
        flight.receiver.deaf = False
        await flight.until(lambda: flight.guided, 10.0)


SPOILT = {
    "30 % lost": Faults(loss=0.3),
    "half a second late": Faults(delay_s=0.5),
    "doubled and overtaking": Faults(duplication=0.5, jitter_s=0.4),
}


# One late by half a second is flown by `make thorough`; late copies are flown beside it.
SPOILT_WAYS = [(ARDUPILOT, "30 % lost"), (PX4, "doubled and overtaking")]


@pytest.mark.parametrize(("autopilot", "spoilt"), sample(SPOILT_WAYS, pairs(ALL, [*SPOILT])))
@in_virtual_time
async def test_a_bad_link_does_not_keep_the_traffic_from_being_avoided(
    autopilot: Autopilot, spoilt: str
) -> None:
    faults = SPOILT[spoilt]
    async with faulty_flight(autopilot, forth=faults, back=faults) as flight:
        await flight.engaged()
        await flight.resumed()
        if faults.loss and autopilot == "px4" and "HOLD" in flight.modes:
            # A second of silence ends OFFBOARD, which is then entered again: in one flight of forty.
            assert flight.modes == ["MISSION", "OFFBOARD", "HOLD", "OFFBOARD", "MISSION"]
        else:
            assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot], MISSION_MODE[autopilot]]
        assert not flight.nmac
        assert not flight.lowc
        for line in (flight.relay.forth, flight.relay.back):
            counted = line.counters
            assert (counted.lost > 0) is (faults.loss > 0.0)
            assert (counted.overtaken > 0) is (faults.jitter_s > 0.0)


async def second_autopilot(flight: FaultyFlight) -> VehicleServer:
    """One with system id 2, on the same link."""
    world, _ = world_of(flight.autopilot)
    world.vehicle.system_id = 2
    port = flight.relay.local_port
    return VehicleServer(world.vehicle, [open_link(f"udpout:127.0.0.1:{port}")], flight.clock)


@paired("system_id", ["auto", 1], BOTH)
@in_virtual_time
async def test_two_autopilots_on_one_link(autopilot: Autopilot, system_id: int | str) -> None:
    config = EngineConfig(engine=EngineParams(autopilot_system_id=system_id))  # type: ignore[arg-type]
    async with faulty_flight(autopilot, engine=config) as flight:
        server = await second_autopilot(flight)
        beside = asyncio.create_task(server.run())
        if system_id == "auto":
            await flight.fly(20.0)
            assert flight.engine.aircraft.adapter is None
            assert flight.notes.commands() == []
            assert flight.modes == [MISSION_MODE[autopilot]]
            told = "several autopilots, set autopilot_system_id"
            assert flight.notes.texts().count(told) == 1
            await flight.fly(15.0)
            assert flight.notes.texts().count(told) == 2, "again after half a minute"
        else:
            await flight.engaged()
            await flight.fly(5.0)
            assert {getattr(m, "target_system", 1) for _, m in flight.notes.sent_messages} == {1}
        server.close()
        await beside


@ways(PX4, among=BOTH)
@in_virtual_time
async def test_an_autopilot_of_another_system_than_configured_is_left_alone(
    autopilot: Autopilot, caplog: pytest.LogCaptureFixture
) -> None:
    config = EngineConfig(engine=EngineParams(autopilot_system_id=7))
    async with faulty_flight(autopilot, engine=config) as flight:
        await flight.fly(20.0)
        assert flight.modes == [MISSION_MODE[autopilot]]
        kinds = {message.get_type() for _, message in flight.notes.sent_messages}
        assert kinds == {"HEARTBEAT", "STATUSTEXT"}
        assert "system 1 is heard, not the autopilot configured" in flight.notes.texts()
    assert "no autopilot heard" in caplog.text
