"""`companion-sim flight-test` as a user runs it, on the bundled fake; the ground station is MAVSDK."""

import asyncio
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from companion.geodesy import GeoPoint
from companion.links import open_link
from companion.mavlink.tlog import read_tlog
from sim.clock import ScaledClock
from sim.server import VehicleServer
from sim.vehicle import FakeArduPlane, FakePx4, FakeVehicle
from sim.vehicle.px4.telemetry import Px4Telemetry
from tests.support.commands import call
from tests.support.faulty_flight import free_ports
from tests.support.thorough import sample

pytest.importorskip("mavsdk", reason="MAVSDK's library cannot be loaded on this platform")

from sim.flight_test import preparation
from sim.flight_test.flight import Flight, Options
from sim.flight_test.plan import load_set
from sim.flight_test.safety import RealAircraftError
from sim.flight_test.under_test import companion_under_test

pytestmark = pytest.mark.wire

SHORT = """
description: A head-on, and a pilot who takes the aircraft.
mission:
  takeoff_height_m: 60
  waypoints:
    - {north_m: 700, east_m: 0, height_m: 100}
    - {north_m: 40000, east_m: 0, height_m: 100}
parameters:
  ardupilot: {AVD_F_DIST_XY: 250}
encounters:
  - name: head-on
    meets_s: 45
    lasts_s: 10
    intruders: [{speed_mps: 60, miss_m: 50}]
  - name: pilot takes it
    meets_s: 45
    lasts_s: 5
    intruders: [{speed_mps: 55, miss_height_m: 80}]
    actions:
      - {when: taken over, after_s: 3, mode: hold, claims: true}
      - {when: last, after_s: 8, mode: mission}
    expect: {back: null, mode: hold}
"""
HOME = GeoPoint(47.39, 8.54, 489.0)
KEYS = {
    "name", "min_slant_m", "min_horizontal_m", "vertical_m", "nmac", "lowc", "first_action_s", "modes",
    "max_deviation_m", "max_height_m", "back_on_leg_s", "resumed",
}  # fmt: skip


def flight_test(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from sim.cli import main; main()", "flight-test", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )


def test_the_fake_is_flown_judged_and_recorded(tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text(SHORT)
    options = ("--vehicle", "fake", "--set", "short.yaml", "--speedup", "8", "--report", "r.json")
    flown = flight_test(tmp_path, *options)
    assert flown.returncode == 0, flown.stdout + flown.stderr
    report: dict[str, Any] = json.loads((tmp_path / "r.json").read_text())
    assert report["passed"]
    head_on, taken = report["encounters"]
    assert set(head_on) >= KEYS
    assert head_on["modes"] == ["AUTO", "GUIDED", "AUTO"]
    assert head_on["min_slant_m"] > 76.0
    assert head_on["back_on_leg_s"] > 20.0
    assert "LOITER" in taken["modes"]
    assert taken["commands_after_claim"] == []
    (folder,) = (tmp_path / "flight-test").iterdir()
    assert sum(1 for _ in read_tlog(folder / "flight.tlog")) > 1000
    assert "<img" in (folder / "flight.html").read_text()
    assert "2 of 2 encounters as expected" in flown.stdout


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--vehicle", "fake", "--set", "nosuch"), "no such set"),
        (("--vehicle", "nowhere"), "--vehicle"),
        (("--vehicle", "fake", "--only", "nosuch"), "no such encounter"),
        (("--vehicle", "fake", "--compare", "missing.json"), "missing.json"),
        (("--vehicle", "fake", "--report", "no/such/r.json"), "no/such"),
        (("--vehicle", "fake", "--companion", "missing.yaml"), "missing.yaml"),
    ],
)
def test_bad_usage_is_one_line_and_exit_two(tmp_path: Path, options: tuple[str, ...], words: str) -> None:
    refused = call("flight-test", *options, module="sim", folder=tmp_path)
    assert refused.returncode == 2, refused.stderr
    assert words in refused.stderr


def flown_inside(folder: Path, vehicle: FakeVehicle, clock: ScaledClock, text: str = SHORT) -> Flight:
    (folder / "short.yaml").write_text(text)
    options = Options(
        load_set(folder / "short.yaml"), vehicle, folder, clock=clock, inside=True, set_parameters=True
    )
    return Flight(options)


async def until(condition: Callable[[], bool], limit_s: float = 90.0) -> None:
    async with asyncio.timeout(limit_s):
        while not condition():  # noqa: ASYNC110 - a simulated vehicle sets no events
            await asyncio.sleep(0.05)


MOMENTS = ["while it is avoiding", "before it is taken over"]


@pytest.mark.parametrize("moment", sample(MOMENTS[:1], MOMENTS))
async def test_an_interruption_ends_in_order(tmp_path: Path, moment: str) -> None:
    start_s = float(int(time.time()))
    clock, vehicle = ScaledClock(8.0, start_s=start_s), FakeArduPlane(HOME, start_s)
    before = vehicle.parameters["AVD_F_DIST_XY"]
    flight = flown_inside(tmp_path, vehicle, clock)
    running = asyncio.create_task(flight.run())
    guided = moment == "while it is avoiding"
    await until(lambda: flight.judged is not None and flight.observer.guided is guided)
    assert vehicle.parameters["AVD_F_DIST_XY"] == 250.0
    running.cancel()
    result = await running
    assert result.problem == "interrupted"
    assert not result.passed
    assert result.failures == {"head-on": result.failures["head-on"]}
    assert "ended early" in result.failures["head-on"]
    assert vehicle.truth.mode == "AUTO"
    assert vehicle.parameters["AVD_F_DIST_XY"] == before


async def test_a_mode_of_someone_else_is_left_alone(tmp_path: Path) -> None:
    start_s = float(int(time.time()))
    clock, vehicle = ScaledClock(8.0, start_s=start_s), FakeArduPlane(HOME, start_s)
    waits_less = SHORT.replace("lasts_s: 10\n", "lasts_s: 10\n    expect: {back_within_s: 10}\n")
    flight = flown_inside(tmp_path, vehicle, clock, waits_less)
    running = asyncio.create_task(flight.run())
    await until(lambda: flight.judged is not None)
    vehicle.set_mode("RTL")
    result = await asyncio.wait_for(running, 240.0)
    assert result.problem is not None
    assert "RTL, which is not of this test" in result.problem
    assert vehicle.truth.mode == "RTL"


async def test_two_vehicles_at_the_link_end_the_test_before_anything_is_armed(tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text(SHORT)
    (port,) = free_ports(1)
    vehicles = [FakePx4(HOME, time.time()), FakePx4(HOME, time.time(), system_id=2)]
    servers = [
        VehicleServer(
            one,
            [open_link(f"udpout:127.0.0.1:{port}")],
            ScaledClock(1.0, start_s=one.time_s),
            stream_rate_hz=4.0,
        )
        for one in vehicles
    ]
    flying = [asyncio.create_task(server.run()) for server in servers]
    flight = Flight(Options(load_set(tmp_path / "short.yaml"), f"udpin:127.0.0.1:{port}", tmp_path))
    try:
        result = await flight.run()
    finally:
        for server in servers:
            server.close()
        await asyncio.gather(*flying)
    assert result.problem is not None
    assert "another autopilot is at this link" in result.problem
    assert not any(one.truth.armed for one in vehicles)


async def test_companion_as_a_process_is_started_stalled_and_ended(tmp_path: Path) -> None:
    config = tmp_path / "own.yaml"
    config.write_text("links: [udpin:127.0.0.1:1]\nsupervisor: {role: advise}\nweb: {enabled: true}\n")
    companion = companion_under_test(str(config), tmp_path, None)
    (port,) = free_ports(1)
    await companion.start(port)
    await until(lambda: b"companion" in (tmp_path / "companion.log").read_bytes())
    companion.stall(stalled=True)
    assert not companion.ended
    assert await companion.stop() is None
    assert companion.ended
    assert await companion.stop() is not None, "it had ended by itself"


async def test_a_vehicle_that_is_not_simulated_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Px4Telemetry, "uid", 12345)
    (tmp_path / "short.yaml").write_text(SHORT)
    (port,) = free_ports(1)
    vehicle = FakePx4(HOME, time.time())
    link = open_link(f"udpout:127.0.0.1:{port}")
    server = VehicleServer(vehicle, [link], ScaledClock(1.0, start_s=vehicle.time_s), stream_rate_hz=4.0)
    flying = asyncio.create_task(server.run())
    flight = Flight(Options(load_set(tmp_path / "short.yaml"), f"udpin:127.0.0.1:{port}", tmp_path))
    try:
        with pytest.raises(RealAircraftError, match="no sign of a simulation"):
            await flight.run()
    finally:
        server.close()
        await flying
    assert not vehicle.truth.armed


async def test_a_vehicle_that_cannot_be_reached_is_a_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preparation, "_FOUND_WITHIN_S", 2.0)
    (tmp_path / "short.yaml").write_text(SHORT)
    (port,) = free_ports(1)
    flight = Flight(Options(load_set(tmp_path / "short.yaml"), f"tcpout:127.0.0.1:{port}", tmp_path))
    result = await flight.run()
    assert result.problem == f"no ArduPilot or PX4 at tcpout:127.0.0.1:{port} within 2 s"
    assert not result.passed
