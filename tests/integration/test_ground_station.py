"""Settings and commands as ground stations handle them: MAVSDK's library and pymavlink's, over real UDP."""

import asyncio
import contextlib
import re
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from companion.control.state_machine import State
from companion.engine import Engine, EngineConfig, EngineParams
from companion.gcs.parameters import GCS_PARAMETERS
from companion.gcs.requests import GcsRequests
from companion.links import open_link
from companion.links.udp import UdpLink
from companion.mavlink.dialect import mavlink
from companion.recording.state_file import DurableStateFile
from companion.runtime import Runtime
from sim.clock import ScaledClock
from sim.files import checked_from
from sim.scenario import Scenario
from sim.server import VehicleServer
from sim.world import build_world
from tests.integration.test_loop_over_udp import SOON
from tests.support.commands import call
from tests.support.faulty_flight import free_ports

pytest.importorskip("mavsdk", reason="MAVSDK's library cannot be loaded on this platform")

from mavsdk import Configuration
from mavsdk.asyncio import Mavsdk
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.param import ParamError, ProtocolVersion

pytestmark = pytest.mark.wire

PATIENCE_S = 15.0
# The manoeuvre, and where the aircraft ahead is.
_CHANGE = r"((CLIMB|DESCEND)(( to)? \d+ m)?|(LEFT|RIGHT) \d{3}|(SLOWER|FASTER)( \d+ m/s)?)"
CONFLICT = rf"(Advise )?(HOLD|{_CHANGE}(, {_CHANGE})*)[:!] SOON1( 12 o'clock)? \d\.\d km( level)?"
US = 196
DEFAULTS = {tunable.name: tunable.value(EngineConfig()) for tunable in GCS_PARAMETERS}


# --- pymavlink's mavutil, as MAVProxy and many scripts use it; it blocks, so that it gets a thread


class Client:
    """A ground station's view of the companion."""

    def __init__(self, port: int) -> None:
        self.master = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", 255, 190)
        self.texts: list[str] = []
        self.master.target_system, self.master.target_component = 1, US

    def beat(self) -> None:
        self.master.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def wait(self, kind: str, wanted: Callable[[Any], bool] = lambda _: True) -> Any:
        """The next such message of the companion."""
        until_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s:
            message = self.master.recv_match(blocking=True, timeout=0.5)
            if message is None or message.get_srcComponent() != US:
                self.beat()
                continue
            if message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)
            if message.get_type() == kind and wanted(message):
                return message
        raise AssertionError(f"no {kind}")

    def everything(self) -> dict[str, float]:
        self.master.param_fetch_all()
        found = {}
        while len(found) < len(GCS_PARAMETERS):
            message = self.wait("PARAM_VALUE")
            assert message.param_count == len(GCS_PARAMETERS)
            assert GCS_PARAMETERS[message.param_index].name == message.param_id
            found[message.param_id] = message.param_value
        return found

    def put(self, name: str, value: float) -> float:
        """What the answer says."""
        self.master.param_set_send(name, value)
        answer: float = self.wait("PARAM_VALUE", lambda message: message.param_id == name).param_value
        return answer

    def read(self, name: str) -> float:
        self.master.param_fetch_one(name)
        value: float = self.wait("PARAM_VALUE", lambda message: message.param_id == name).param_value
        return value

    def command(self, command: int, *params: float) -> int:
        self.master.mav.command_long_send(1, US, command, 0, *params, *[0.0] * (7 - len(params)))
        result: int = self.wait("COMMAND_ACK", lambda message: message.command == command).result
        return result

    def close(self) -> None:
        self.master.close()


@contextmanager
def client(port: int) -> Iterator[Client]:
    station = Client(port)
    try:
        yield station
    finally:
        station.close()


def configured(folder: Path, port: int) -> Path:
    path = folder / "companion.yaml"
    path.write_text(
        f"links: [udpin:127.0.0.1:{port}]\nrecording: {{enabled: false}}\n"
        f"web: {{enabled: false}}\nstate_file: {folder / 'state'}\nsettings_file: {folder / 'settings'}\n"
    )
    return path


@contextmanager
def running(config: Path) -> Iterator[subprocess.Popen[str]]:
    words = [sys.executable, "-m", "companion", "run", str(config)]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    process.stderr.readline()  # it listens
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        process.communicate(timeout=PATIENCE_S)


def check(config: Path) -> str:
    done = call("check", str(config))
    assert done.returncode == 0
    return done.stdout


def test_settings_outlast_the_companion_that_is_killed(tmp_path: Path) -> None:
    port = free_ports(1)[0]
    config, saved = configured(tmp_path, port), tmp_path / "settings"
    with running(config) as process, client(port) as station:
        assert station.everything() == pytest.approx(DEFAULTS, rel=1e-6)
        assert station.put("CA_OUTER_TIME", 45.0) == 45.0
        assert station.put("CA_OUTER_TIME", 500.0) == 45.0
        assert "CA_OUTER_TIME 500 refused: 10 to 80 s" in station.texts
        assert station.put("CA_MARGIN_H", 0.3) == pytest.approx(0.3, rel=1e-6)
        patient_until_s = time.monotonic() + PATIENCE_S  # a busy disk writes late
        while not (saved.exists() and "CA_MARGIN_H" in saved.read_text()):
            assert time.monotonic() < patient_until_s
            station.read("CA_ROLE")
        process.send_signal(signal.SIGKILL)
    assert "CA_OUTER_TIME 45 s instead of 60 s: avoidance.outer_time_s" in check(config)
    saved.write_text(saved.read_text().replace("{", '{"CA_OLD": 3,', 1))
    with running(config) as process, client(port) as station:
        now = {**DEFAULTS, "CA_OUTER_TIME": 45.0, "CA_MARGIN_H": 0.3}
        assert station.everything() == pytest.approx(now, rel=1e-6)
        assert station.put("CA_OUTER_TIME", 60.0) == 60.0
        assert station.put("CA_MARGIN_H", DEFAULTS["CA_MARGIN_H"]) == pytest.approx(0.15, rel=1e-6)
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
        assert process.stderr is not None
        said = process.stderr.read()
    assert f"{saved}: not used: CA_OLD: unknown" in said
    assert f"{saved}: CA_OUTER_TIME 45 s instead of 60 s" in said
    assert "CA_OUTER_TIME 60 s, was 45" in said
    assert not saved.exists(), "as it is configured"


def test_a_damaged_file_of_settings_does_not_keep_it_from_starting(tmp_path: Path) -> None:
    port = free_ports(1)[0]
    config = configured(tmp_path, port)
    (tmp_path / "settings").write_bytes(b"\0" * 512)
    assert "damaged, not used" in check(config)
    with running(config) as process, client(port) as station:
        assert station.read("CA_OUTER_TIME") == 60.0
        assert station.put("CA_OUTER_TIME", 45.0) == 45.0
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
    assert '"CA_OUTER_TIME": 45.0' in (tmp_path / "settings").read_text()


# --- in flight


@asynccontextmanager
async def in_flight(tmp_path: Path) -> AsyncIterator[tuple[Runtime, VehicleServer, int, int]]:
    """A companion between a vehicle with traffic ahead and a ground station; the ports of both."""
    clock = ScaledClock(4.0)
    world = build_world(checked_from(SOON, Scenario, "soon"), clock.now_s())
    vehicle_link, station_link = open_link("udpin:127.0.0.1:0"), open_link("udpin:127.0.0.1:0")
    for link in (vehicle_link, station_link):
        assert isinstance(link, UdpLink)
        await link.open()
    server = VehicleServer(world.vehicle, [vehicle_link], clock, receiver=world.receiver)
    ours = open_link(f"udpout:127.0.0.1:{vehicle_link.local_port}")
    runtime = Runtime(
        Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1))),
        [ours, station_link],
        clock=clock,
        settings=DurableStateFile(tmp_path / "settings"),
    )
    tasks = [asyncio.create_task(server.run()), asyncio.create_task(runtime.run())]
    try:
        yield runtime, server, vehicle_link.local_port, station_link.local_port
    finally:
        runtime.stop()
        await tasks[1]
        server.close()
        await tasks[0]
    assert station_link.counters.bad_bytes == 0


async def until(so: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not so():  # noqa: ASYNC110 - the engine sets no events
            await asyncio.sleep(0.02)


async def test_the_mission_is_resumed_and_the_role_changed_by_commands(tmp_path: Path) -> None:
    async with in_flight(tmp_path) as (runtime, _, _, port):
        with client(port) as station:
            resume = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
            denied = await asyncio.to_thread(station.command, resume, 1.0)
            assert denied == mavlink.MAV_RESULT_DENIED
            await until(lambda: runtime.engine.supervisor.flying)
            text = await asyncio.to_thread(station.wait, "STATUSTEXT", lambda m: "SOON1" in m.text)
            assert re.fullmatch(CONFLICT, text.text)
            collision = await asyncio.to_thread(station.wait, "COLLISION")
            assert collision.id == 0xA00001
            done = await asyncio.to_thread(station.command, resume, 1.0)
            assert done == mavlink.MAV_RESULT_ACCEPTED
            await until(lambda: runtime.engine.supervisor.state is State.MONITOR)
            assert runtime.engine.aircraft.mode == "AUTO"
            again = await asyncio.to_thread(station.command, resume, 1.0)
            assert again == mavlink.MAV_RESULT_ACCEPTED
            mode = mavlink.MAV_CMD_DO_SET_MODE
            assert await asyncio.to_thread(station.command, mode, 1.0, 1.0) == mavlink.MAV_RESULT_ACCEPTED
            beat = await asyncio.to_thread(station.wait, "HEARTBEAT", lambda m: m.custom_mode == 1)
            assert beat.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER


async def test_mavsdk_lists_reads_and_sets_them(tmp_path: Path) -> None:
    async with (
        in_flight(tmp_path) as (runtime, _, vehicle_port, port),
        Mavsdk(Configuration.create_manual(245, 190, True)) as station,
    ):
        await station.add_any_connection(f"udpout://127.0.0.1:{vehicle_port}")
        await station.add_any_connection(f"udpout://127.0.0.1:{port}")
        system = await station.first_autopilot(timeout_s=PATIENCE_S)
        assert system is not None
        async with asyncio.timeout(PATIENCE_S):
            while US not in await system.component_ids():  # noqa: ASYNC110 - it tells nobody
                await asyncio.sleep(0.05)
        await check_settings(ParamAsync(system), runtime.engine.operator)
        async with asyncio.timeout(PATIENCE_S):
            async for status in TelemetryAsync(system).subscribe_status_text():
                if "SOON1" in status.text:
                    break
        assert re.fullmatch(CONFLICT, status.text)


async def check_settings(params: Any, operator: GcsRequests) -> None:
    with contextlib.suppress(ParamError):  # it selects, and answers "unknown" all the same
        await params.select_component(US, ProtocolVersion.V1)
    everything = await params.get_all_params()
    # The autopilot answers our own questions meanwhile, and its parameters may be listed too.
    ours = {p.name: p.value for p in everything.float_params if p.name.startswith("CA_")}
    assert ours == pytest.approx(DEFAULTS, rel=1e-6)
    assert not [p for p in everything.int_params if p.name.startswith("CA_")]
    await params.set_param_float("CA_WC_HORIZ", 700.5)
    assert operator.settings.avoidance.well_clear_horizontal_m == 700.5
    assert await params.get_param_float("CA_WC_HORIZ") == 700.5
    with pytest.raises(ParamError):
        await params.set_param_float("CA_WC_HORIZ", 1e6)
    assert operator.settings.avoidance.well_clear_horizontal_m == 700.5
    assert await params.get_param_float("CA_WC_HORIZ") == 700.5
