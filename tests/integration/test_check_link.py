"""`companion check CONFIG --link` with fake vehicles over UDP: its findings, and that it commands nothing."""

import asyncio
import contextlib
import socket
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from companion.config import Config
from companion.control.state_machine import SupervisorParams
from companion.errors import PORT_IN_USE
from companion.geodesy import GeoPoint
from companion.links import open_link
from companion.mavlink.dialect import Message, mavlink
from companion.preflight import Preflight, run_preflight
from sim.clock import ScaledClock
from sim.server import VehicleServer
from sim.vehicle import FakeArduPlane, FakePx4, FakeVehicle, takeoff_item, waypoint_item
from tests.support.forked import fork
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

HOME = GeoPoint(-35.363261, 149.1652299, 584.1)
IN_THE_AIR = GeoPoint(-35.363261, 149.1652299, 884.1)
MISSION = (takeoff_item(50.0), waypoint_item(GeoPoint(-35.28, 149.1652299, 884.1)))
VEHICLES = [FakeArduPlane, FakePx4]
MISSION_MODE = {FakeArduPlane: "AUTO", FakePx4: "MISSION"}

# Messages that only read, or that every component sends; none of them can command the aircraft.
QUESTIONS = {
    "TIMESYNC",
    "HEARTBEAT",
    "PARAM_REQUEST_READ",
    "MISSION_REQUEST_LIST",
    "MISSION_REQUEST_INT",
    "MISSION_ACK",
    "STATUSTEXT",
}
ASKING_COMMANDS = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextlib.asynccontextmanager
async def talking(
    vehicle: FakeVehicle, port: int, clock: ScaledClock, stream_rate_hz: float = 2.0
) -> AsyncIterator[list[Message]]:
    """Run the vehicle at the other end of the link; returns the messages that it receives."""
    heard: list[Message] = []
    receive = vehicle.receive

    def listen(message: Message, now_s: float, channel: int = 0) -> None:
        heard.append(message)
        receive(message, now_s, channel)

    vehicle.receive = listen  # type: ignore[method-assign]
    link = open_link(f"udpout:127.0.0.1:{port}")
    server = VehicleServer(vehicle, [link], clock, stream_rate_hz=stream_rate_hz)
    running = asyncio.create_task(server.run())
    try:
        yield heard
    finally:
        server.close()
        await running


async def preflight(
    vehicle: FakeVehicle,
    seconds: float,
    supervisor: SupervisorParams | None = None,
    *,
    stream_rate_hz: float = 2.0,
) -> tuple[Preflight, dict[str, str], list[Message]]:
    """The findings after this simulated time, also by topic, and the messages that the vehicle received."""
    loop = asyncio.get_running_loop()
    port, clock = free_port(), ScaledClock(1.0, start_s=vehicle.time_s, monotonic_s=loop.time)
    config = Config((f"udpin:127.0.0.1:{port}",), supervisor=supervisor or SupervisorParams())
    async with talking(vehicle, port, clock, stream_rate_hz) as heard:
        found = await run_preflight(config, [open_link(config.links[0])], seconds, clock)
    return found, {finding.topic: finding.text for finding in found.findings}, heard


def in_the_air(kind: type[FakeArduPlane] | type[FakePx4], **options: Any) -> FakeVehicle:
    return kind.airborne(
        HOME, now_s(), position=IN_THE_AIR, course_rad=0.0, sequence=kind.first_item + 1,
        mission=MISSION, **options,
    )  # fmt: skip


def now_s() -> float:
    return float(int(time.time()))


async def check(folder: Path, port: int, seconds: float, more: str = "") -> tuple[int, list[str], str]:
    """Run the command as a process, with `more` configuration: exit code, lines, errors."""
    config = folder / "c.yaml"
    config.write_text(f"links: [udpin:127.0.0.1:{port}]\n{more}")
    process = await fork("check", str(config), "--link", "--seconds", str(seconds), folder=folder)
    try:
        out, errors = await asyncio.wait_for(process.communicate(), 60.0)
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert process.returncode is not None
    return process.returncode, out.decode().splitlines(), errors.decode()


def is_command(message: Message) -> bool:
    if message.get_type() in ("COMMAND_LONG", "COMMAND_INT"):
        return message.command not in ASKING_COMMANDS
    return message.get_type() not in QUESTIONS


@pytest.mark.parametrize("kind", VEHICLES)
@in_virtual_time
async def test_on_the_ground_it_reports_why_it_would_not_fly(
    kind: type[FakeArduPlane] | type[FakePx4],
) -> None:
    found, said, _ = await preflight(kind(HOME, now_s(), mission=MISSION), 4.0)
    assert found.heard
    assert said["mode"] == "MANUAL, disarmed"
    assert said["rates"] == "not measured: listen longer"
    assert found.reasons_not_to_fly == (
        "it is disarmed",
        "it is landing or on the ground",
        "its mode is MANUAL, not AUTO or MISSION",
    )


@in_virtual_time
async def test_armed_on_the_ground_it_reports_the_minimum_height() -> None:
    vehicle = FakeArduPlane(HOME, now_s(), mission=MISSION)
    vehicle.arm()
    found, _, _ = await preflight(vehicle, 4.0)
    assert "it is 0 m above home, below 30 m" in found.reasons_not_to_fly


@pytest.mark.parametrize("kind", VEHICLES)
@in_virtual_time
async def test_in_the_air_it_would_fly_but_commands_nothing(
    kind: type[FakeArduPlane] | type[FakePx4],
) -> None:
    found, said, heard = await preflight(in_the_air(kind), 12.0)
    assert found.reasons_not_to_fly == ()
    assert said["mode"] == f"{MISSION_MODE[kind]}, armed"
    assert said["autopilot"].startswith(kind.name)
    assert said["position"].startswith("300 m above home, ")
    assert said["rate GLOBAL_POSITION_INT"].endswith("10.0 Hz requested")
    assert said["mission"] == f"{len(MISSION) + kind.first_item} items"
    assert said["other avoidance"] == "not active"
    limits = [finding.text for finding in found.findings if finding.topic == "limit"]
    assert any("(AIRSPEED_MIN" in text or "(FW_AIRSPD_MIN" in text for text in limits)
    assert heard
    assert [message for message in heard if is_command(message)] == []


@in_virtual_time
async def test_it_would_not_fly_beside_another_active_avoidance() -> None:
    found, said, _ = await preflight(in_the_air(FakePx4, parameters={"NAV_TRAFF_AVOID": 2}), 10.0)
    what_to_do = "set it to warn only, or supervisor.beside_other_avoider to fly"
    assert said["other avoidance"] == f"NAV_TRAFF_AVOID 2 acts: {what_to_do}"
    assert said["traffic settings"] == "NAV_TRAFF_AVOID 2"
    assert said["flown in"] == "OFFBOARD"
    conditions = [finding.text for finding in found.findings if finding.topic == "condition"]
    assert set(conditions) >= {
        "COM_OBL_RC_ACT 0: set 5 (Hold)",
        "autopilot avoids too (NAV_TRAFF_AVOID 2), advising only",
    }
    assert found.reasons_not_to_fly == ("another avoider acts: NAV_TRAFF_AVOID 2",)


@in_virtual_time
async def test_px4_1_18_is_flown_in_guided_course_unless_its_own_avoidance_acts() -> None:
    found, said, heard = await preflight(in_the_air(FakePx4, firmware="1.18"), 12.0)
    assert found.reasons_not_to_fly == ()
    assert said["autopilot"].startswith("PX4 1.18.0alpha")
    assert said["flown in"] == "GUIDED_COURSE"
    assert said["other avoidance"] == "not active"
    assert said["traffic settings"] == (
        "NAV_TRAFF_AVOID 1, DAA_EN 1, DAA_LVL_CRIT_ACT 1, DAA_LVL_HIGH_ACT 1, DAA_LVL_MED_ACT 1, "
        "DAA_LVL_LOW_ACT 1, COM_TRAFF_AVOID 0"
    )
    assert [message for message in heard if is_command(message)] == []
    acting = {"DAA_LVL_MED_ACT": 4, "COM_TRAFF_AVOID": 3}
    found, said, _ = await preflight(in_the_air(FakePx4, firmware="1.18", parameters=acting), 12.0)
    assert found.reasons_not_to_fly == ("another avoider acts: DAA_LVL_MED_ACT 4",)
    assert said["other avoidance"].startswith("DAA_LVL_MED_ACT 4 acts: set it to warn only")
    conditions = [finding.text for finding in found.findings if finding.topic == "condition"]
    assert "COM_TRAFF_AVOID 3: returns home without receiver heartbeats" in conditions


@in_virtual_time
async def test_a_requested_message_that_never_arrives_has_a_rate_of_zero() -> None:
    vehicle = in_the_air(FakeArduPlane)
    vehicle.refuse(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_RESULT_DENIED)
    _, said, _ = await preflight(vehicle, 8.0, stream_rate_hz=0.0)
    assert said["rate GPS_RAW_INT"] == "0.0 Hz, 1.0 Hz requested"


@in_virtual_time
async def test_it_would_not_fly_with_the_role_advise() -> None:
    found, said, _ = await preflight(in_the_air(FakeArduPlane), 3.0, SupervisorParams(role="advise"))
    assert said["role"] == "advise"
    assert found.reasons_not_to_fly == ("role is advise",)


async def test_the_command_prints_all_findings_and_no_log(tmp_path: Path) -> None:
    vehicle, port = in_the_air(FakePx4), free_port()
    async with talking(vehicle, port, ScaledClock(1.0, start_s=vehicle.time_s)):
        code, lines, errors = await check(tmp_path, port, 6.0)
    assert code == 0
    assert any(line.startswith("autopilot") and "PX4 1.16.0, system 1, fixed wing" in line for line in lines)
    assert lines[-1] == "would fly: in a conflict it takes over the aircraft"
    assert errors == ""


async def test_files_that_cannot_be_written_are_findings_and_count(tmp_path: Path) -> None:
    vehicle, port = in_the_air(FakePx4), free_port()
    more = f"state_file: {tmp_path}/nowhere/state\n"
    async with talking(vehicle, port, ScaledClock(1.0, start_s=vehicle.time_s)):
        code, lines, errors = await check(tmp_path, port, 6.0, more)
    assert code == 2
    listed = [" ".join(line.split()) for line in lines]
    why = f"there is no folder {tmp_path}/nowhere"
    place = f"{tmp_path}/c.yaml:2: state_file: {tmp_path}/nowhere/state"
    assert f"storage {place} cannot be written: {why}" in listed
    assert errors == f"{tmp_path}/c.yaml: cannot be written: state_file\n"


async def test_without_an_autopilot_the_command_fails_with_one_line(tmp_path: Path) -> None:
    code, lines, errors = await check(tmp_path, free_port(), 3.0)
    assert code == 1
    assert "autopilot none heard" in [" ".join(line.split()) for line in lines]
    assert errors == "would not fly: no autopilot heard\n"


async def test_a_port_in_use_is_one_line(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        code, _, errors = await check(tmp_path, port, 3.0)
    assert code == 1
    assert errors == f"udpin:127.0.0.1:{port}: {PORT_IN_USE}\n"
