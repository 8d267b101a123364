"""Traffic of receivers on the wire: sent to the autopilot or to a station, and read by pymavlink."""

import asyncio
import contextlib
import math
import socket
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from companion.config import Config
from companion.engine import Engine, EngineConfig, EngineParams
from companion.geodesy import GeoPoint
from companion.links import memory_pair, open_links
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.tlog import read_tlog
from companion.preflight import run_preflight
from companion.recording.recorder import Recorder
from companion.replay import replay
from companion.runtime import Runtime
from companion.traffic import TrafficParams
from companion.traffic.params import Forward
from sim.clock import ScaledClock
from sim.receivers import Reception, Transmission
from sim.receivers.flarm import sentence
from sim.receivers.gdl90 import Gdl90Encoder
from sim.server import VehicleServer
from sim.traffic import ALL_VALID
from sim.vehicle import FakeArduPlane, FakePx4, FakeVehicle, takeoff_item, waypoint_item
from tests.support.faulty_flight import free_ports
from tests.support.talking_autopilot import Autopilot
from tests.support.virtual_time import in_virtual_time

pytestmark = pytest.mark.wire

HOME = GeoPoint(-35.363261, 149.1652299, 584.1)
IN_THE_AIR = GeoPoint(-35.363261, 149.1652299, 884.1)
MISSION = (takeoff_item(50.0), waypoint_item(GeoPoint(-35.20, 149.1652299, 884.1)))
ICAO, ADSB = 0xA00001, mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE
SECONDS = 9.0


class Station:
    """pymavlink's mavutil at one end; it blocks, so that it reads in a thread."""

    def __init__(self, address: str) -> None:
        self._master = mavutil.mavlink_connection(address, 255, 190)
        self.heard: list[Any] = []
        self._open = True

    def ask_for_traffic(self) -> None:
        self._master.mav.command_long_send(1, 1, 511, 0, ADSB, 200_000, 0, 0, 0, 0, 0)

    def read(self) -> None:
        asked_s = 0.0
        while self._open:
            if time.monotonic() - asked_s > 1.0:
                asked_s = time.monotonic()
                self._master.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
                if not self.of("ADSB_VEHICLE", 1):
                    self.ask_for_traffic()
            message = self._master.recv_match(blocking=True, timeout=0.1)
            if message is not None:
                self.heard.append(message)
        self._master.close()

    def close(self) -> None:
        self._open = False

    def of(self, kind: str, component: int) -> list[Any]:
        return [m for m in self.heard if m.get_type() == kind and m.get_srcComponent() == component]


@dataclass
class Setting:
    runtime: Runtime
    vehicle: FakeVehicle
    beside: Station  # on a link of ours
    behind: Station  # at the autopilot
    received: list[Any]  # by the autopilot


def _transmission(seconds: float) -> Transmission:
    """An aircraft that passes far in front of us, from the east."""
    place = GeoPoint(-35.31, 149.20 - seconds * 50.0 / 90_700.0, 1400.0)
    return Transmission(ICAO, "GDL1", place, 1400.0, (0.0, -50.0, 0.0))


async def _receivers(gdl90_port: int, flarm_port: int, clock: ScaledClock) -> None:
    encoder, began_s = Gdl90Encoder(), clock.now_s()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        while True:
            now_s = clock.now_s()
            for data in encoder.encode(Reception(now_s, [_transmission(now_s - began_s)])):
                radio.sendto(data, ("127.0.0.1", gdl90_port))
            north_m = 6000.0 - 60.0 * (now_s - began_s)
            lines = (
                "PFLAU,1,1,2,1,0,,0,,,",
                f"PFLAA,0,{north_m:.0f},-2500,200,2,DD1234,180,,40,0.0,1,0,1,-70",
            )
            radio.sendto(b"".join(map(sentence, lines)), ("127.0.0.1", flarm_port))
            await asyncio.sleep(1.0)


@contextlib.asynccontextmanager
async def setting(
    kind: type[FakeArduPlane] | type[FakePx4], forward: Forward, folder: Path | None = None
) -> AsyncIterator[Setting]:
    start_s = float(int(time.time()))
    vehicle = kind.airborne(
        HOME, start_s, position=IN_THE_AIR, course_rad=0.0, sequence=kind.first_item + 1, mission=MISSION
    )
    received: list[Any] = []
    receive = vehicle.receive

    def listen(message: Any, now_s: float, channel: int = 0) -> None:
        received.append(message)
        receive(message, now_s, channel)

    vehicle.receive = listen  # type: ignore[method-assign]
    clock = ScaledClock(1.0, start_s=start_s)
    ours, beside_port, behind_port, gdl90_port, flarm_port = free_ports(5)
    config = Config(
        (
            f"udpin:127.0.0.1:{ours}",
            f"udpin:127.0.0.1:{beside_port}",
            f"gdl90:udpin:127.0.0.1:{gdl90_port}",
            f"flarm:udpin:127.0.0.1:{flarm_port}",
        ),
        traffic=TrafficParams(forward=forward),
    )
    links, receivers = open_links(config.links)
    recorder = None if folder is None else Recorder(folder, start_s)
    runtime = Runtime(Engine(config.for_engine()), links, receivers=receivers, recorder=recorder, clock=clock)
    behind = Station(f"udpin:127.0.0.1:{behind_port}")
    beside = Station(f"udpout:127.0.0.1:{beside_port}")
    vehicle_links = open_links([f"udpout:127.0.0.1:{ours}", f"udpout:127.0.0.1:{behind_port}"])[0]
    server = VehicleServer(vehicle, vehicle_links, clock)
    running = asyncio.create_task(runtime.run())
    others = [
        asyncio.create_task(server.run()),
        asyncio.create_task(_receivers(gdl90_port, flarm_port, clock)),
        *(asyncio.create_task(asyncio.to_thread(station.read)) for station in (behind, beside)),
    ]
    try:
        yield Setting(runtime, vehicle, beside, behind, received)
        runtime.stop()
        await asyncio.wait_for(running, 20.0)
    finally:
        running.cancel()
        server.close()
        behind.close()
        beside.close()
        others[1].cancel()
        await asyncio.gather(running, *others, return_exceptions=True)


def check_reports(reports: list[Any], seconds: float) -> None:
    """Both aircraft, once a second, rightly marked."""
    by_icao: dict[int, list[Any]] = {}
    for one in reports:
        by_icao.setdefault(one.ICAO_address, []).append(one)
    assert len(by_icao) == 2
    (made_up,) = by_icao.keys() - {ICAO}
    assert 0xB00000 <= made_up <= 0xBFFFFF
    for each in by_icao.values():
        assert seconds / 2 <= len({(one.lat, one.lon) for one in each}) <= seconds + 2
        assert all(one.tslc <= 3 for one in each)
        assert each[-1].flags & 0b1000_1111 == 0b1000_1111
    known, flarm = by_icao[ICAO][-1], by_icao[made_up][-1]
    assert (known.callsign, known.squawk) == ("GDL1", 0)
    assert known.altitude_type == mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH
    assert known.altitude / 1000 == pytest.approx(1400.0, abs=40.0)
    assert known.heading / 100 == pytest.approx(270.0, abs=3.0)
    assert known.hor_velocity / 100 == pytest.approx(50.0, abs=3.0)
    assert math.isclose(known.lat / 1e7, -35.31, abs_tol=0.001)
    assert flarm.heading / 100 == pytest.approx(180.0, abs=3.0)
    assert flarm.altitude / 1000 == pytest.approx(1084.0, abs=40.0)
    assert not flarm.flags & (mavlink.ADSB_FLAGS_VALID_CALLSIGN | mavlink.ADSB_FLAGS_VALID_SQUAWK)


@pytest.mark.parametrize("kind", [FakeArduPlane, FakePx4])
async def test_the_autopilot_gets_it_and_passes_it_to_its_station(
    kind: type[FakeArduPlane] | type[FakePx4], tmp_path: Path
) -> None:
    async with setting(kind, "autopilot", tmp_path) as flight:
        await asyncio.sleep(SECONDS)
        tracks = {track.track_id for track in flight.runtime.engine.snapshot(0.0).tracks}
        assert tracks == {"A00001", "FLARM-DD1234"}, "what comes back is not another aircraft"
    got = [m for m in flight.received if m.get_type() == "ADSB_VEHICLE"]
    assert {(m.get_srcSystem(), m.get_srcComponent()) for m in got} == {(1, 156)}
    check_reports(got, SECONDS)
    check_reports(flight.behind.of("ADSB_VEHICLE", 1), SECONDS)
    beats = [m for m in flight.received if m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 156]
    assert {beat.type for beat in beats} == {mavlink.MAV_TYPE_ADSB}
    assert SECONDS / 2 <= len(beats) <= SECONDS + 4
    assert flight.beside.of("ADSB_VEHICLE", 156) == flight.beside.of("HEARTBEAT", 156) == []
    assert flight.beside.of("HEARTBEAT", 196)
    (log,) = await asyncio.to_thread(lambda: list(tmp_path.glob("*.tlog")))
    recorded = [one for _, one in read_tlog(log) if (one.message_id, one.component_id) == (ADSB, 156)]
    assert len(recorded) == pytest.approx(len(got), abs=4)
    again = Engine(flight.runtime.engine._settings.config)
    decided: list[str] = []
    replay(log, again, on_decision=decided.append)
    assert {track.track_id for track in again.snapshot(0.0).tracks} <= tracks
    flown = await asyncio.to_thread(log.with_suffix(".jsonl").read_text)
    assert decided == flown.splitlines()[: len(decided)]


async def test_a_station_on_another_link_gets_it_and_the_autopilot_does_not() -> None:
    async with setting(FakeArduPlane, "station") as flight:
        await asyncio.sleep(SECONDS)
    assert not any(m.get_srcComponent() == 156 for m in flight.received)
    assert flight.behind.of("ADSB_VEHICLE", 1) == []
    check_reports(flight.beside.of("ADSB_VEHICLE", 156), SECONDS)
    beats = flight.beside.of("HEARTBEAT", 156)
    assert SECONDS / 2 <= len(beats) <= SECONDS + 4


@pytest.mark.parametrize(
    ("forward", "adsb_type", "wanted"),
    [
        ("autopilot", 1.0, "traffic is sent on to the autopilot"),
        ("autopilot", 0.0, "ArduPlane ignores the traffic that we send it (ADSB_TYPE 0): set it to 1"),
        ("station", 0.0, "station: there is no such link to send traffic on"),
        ("off", 1.0, None),
    ],
)
@in_virtual_time
async def test_check_says_where_it_would_go_and_sends_nothing(
    forward: Forward, adsb_type: float, wanted: str | None
) -> None:
    start_s = float(int(time.time()))
    vehicle = FakeArduPlane.airborne(
        HOME, start_s, position=IN_THE_AIR, course_rad=0.0, sequence=1, mission=MISSION
    )
    vehicle.parameters.set("ADSB_TYPE", adsb_type)
    ours, gdl90_port = free_ports(2)
    config = Config(
        (f"udpin:127.0.0.1:{ours}", f"gdl90:udpin:127.0.0.1:{gdl90_port}"),
        traffic=TrafficParams(forward=forward),
    )
    clock = ScaledClock(1.0, start_s=start_s, monotonic_s=asyncio.get_running_loop().time)
    server = VehicleServer(vehicle, open_links([f"udpout:127.0.0.1:{ours}"])[0], clock)
    flying = asyncio.create_task(server.run())
    try:
        links, receivers = open_links(config.links)
        found = await run_preflight(config, links, 12.0, clock, receivers=receivers)
    finally:
        server.close()
        await flying
    said = {finding.topic: (finding.text, finding.good) for finding in found.findings}
    assert said.get("forward") == (None if wanted is None else (wanted, wanted.startswith("traffic")))


@in_virtual_time
async def test_what_a_mavlink_receiver_on_a_link_of_its_own_hears_is_replayed_alike(tmp_path: Path) -> None:
    """The log does not say by which link a frame came, so that the service notes what is heard elsewhere."""
    near, far = memory_pair()
    beside, receiver = memory_pair()
    recorder = Recorder(tmp_path, 0.0)
    clock = ScaledClock(1.0, start_s=1.75e9, monotonic_s=asyncio.get_running_loop().time)
    config = EngineConfig(engine=EngineParams(autopilot_system_id=1))
    runtime = Runtime(Engine(config), [near, beside], recorder=recorder, clock=clock)
    flying = asyncio.create_task(Autopilot(far, sees_traffic=False).run())
    running = asyncio.create_task(runtime.run())
    encoder = Encoder()
    for second in range(20):
        message = mavlink.MAVLink_adsb_vehicle_message(
            ICAO, -349_000_000 - second * 4500, 1_490_900_000, 1, 1_484_000, 18_000, 5_000, 0, b"FAR", 1, 0,
            ALL_VALID, 1200,
        )  # fmt: skip
        receiver.send(encoder.encode(message, 7, 156))
        await asyncio.sleep(1.0)
    sent, decided = runtime.engine.forwarding.sent, (recorder.decisions_path).read_text().splitlines()
    assert sent > 10
    runtime.stop()
    await running
    flying.cancel()
    engine, replayed = Engine(config), list[str]()
    result = replay(recorder.tlog_path, engine, on_decision=replayed.append)
    assert replayed[: len(decided)] == decided
    assert engine.forwarding.sent >= sent
    assert [one["sources"] for one in result.report()["aircraft"]] == [["ADS-B"]]  # type: ignore[attr-defined]
    assert result.lost_pieces == 0
    assert result.receivers == []
