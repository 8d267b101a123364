"""Which of those heard is our aircraft: another one has its address, and stations look like one."""

import asyncio
import contextlib
import itertools
import socket
from collections.abc import AsyncIterator

import pytest

from companion.control.state_machine import State
from companion.links import open_link
from companion.mavlink.dialect import Encoder, mavlink
from sim.scenario import Autopilot
from sim.server import VehicleServer
from sim.vehicle import FakeVehicle
from tests.support.autopilots import GUIDED_MODE, MISSION_MODE, both
from tests.support.faulty_flight import FaultyFlight, faulty_flight, world_of
from tests.support.thorough import sample
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

LINKS: list[tuple[Autopilot, str]] = [("ardupilot", "same link"), ("px4", "another link")]
EACH = pytest.mark.parametrize(("autopilot", "link"), LINKS)
TWO_VEHICLES = "two vehicles have its system id"


def port_of(flight: FaultyFlight, link: str) -> int:
    return flight.relay.local_port if link == "same link" else flight.second_port


@contextlib.asynccontextmanager
async def another_vehicle(
    flight: FaultyFlight, link: str, *, ahead_s: float = 320.0, system_id: int = 1
) -> AsyncIterator[FakeVehicle]:
    """A vehicle on the same mission that started so much earlier, so that it is some 8 km ahead."""
    world, _ = world_of(flight.autopilot, start_s=flight.now_s - ahead_s)
    other = world.vehicle
    other.system_id = system_id
    for second in range(round(ahead_s)):
        other.step(flight.now_s - ahead_s + second)
    server = VehicleServer(other, [open_link(f"udpout:127.0.0.1:{port_of(flight, link)}")], flight.clock)
    beside = asyncio.create_task(server.run())
    try:
        yield other
    finally:
        server.close()
        await beside


# --- two vehicles with one address


@pytest.mark.parametrize(("autopilot", "link"), sample(LINKS[:1], LINKS))
@in_virtual_time
async def test_neither_of_two_vehicles_with_one_address_is_flown(autopilot: Autopilot, link: str) -> None:
    async with faulty_flight(autopilot) as flight, another_vehicle(flight, link) as other:
        for _ in range(50):
            await flight.fly(1.0)
            assert other.truth.mode == MISSION_MODE[autopilot]
        assert flight.modes == [MISSION_MODE[autopilot]]
        assert flight.notes.commands() == []
        assert flight.notes.texts().count(f"Avoidance off: {TWO_VEHICLES}") >= 2, "again each half minute"


@pytest.mark.parametrize(("autopilot", "link"), sample(LINKS[1:], LINKS))
@in_virtual_time
async def test_a_vehicle_with_the_address_of_ours_that_appears_while_it_is_flown_ends_that(
    autopilot: Autopilot, link: str
) -> None:
    async with faulty_flight(autopilot) as flight:
        await flight.engaged()
        async with another_vehicle(flight, link) as other:
            await flight.until(lambda: flight.state is State.HANDS_OFF, 6.0)
            left_s = flight.now_s + 0.2
            for _ in range(60):
                await flight.fly(1.0)
                assert other.truth.mode == MISSION_MODE[autopilot]
            assert flight.notes.commands(left_s) == []
        texts = flight.notes.texts()
        assert f"Avoidance: hands off, two vehicles, {GUIDED_MODE[autopilot]}" in texts
        assert texts.count(f"Avoidance: {TWO_VEHICLES}") >= 2, "again each half minute"
        assert len([text for text in texts if text.endswith("flown by no one, take over")]) == 2


# --- stations and receivers that look like an autopilot

LOOK_ALIKES = (
    (mavlink.MAV_TYPE_GCS, 255, 190),
    (mavlink.MAV_TYPE_ADSB, 1, 156),
    (mavlink.MAV_TYPE_ADSB, 9, 1),
    (mavlink.MAV_TYPE_GENERIC, 7, 1),
)


@both
@in_virtual_time
async def test_stations_and_receivers_heard_before_the_autopilot_are_not_taken_for_one(
    autopilot: Autopilot,
) -> None:
    """Some are heard on its link and some on another one, from the start and all the time."""
    async with faulty_flight(autopilot) as flight, beating(flight):
        await flight.engaged()
        assert flight.modes == [MISSION_MODE[autopilot], GUIDED_MODE[autopilot]]
        assert not any("autopilot" in text for text in flight.notes.texts())


@contextlib.asynccontextmanager
async def beating(flight: FaultyFlight) -> AsyncIterator[None]:
    """Each of `LOOK_ALIKES` sends a heartbeat a second, as of an autopilot GENERIC."""
    task = asyncio.create_task(beat(flight))
    await flight.fly(0.0)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def beat(flight: FaultyFlight) -> None:
    with contextlib.ExitStack() as opened:
        senders = []
        for (kind, system, component), link in zip(
            LOOK_ALIKES, itertools.cycle(["same link", "another link"]), strict=False
        ):
            own = opened.enter_context(socket.socket(type=socket.SOCK_DGRAM))
            own.connect(("127.0.0.1", port_of(flight, link)))
            message = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_GENERIC, 0, 0, 4, 3)
            senders.append((own, Encoder(), message, system, component))
        while True:
            for own, encoder, message, system, component in senders:
                own.send(encoder.encode(message, system, component))
            await asyncio.sleep(1.0)


@EACH
@in_virtual_time
async def test_another_autopilot_is_told_as_long_as_it_is_heard_and_no_longer(
    autopilot: Autopilot, link: str
) -> None:
    async with faulty_flight(autopilot) as flight:
        flight.receiver.deaf = True
        async with another_vehicle(flight, link, system_id=2):
            await flight.fly(40.0)
            assert flight.engine.aircraft.adapter is None
            told = "several autopilots, set autopilot_system_id"
            assert [text for text in flight.notes.texts() if told in text] == [told] * 2
        flight.receiver.deaf = False
        await flight.until(lambda: flight.engine.aircraft.adapter is not None, 13.0)
        assert flight.engine.aircraft.sender.system_id == 1
        await flight.engaged()
