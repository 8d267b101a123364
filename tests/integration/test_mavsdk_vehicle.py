"""The fake vehicles against an independent MAVLink implementation: MAVSDK's library, over real UDP."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, TypeVar

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.links import open_link
from companion.links.udp import UdpLink
from sim.clock import ScaledClock
from sim.server import VehicleServer
from sim.vehicle import FakeArduPlane, FakePx4, FakeVehicle
from sim.vehicle.fence import INCLUSION_VERTEX
from sim.vehicle.mission import NAV_TAKEOFF, NAV_WAYPOINT

mavsdk = pytest.importorskip("mavsdk", reason="MAVSDK's library cannot be loaded on this platform")

from mavsdk import Configuration  # noqa: E402
from mavsdk.asyncio import Mavsdk  # noqa: E402
from mavsdk.asyncio.plugins.action import ActionAsync  # noqa: E402
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync  # noqa: E402
from mavsdk.asyncio.plugins.param import ParamAsync  # noqa: E402
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync  # noqa: E402
from mavsdk.plugins.mission_raw import MissionItem  # noqa: E402
from mavsdk.plugins.telemetry import FlightMode  # noqa: E402

pytestmark = pytest.mark.wire

HOME = GeoPoint(-35.363261, 149.1652299, 584.1)
SPEEDUP = 10.0
PATIENCE_S = 15.0  # real seconds, ten times the time on a loaded machine

T = TypeVar("T")


async def wait_for(values: AsyncIterator[T], wanted: Callable[[T], bool] = lambda _: True) -> T:
    async with asyncio.timeout(PATIENCE_S):
        async for value in values:
            if wanted(value):
                return value
    raise AssertionError("the stream ended")


def item(
    sequence: int,
    command: int,
    north_m: float,
    east_m: float,
    height_m: float,
    frame: int = 3,
    kind: int = 0,
    first: float = 0.0,
) -> Any:
    place = LocalFrame(HOME.lat_deg, HOME.lon_deg).to_geo(north_m, east_m, 0.0)
    return MissionItem(
        seq=sequence,
        frame=frame,
        command=command,
        current=int(sequence == 0),
        autocontinue=1,
        x=round(place.lat_deg * 1e7),
        y=round(place.lon_deg * 1e7),
        z=height_m,
        param1=first,
        mission_type=kind,
    )


MISSION = [
    item(0, NAV_WAYPOINT, 0.0, 0.0, HOME.altitude_m, frame=0),
    item(1, NAV_TAKEOFF, 0.0, 0.0, 60.0),
    item(2, NAV_WAYPOINT, 500.0, 0.0, 100.0),
    item(3, NAV_WAYPOINT, 4000.0, 500.0, 100.0),
]
# PX4 has no home item.
PX4_MISSION = [
    item(0, NAV_TAKEOFF, 0.0, 0.0, 60.0, frame=6),
    item(1, NAV_WAYPOINT, 500.0, 0.0, 100.0, frame=6),
    item(2, NAV_WAYPOINT, 4000.0, 500.0, 100.0, frame=6),
]
FENCE = [
    item(number, INCLUSION_VERTEX, north_m, east_m, 0.0, kind=1, first=4.0)
    for number, (north_m, east_m) in enumerate([(-5e3, -5e3), (-5e3, 5e3), (9e3, 5e3), (9e3, -5e3)])
]


@asynccontextmanager
async def connected(vehicle: FakeVehicle, clock: ScaledClock) -> AsyncIterator[Any]:
    """MAVSDK's view of a vehicle; at the end, MAVSDK must have sent no bad bytes."""
    link = open_link("udpin:127.0.0.1:0")
    assert isinstance(link, UdpLink)
    await link.open()
    server = VehicleServer(vehicle, [link], clock)
    flying = asyncio.create_task(server.run())
    try:
        configuration = Configuration.create_manual(245, 190, True)
        async with Mavsdk(configuration) as client:
            await client.add_any_connection(f"udpout://127.0.0.1:{link.local_port}")
            system = await client.first_autopilot(timeout_s=PATIENCE_S)
            assert system is not None
            yield system
    finally:
        server.close()
        await flying
    assert link.counters.bad_bytes == 0
    assert link.counters.undecodable == 0


async def test_mavsdk_reads_uploads_arms_and_flies_a_mission() -> None:
    clock = ScaledClock(SPEEDUP)
    vehicle = FakeArduPlane(HOME, clock.now_s())
    async with connected(vehicle, clock) as system:
        await check_telemetry(TelemetryAsync(system), FlightMode.MANUAL)
        await check_upload(MissionRawAsync(system), vehicle, MISSION)
        await check_flight(system, vehicle, "AUTO", "RTL")


async def test_mavsdk_does_the_same_with_a_px4() -> None:
    clock = ScaledClock(SPEEDUP)
    vehicle = FakePx4(HOME, clock.now_s(), parameters={"FW_AIRSPD_TRIM": 20.0})
    async with connected(vehicle, clock) as system:
        await check_telemetry(TelemetryAsync(system), FlightMode.MANUAL)
        await check_parameters(ParamAsync(system), vehicle)
        await check_upload(MissionRawAsync(system), vehicle, PX4_MISSION)
        await check_flight(system, vehicle, "MISSION", "RETURN")
        await check_hold(system, vehicle)


async def check_parameters(params: Any, vehicle: FakePx4) -> None:
    """MAVSDK too encodes integers as the bytes of the float."""
    assert await params.get_param_int("SYS_AUTOSTART") == 2100
    await params.set_param_int("COM_OBL_RC_ACT", 5)
    await params.set_param_float("FW_R_LIM", 40.5)
    assert vehicle.parameters["COM_OBL_RC_ACT"] == 5.0
    assert vehicle.parameters["FW_R_LIM"] == 40.5
    everything = await params.get_all_params()
    assert len(everything.int_params) + len(everything.float_params) == len(vehicle.parameters)


async def check_hold(system: Any, vehicle: FakePx4) -> None:
    await ActionAsync(system).hold()
    await wait_for(TelemetryAsync(system).subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD)
    assert vehicle.truth.mode == "HOLD"


async def check_telemetry(telemetry: Any, mode: Any) -> None:
    position = await wait_for(telemetry.subscribe_position())
    assert position.latitude_deg == pytest.approx(HOME.lat_deg, abs=1e-6)
    assert position.longitude_deg == pytest.approx(HOME.lon_deg, abs=1e-6)
    assert position.absolute_altitude_m == pytest.approx(HOME.altitude_m, abs=0.1)
    assert position.relative_altitude_m == pytest.approx(0.0, abs=0.1)
    assert await wait_for(telemetry.subscribe_flight_mode()) == mode
    battery = await wait_for(telemetry.subscribe_battery())
    assert 80.0 < battery.remaining_percent <= 100.0
    assert 11.0 < battery.voltage_v < 13.0
    assert not await wait_for(telemetry.subscribe_armed())


async def check_upload(missions: Any, vehicle: FakeVehicle, items: list[Any]) -> None:
    await missions.upload_mission(items)
    assert [i.command for i in vehicle.flight.mission.items] == [i.command for i in items]
    downloaded = await missions.download_mission()
    first = vehicle.first_item
    assert [(i.seq, i.command, i.x, i.y, i.z) for i in downloaded[first:]] == [
        (i.seq, i.command, i.x, i.y, pytest.approx(i.z)) for i in items[first:]
    ]
    await missions.upload_geofence(FENCE)
    assert [i.command for i in vehicle.flight.fence.items] == [i.command for i in FENCE]
    assert [(i.command, i.x, i.y) for i in await missions.download_geofence()] == [
        (i.command, i.x, i.y) for i in FENCE
    ]


async def check_flight(system: Any, vehicle: FakeVehicle, flying: str, homeward: str) -> None:
    telemetry, missions, action = TelemetryAsync(system), MissionRawAsync(system), ActionAsync(system)
    await action.arm()
    await missions.start_mission()
    await wait_for(telemetry.subscribe_armed(), lambda armed: armed)
    await wait_for(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.MISSION)
    assert vehicle.truth.mode == flying
    await wait_for(telemetry.subscribe_in_air(), lambda in_air: in_air)
    await wait_for(
        missions.subscribe_mission_progress(), lambda progress: progress.current >= vehicle.first_item + 2
    )
    position = await wait_for(telemetry.subscribe_position(), lambda p: p.relative_altitude_m > 60.0)
    assert position.latitude_deg > HOME.lat_deg
    await action.return_to_launch()
    await wait_for(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.RETURN_TO_LAUNCH)
    assert vehicle.truth.mode == homeward
