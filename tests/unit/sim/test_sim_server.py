"""The simulated clock, and the vehicle server on links in memory."""

import asyncio
import itertools
import struct

import pytest

from companion.errors import LinkError
from companion.geodesy import GeoPoint, LocalFrame
from companion.links import memory_pair, open_link
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import decode
from sim.clock import ScaledClock
from sim.server import VehicleServer
from sim.traffic import AdsbReceiver, Intruder
from sim.vehicle import FakeArduPlane, Truth

START_S = 1_800_000_000.0
HOME = GeoPoint(47.0, 8.0, 400.0)


class Stopwatch:
    """A monotonic clock set by the test."""

    def __init__(self) -> None:
        self.seconds = 100.0

    def __call__(self) -> float:
        return self.seconds


def test_the_clock_runs_at_its_speed_in_whole_microseconds() -> None:
    real = Stopwatch()
    clock = ScaledClock(8.0, start_s=START_S, monotonic_s=real)
    assert clock.now_s() == START_S
    real.seconds += 1.25
    assert clock.now_s() == clock() == START_S + 10.0
    real.seconds += 1.3e-7
    assert round(clock.now_s() * 1e6) == 1_800_000_010_000_001


@pytest.mark.parametrize("speedup", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_speedups_are_refused(speedup: float) -> None:
    with pytest.raises(ValueError, match="speedup"):
        ScaledClock(speedup)


def test_a_held_clock_stops_reports_it_and_never_jumps() -> None:
    real = Stopwatch()
    clock = ScaledClock(10.0, start_s=START_S, monotonic_s=real)
    clock.hold_at(START_S + 5.0)
    real.seconds += 0.4
    assert clock.now_s() == START_S + 4.0
    assert clock.overruns == 0
    real.seconds += 1.0  # a busy second
    assert clock.now_s() == clock.now_s() == START_S + 5.0
    assert (clock.overruns, clock.slipped_s) == (1, 9.0)
    clock.hold_at(START_S + 20.0)
    assert clock.now_s() == START_S + 5.0  # continues from the time at which it stopped
    real.seconds += 0.2
    assert clock.now_s() == START_S + 7.0
    clock.hold_at(START_S + 1.0)  # back is not possible
    real.seconds += 0.2
    assert clock.now_s() == START_S + 9.0


def test_the_slowest_of_several_holders_stops_the_clock() -> None:
    real = Stopwatch()
    clock = ScaledClock(10.0, start_s=START_S, monotonic_s=real)
    clock.hold_at(START_S + 5.0, "one")
    clock.hold_at(START_S + 5.0, "other")
    clock.hold_at(START_S + 20.0, "one")
    real.seconds += 1.0
    assert clock.now_s() == START_S + 5.0, "the other is not ready yet"
    clock.hold_at(START_S + 15.0, "other")
    real.seconds += 2.0
    assert clock.now_s() == START_S + 15.0


def test_a_limit_in_the_past_stops_the_clock() -> None:
    real = Stopwatch()
    clock = ScaledClock(10.0, start_s=START_S, monotonic_s=real)
    real.seconds += 3.0
    clock.hold_at(START_S + 5.0)
    real.seconds += 1.0
    assert clock.now_s() == START_S + 30.0


async def test_sleeping_is_scaled() -> None:
    clock = ScaledClock(100.0, start_s=START_S)
    await asyncio.wait_for(clock.sleep_until(START_S + 5.0), 2.0)
    assert clock.now_s() >= START_S + 4.99
    await clock.sleep_until(START_S)  # long past: no waiting


class Watch(list[Truth]):
    """The truths observed from the server, and a way to wait for them."""

    def __init__(self) -> None:
        super().__init__()
        self.news = asyncio.Event()

    def __call__(self, truth: Truth) -> None:
        self.append(truth)
        self.news.set()

    async def until(self, seconds: float) -> None:
        async with asyncio.timeout(10.0):
            while not self or self[-1].time_s < START_S + seconds:
                self.news.clear()
                await self.news.wait()


async def test_vehicle_and_peer_communicate_despite_junk() -> None:
    clock = ScaledClock(20.0, start_s=START_S)
    near, far = memory_pair()
    truths = Watch()
    intruder = Intruder(0xA00001, "T000", START_S, (3000.0, 0.0, -700.0), (-60.0, 0.0, 0.0))
    receiver = AdsbReceiver([intruder], LocalFrame(HOME.lat_deg, HOME.lon_deg), START_S)
    vehicle = FakeArduPlane(HOME, START_S)
    server = VehicleServer(vehicle, [near], clock, receiver=receiver, observe=truths)
    heard: list[Message] = []
    encoder = Encoder()
    command = mavlink.MAVLink_command_long_message(
        1,
        1,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        0,
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE,
        200_000,
        0,
        0,
        0,
        0,
        0,
    )
    frame = encoder.encode(command, 1, 191)
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(server.run())
        tasks.create_task(far.run(lambda frames, _: heard.extend(m for f in frames if (m := decode(f)))))
        far.send(b"\xfd junk \xfe")
        far.send(frame[:-3])
        far.send(frame[:-1] + struct.pack("B", frame[-1] ^ 1))
        far.send(frame)
        await truths.until(10.0)
        server.close()
        far.close()
    assert near.counters.bad_crc == 1
    assert near.counters.bad_bytes > 0
    acks = [m for m in heard if m.get_type() == "COMMAND_ACK"]
    assert [(m.command, m.result, m.target_system, m.target_component) for m in acks] == [(511, 0, 1, 191)]
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in heard} == {(1, 1)}
    assert 9 <= len([m for m in heard if m.get_type() == "HEARTBEAT"]) <= truths[-1].time_s - START_S + 1.0
    assert len([m for m in heard if m.get_type() == "ADSB_VEHICLE"]) >= 7
    assert far.counters.lost == 0
    assert [t.time_s for t in truths] == sorted({t.time_s for t in truths})


def test_a_holder_that_has_ended_holds_the_clock_no_longer() -> None:
    real_s = [0.0]
    clock = ScaledClock(start_s=START_S, monotonic_s=lambda: real_s[0])
    clock.hold_at(START_S + 5.0, "one")
    clock.hold_at(START_S + 20.0, "other")
    real_s[0] = 10.0
    assert clock.now_s() == START_S + 5.0
    clock.let_go("one")
    real_s[0] = 12.0
    assert clock.now_s() == START_S + 7.0
    clock.let_go("other")
    real_s[0] = 100.0
    assert clock.now_s() == START_S + 20.0, "nothing flies any more"


async def test_an_impossible_speedup_is_reported_and_steps_stay_small() -> None:
    looks = itertools.count()
    clock = ScaledClock(start_s=START_S, monotonic_s=lambda: float(next(looks)))  # a second for each look
    near, _ = memory_pair()
    truths = Watch()
    server = VehicleServer(FakeArduPlane(HOME, START_S), [near], clock, observe=truths)
    running = asyncio.create_task(server.run())
    await truths.until(20.0)
    server.close()
    await running
    assert server.overruns > 0
    assert clock.slipped_s > 0.0
    steps = [after.time_s - before.time_s for before, after in itertools.pairwise(truths)]
    assert max(steps) <= 0.5 + 1e-6
    assert clock.now_s() - truths[-1].time_s <= 1.0


async def test_a_lost_peer_does_not_stop_the_flight() -> None:
    clock = ScaledClock(20.0, start_s=START_S)
    near, far = memory_pair()
    truths = Watch()
    server = VehicleServer(FakeArduPlane(HOME, START_S), [near], clock, observe=truths)
    far.close()
    near.other = None
    running = asyncio.create_task(server.run())
    await truths.until(5.0)
    assert near.counters.send_errors > 0
    server.close()
    await running


async def test_a_link_that_cannot_be_opened_ends_the_server() -> None:
    link = open_link("udpin:256.0.0.1:0")
    server = VehicleServer(FakeArduPlane(HOME, START_S), [link], ScaledClock(start_s=START_S))
    with pytest.raises(ExceptionGroup) as caught:
        await server.run()
    assert caught.group_contains(LinkError)
