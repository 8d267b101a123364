"""`companion-sim flight-test` as a user runs it, on the bundled fake; the ground station is MAVSDK."""

import asyncio
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from companion.errors import LinkError
from companion.geodesy import GeoPoint
from companion.links import open_link
from companion.mavlink.tlog import read_tlog
from sim.clock import ScaledClock
from sim.server import VehicleServer
from sim.vehicle import FakePx4
from sim.vehicle.px4.telemetry import Px4Telemetry
from tests.support.faulty_flight import free_ports

pytest.importorskip("mavsdk", reason="MAVSDK's library cannot be loaded on this platform")

from sim.flight_test.flight import Flight, Options
from sim.flight_test.plan import load_set
from sim.flight_test.safety import RealAircraftError

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
    meets_s: 60
    lasts_s: 10
    intruders: [{speed_mps: 60, miss_m: 50}]
  - name: pilot takes it
    meets_s: 60
    lasts_s: 5
    intruders: [{speed_mps: 55, miss_height_m: 80}]
    actions:
      - {when: taken over, after_s: 3, mode: hold, claims: true}
      - {when: last, after_s: 8, mode: mission}
    expect: {back: null, mode: LOITER}
"""
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
    refused = flight_test(tmp_path, *options)
    assert refused.returncode == 2, refused.stderr
    assert words in refused.stderr


async def test_a_vehicle_that_is_not_simulated_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Px4Telemetry, "uid", 12345)
    (tmp_path / "short.yaml").write_text(SHORT)
    (port,) = free_ports(1)
    vehicle = FakePx4(GeoPoint(47.39, 8.54, 489.0), time.time())
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


async def test_a_vehicle_that_cannot_be_reached_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text(SHORT)
    (port,) = free_ports(1)
    flight = Flight(Options(load_set(tmp_path / "short.yaml"), f"tcpout:127.0.0.1:{port}", tmp_path))
    with pytest.raises(LinkError):
        await flight.run()
