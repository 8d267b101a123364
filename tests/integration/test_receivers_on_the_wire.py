"""Receivers over real sockets, with the service in its own process, and the commands that simulate them."""

import asyncio
import contextlib
import json
import re
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.links import open_link
from companion.sources.registry import new_decoder
from sim.cli.app import app
from sim.clock import ScaledClock
from sim.demo import DemoOptions, fly_demo
from sim.receiver_output import ReceiverOutput
from sim.scenario import load_scenario
from sim.server import VehicleServer
from sim.vehicle import FakeVehicle
from sim.world import build_world
from tests.support.faulty_flight import free_ports
from tests.support.forked import Forked, fork
from tests.support.short_scenario import shorter
from tests.support.thorough import sample

pytestmark = pytest.mark.wire

COMPANION, SIMULATOR = "companion", "sim"
# A head-on conflict that begins at once.
SOON = """\
description: A head-on conflict that begins at once.
duration_s: 120
home: {lat_deg: -35.36, lon_deg: 149.16, altitude_m: 584.0}
mission: {takeoff_height_m: 50, waypoints: [{north_m: 8000, east_m: 0, height_m: 300}]}
start: {where: air, height_m: 300}
intruders: [{icao: A00001, callsign: SOON1, meet_at_s: 40, from_deg: 0, speed_mps: 60}]
"""


@contextlib.asynccontextmanager
async def process(module: str, *arguments: str) -> AsyncIterator[Forked]:
    """One of the two programs with its arguments; killed at the end unless it has ended."""
    running = await fork(*arguments, module=module)
    try:
        yield running
    finally:
        if running.returncode is None:
            running.kill()
            await running.wait()


async def ended_by_a_signal(running: Forked) -> str:
    """The log of a process that ends without an error when it is asked to."""
    running.terminate()
    _, errors = await asyncio.wait_for(running.communicate(), 20.0)
    assert running.returncode == 0, errors.decode()
    assert b"Traceback" not in errors
    return errors.decode()


@contextlib.asynccontextmanager
async def vehicle(scenario: Path, *links: str, beside: str | None = None) -> AsyncIterator[FakeVehicle]:
    """A vehicle in real time whose autopilot hears no traffic; `beside` is a receiver on it."""
    start_s = float(int(time.time()))
    world = build_world(load_scenario(scenario), start_s)
    outputs = [] if beside is None else [ReceiverOutput(*beside.split(":", 1))]
    for output in outputs:
        output.switch_on(world.receiver_of(output.name))
    clock = ScaledClock(1.0, start_s=start_s)
    server = VehicleServer(world.vehicle, [open_link(each) for each in links], clock, beside=outputs)
    running = asyncio.create_task(server.run())
    try:
        yield world.vehicle
    finally:
        server.close()
        await running


async def until_flown(flying: FakeVehicle) -> None:
    async with asyncio.timeout(40.0):
        while not flying.truth.companion_flies:  # noqa: ASYNC110 - a simulated vehicle sets no events
            await asyncio.sleep(0.02)


def files(folder: Path, *links: str) -> tuple[str, Path]:
    """The configuration of the service, and the scenario."""
    config, scenario = folder / "companion.yaml", folder / "soon.yaml"
    config.write_text(f"links: {json.dumps(links)}\nrecording: {{enabled: false}}\n")
    scenario.write_text(SOON)
    return str(config), scenario


async def test_a_lines_receiver_by_tcp_is_heard_by_the_service(tmp_path: Path) -> None:
    to_companion, sbs = free_ports(2)
    config, scenario = files(tmp_path, f"udpin:127.0.0.1:{to_companion}", f"sbs:tcp:127.0.0.1:{sbs}")
    async with (
        process(COMPANION, "run", "--no-web", config) as service,
        vehicle(scenario, f"udpout:127.0.0.1:{to_companion}", beside=f"sbs:tcpin:127.0.0.1:{sbs}") as flying,
    ):
        await until_flown(flying)
        log = await ended_by_a_signal(service)
        assert flying.truth.on_mission
    assert re.search(rf"sbs:tcp:127.0.0.1:{sbs}: \d+ messages, \d+ reports, none bad", log)


async def test_a_receiver_of_another_process_by_udp_is_heard_by_the_service(tmp_path: Path) -> None:
    """The receiver follows the vehicle that the service flies."""
    to_companion, gdl90, position = free_ports(3)
    config, scenario = files(tmp_path, f"udpin:127.0.0.1:{to_companion}", f"gdl90:udpin:127.0.0.1:{gdl90}")
    async with (
        process(COMPANION, "run", "--no-web", config) as service,
        vehicle(
            scenario, f"udpout:127.0.0.1:{to_companion}", f"udpin:127.0.0.1:{position}"
        ) as flying,
        process(
            SIMULATOR, "receiver", "--format", "gdl90", "--link", f"udpout:127.0.0.1:{gdl90}",
            "--vehicle", f"udpout:127.0.0.1:{position}", "--scenario", str(scenario),
        ) as receiver,
    ):  # fmt: skip
        await until_flown(flying)
        said = await ended_by_a_signal(receiver)
        log = await ended_by_a_signal(service)
        assert flying.truth.on_mission
    assert f"a link of Companion that hears it: gdl90:udpin:127.0.0.1:{gdl90}" in said
    assert re.search(rf"gdl90:udpin:127.0.0.1:{gdl90}: \d+ messages, \d+ reports, none bad", log)


async def test_a_receiver_alone_serves_its_document(tmp_path: Path) -> None:
    path = tmp_path / "aircraft.json"
    async with process(
        SIMULATOR, "receiver", "--format", "readsb", "--link", f"file:{path}", "--scenario", "head-on"
    ) as receiver:
        async with asyncio.timeout(40.0):
            while not path.exists():  # noqa: ASYNC110 - another process writes it
                await asyncio.sleep(0.02)
        heard = new_decoder("readsb").feed(await asyncio.to_thread(path.read_bytes), time.time())
        await ended_by_a_signal(receiver)
    assert [fact.report.callsign for fact in heard] == ["HEAD1"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["receiver", "--format", "gdl90", "--link", "udpin:127.0.0.1:1"], "a receiver sends: use udpout"),
        (["receiver", "--format", "gdl90", "--link", "udpout:127.0.0.1:4000", "--vehicle", "x"], "--vehicle"),
        (["vehicle", "--link", "udpout:127.0.0.1:1", "--receiver", "adsb"], "use FORMAT:ADDRESS"),
        (["receiver", "--format", "asterix", "--link", "udpout:127.0.0.1:1"], "asterix"),
    ],
)
def test_a_wrong_receiver_is_one_line(arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code != 0
    assert words in f"{result.output}{result.exception}"


@pytest.mark.parametrize("name", sample(["remoteid"], ["readsb", "remoteid"]))
async def test_the_demo_with_a_receiver(name: str, tmp_path: Path) -> None:
    """Formats that others do not test on a socket: a document, and MAVLink on a link of its own."""
    options = DemoOptions(shorter("head-on"), speedup=20.0, receiver=name, record=tmp_path)
    state = await asyncio.wait_for(fly_demo(options), 200.0)
    assert state.passed
    assert state.resumed
    report = state.report()
    assert report["receiver"] == name
    (encounter,) = report["encounters"]  # type: ignore[misc]
    assert not encounter["nmac"]
    assert encounter["lowc"] == (name == "remoteid")
