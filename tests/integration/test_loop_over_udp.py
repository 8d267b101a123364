"""The complete loop over real sockets: demo, service and vehicle as a user runs them."""

import asyncio
import contextlib
import os
import re
import signal
import socket
import sys
import time
from asyncio.subprocess import Process
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from companion.engine import Engine
from companion.links import open_link
from companion.mavlink.tlog import read_tlog
from companion.replay import replay
from sim.clock import ScaledClock
from sim.demo import DemoOptions, fly_demo
from sim.files import checked_from
from sim.scenario import Scenario, load_scenario
from sim.server import VehicleServer
from sim.vehicle import FakeArduPlane, Mode
from sim.world import build_world
from tests.support.faulty_flight import free_ports
from tests.support.forked import Forked, fork
from tests.support.short_scenario import shorter
from tests.support.thorough import sample

pytestmark = pytest.mark.wire

SOON = {
    "description": "A head-on conflict that begins at once.",
    "duration_s": 120,
    "home": {"lat_deg": -35.36, "lon_deg": 149.16, "altitude_m": 584.0},
    "mission": {"takeoff_height_m": 50, "waypoints": [{"north_m": 8000, "east_m": 0, "height_m": 300}]},
    "start": {"where": "air", "height_m": 300},
    "intruders": [{"icao": "A00001", "callsign": "SOON1", "meet_at_s": 40, "from_deg": 0, "speed_mps": 60}],
}


async def test_the_demo_avoids_resumes_and_its_recording_replays_the_same(
    tmp_path: Path,
) -> None:
    options = DemoOptions(shorter("head-on"), speedup=20.0, record=tmp_path)
    state = await asyncio.wait_for(fly_demo(options), 60.0)
    report = state.report()
    assert state.passed
    assert report["mission_completed"]
    assert report["resumed"]
    assert report["setpoints_sent"] > 100  # type: ignore[operator]
    (encounter,) = report["encounters"]  # type: ignore[misc]
    assert not encounter["nmac"]
    assert not encounter["lowc"]
    assert encounter["first_action_s"] is not None
    assert state.recording is not None
    replayed: list[str] = []
    replay(state.recording, Engine(), on_decision=replayed.append)
    flown = state.recording.with_suffix(".jsonl").read_text().splitlines()
    assert len(flown) > 800
    assert replayed == flown[: len(replayed)]
    assert len(flown) - len(replayed) <= 10, "at most the ticks after the last frame"


async def test_px4_is_flown_with_a_real_clock() -> None:
    """Other tests fly PX4 in simulated time; here its stream must tolerate a real clock."""
    # On a slow machine the simulated clock waits, and the test takes longer.
    flight = fly_demo(DemoOptions(shorter("head-on"), speedup=12.0, autopilot="px4"))
    state = await asyncio.wait_for(flight, 240.0)
    report = state.report()
    assert state.passed
    assert report["resumed"]
    assert not report["uncontrolled"]
    (encounter,) = report["encounters"]  # type: ignore[misc]
    assert not encounter["lowc"]
    assert encounter["first_action_s"] is not None


async def test_without_avoidance_the_demo_ends_in_a_near_mid_air_collision() -> None:
    state = await asyncio.wait_for(
        fly_demo(DemoOptions(load_scenario("head-on"), speedup=40.0, avoidance=False)), 60.0
    )
    assert state.nmac
    assert not state.passed


@contextlib.asynccontextmanager
async def flying_vehicle(port: int) -> AsyncIterator[FakeArduPlane]:
    """A vehicle in the air with a conflict ahead, in real time, connected to a port."""
    scenario = checked_from(SOON, Scenario, "test")
    start_s = float(int(time.time()))
    world = build_world(scenario, start_s)
    clock = ScaledClock(1.0, start_s=start_s)
    server = VehicleServer(
        world.vehicle, [open_link(f"udpout:127.0.0.1:{port}")], clock, receiver=world.receiver
    )
    running = asyncio.create_task(server.run())
    try:
        yield world.vehicle
    finally:
        server.close()
        await running


async def _typed(*words: str) -> Process:
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", "companion", *words,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip


@contextlib.asynccontextmanager
async def service(tmp_path: Path, port: int, *, forked: bool = True) -> AsyncIterator[Process | Forked]:
    """`companion run` in its own process; not `forked`, the command as a user types it."""
    config = tmp_path / "c.yaml"
    config.write_text(f"links: [udpin:127.0.0.1:{port}]\nrecording: {{directory: {tmp_path / 'rec'}}}\n")
    process = await (fork("run", str(config), COLUMNS="200") if forked else _typed("run", str(config)))
    try:
        yield process
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def until_mode(vehicle: FakeArduPlane, mode: Mode, limit_s: float) -> None:
    async with asyncio.timeout(limit_s):
        while vehicle.truth.mode != mode.name:  # noqa: ASYNC110 - a simulated vehicle sets no events
            await asyncio.sleep(0.02)


@pytest.mark.parametrize("number", sample([signal.SIGTERM], [signal.SIGTERM, signal.SIGINT]))
async def test_a_signal_releases_the_aircraft_before_the_service_ends(tmp_path: Path, number: int) -> None:
    (port,) = free_ports(1)
    async with flying_vehicle(port) as vehicle, service(tmp_path, port, forked=False) as process:
        await until_mode(vehicle, Mode.GUIDED, 20.0)
        await asyncio.sleep(0.5)
        process.send_signal(number)
        _, errors = await asyncio.wait_for(process.communicate(), 60.0)
        assert vehicle.truth.on_mission
    assert process.returncode == 0
    assert b"Traceback" not in errors
    (log,) = (tmp_path / "rec").glob("*.tlog")
    frames = [frame for _, frame in read_tlog(log)]
    assert {frame.component_id for frame in frames} == {1, 196}, "received and sent are both recorded"


async def test_garbage_on_the_link_has_no_effect(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    junk = [bytes([0xFD, 9, 0, 0, n, 1, 1, 0, 0, 0]) + bytes(11) for n in range(50)]
    junk += [os.urandom(64) for _ in range(50)] + [b"", b"\xfe", b"\xfd" * 300]
    async with flying_vehicle(port) as vehicle, service(tmp_path, port) as process:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nuisance:
            async with asyncio.timeout(20.0):
                while not vehicle.truth.companion_flies:
                    for datagram in junk:
                        nuisance.sendto(datagram, ("127.0.0.1", port))
                    await asyncio.sleep(0.1)
        process.terminate()
        _, errors = await asyncio.wait_for(process.communicate(), 60.0)
        assert vehicle.truth.on_mission
    assert process.returncode == 0
    assert b"Traceback" not in errors
    counted = re.search(rb"(\d+) bad bytes", errors)
    assert counted is not None
    assert int(counted[1]) > 1_000


async def test_a_port_in_use_is_reported_in_one_line(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        async with service(tmp_path, port) as process:
            _, errors = await asyncio.wait_for(process.communicate(), 60.0)
    assert process.returncode == 1
    assert f"udpin:127.0.0.1:{port}".encode() in errors.splitlines()[-1]
    assert b"Traceback" not in errors


async def test_a_silent_link_is_reported_once_and_waited_for(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    async with service(tmp_path, port) as process:
        assert process.stderr is not None
        lines = []
        async with asyncio.timeout(60.0):
            while not lines or "no autopilot heard" not in lines[-1]:
                lines.append((await process.stderr.readline()).decode())
        await asyncio.sleep(1.0)
        assert process.returncode is None
        process.terminate()
        _, rest = await asyncio.wait_for(process.communicate(), 30.0)
    assert process.returncode == 0
    assert "no autopilot heard" not in rest.decode()
