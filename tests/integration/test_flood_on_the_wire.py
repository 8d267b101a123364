"""A flood of invented aircraft over UDP: own position and the real intruder come first, and the crew is told.

The tests say how long a report takes, so that they do not depend on the machine.
"""

import asyncio
import itertools
import socket

import pytest

from companion.engine import Engine, EngineConfig, EngineParams
from companion.links import memory_pair, open_link
from companion.links.udp import UdpInLink
from companion.load import OVERLOADED
from companion.mavlink.dialect import Encoder, mavlink
from companion.runtime import Runtime
from companion.web.health import LinkCount
from sim.clock import ScaledClock
from sim.traffic import ALL_VALID
from tests.support.inbox import Inbox, frame
from tests.support.talking_autopilot import Autopilot
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

_A_REPORT_TAKES_S = 0.002


def ghosts(count: int) -> list[bytes]:
    """Reports of aircraft that are never heard again, all around."""
    encoder = Encoder()
    return [
        encoder.encode(
            mavlink.MAVLink_adsb_vehicle_message(
                0x100000 + number, -350_000_000 + number * 7_919 % 900_000 - 450_000,
                1_490_000_000 + number * 6_007 % 900_000 - 450_000,
                1, 884_000, number * 97 % 36_000, 5_000, 0, b"GHOST", 1, 0, ALL_VALID, 1200,
            ),
            7, 156,
        )
        for number in range(count)
    ]  # fmt: skip


@in_virtual_time
async def test_own_position_and_the_intruder_come_before_a_flood() -> None:
    near, far = memory_pair()
    flooded = open_link("udpin:127.0.0.1:0?listen")
    assert isinstance(flooded, UdpInLink)
    clock = ScaledClock(1.0, start_s=1.75e9, monotonic_s=asyncio.get_running_loop().time)
    engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1)))
    runtime = Runtime(engine, [near, flooded], clock=clock)
    spent_s = itertools.count(0.0, _A_REPORT_TAKES_S)
    runtime._receiving.queue._clock_s = lambda: next(spent_s)
    flying = asyncio.create_task(Autopilot(far).run())
    running = asyncio.create_task(runtime.run())
    await asyncio.sleep(1.0)
    invented, heard, ages_s = itertools.cycle(ghosts(2000)), 0, []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        for _ in range(24):
            for _ in range(250):
                station.sendto(next(invented), ("127.0.0.1", flooded.local_port))
            await asyncio.sleep(0.05)
            now_s = clock.now_us() / 1e6
            ages_s.append(now_s - engine.aircraft.kinematics.position_s)
            heard += any(track.icao == 0xA00001 for track in engine.snapshot(now_s).tracks)
    assert max(ages_s) <= 0.11
    assert heard >= 23
    health = runtime._health()
    assert health.dropped_reports > 3_000, "each tick takes some of 500"
    assert (health.late_ticks, health.skipped_ticks) == (0, 0)
    (text,) = [one.text for one in engine.conditions if one.key == OVERLOADED]
    assert text.startswith("Overloaded: ")
    assert text.endswith("/s dropped")
    runtime.stop()
    await running
    flying.cancel()


async def test_what_the_kernel_drops_is_counted() -> None:
    link = open_link("udpin:127.0.0.1:0")
    assert isinstance(link, UdpInLink)
    await link.open()
    inbox = Inbox()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.connect(("127.0.0.1", link.local_port))
        running = asyncio.create_task(link.run(inbox))
        flood, last = frame(1), frame(2)
        for _ in range(20_000):  # without a turn of the loop in between
            station.send(flood)
        await inbox.until(1)
        await asyncio.sleep(0.05)
        station.send(last)  # brings the count of those before it
        async with asyncio.timeout(3.0):
            while inbox.raws[-1] != last:  # noqa: ASYNC110 - an inbox sets no events for content
                await asyncio.sleep(0.01)
        counted = LinkCount(link.address, link.counters.frames, 0, 0, 0, 0, link.counters.dropped)
        assert counted.dropped > 0
        assert counted.frames + counted.dropped == 20_001
        link.close()
        await running
