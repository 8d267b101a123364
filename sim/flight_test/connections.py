"""What a flight test is connected with: the vehicle, MAVSDK, Companion behind a relay, all at one hub."""

import asyncio
import math
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from companion.errors import CompanionError, ungrouped
from companion.links import Link, open_link
from companion.links.udp import UdpLink
from companion.mavlink.dialect import Message, mavlink
from sim.clock import ScaledClock
from sim.flight_test.hub import Hub
from sim.flight_test.observer import Observer
from sim.flight_test.station import Station
from sim.flight_test.vehicle_time import VehicleTime
from sim.receivers.mavlink import ADSB_RECEIVER
from sim.relay import Relay
from sim.server import VehicleServer
from sim.vehicle import FakeVehicle

_POLL_S = 0.02
_SILENT_S = 15.0
# What is waited for must have held for this long, in the vehicle's time.
_SETTLED_S = 5.0


class FlightTestError(CompanionError):
    """The flight cannot go on."""


class Connections:
    """The connections of one flight, and waiting in the vehicle's time.

    `vehicle` is a link, or a fake vehicle in this process that flies by `clock`.
    """

    hub: Hub
    relay: Relay
    station: Station

    def __init__(
        self, vehicle: str | FakeVehicle, clock: ScaledClock | None, folder: Path, seed: int = 0
    ) -> None:
        self.observer = Observer(VehicleTime())
        self.check: Callable[[], None] = lambda: None  # called while we wait; raises when that is in vain
        self.vehicle_name = vehicle if isinstance(vehicle, str) else "the fake"
        self._vehicle, self._clock, self._folder, self._seed = vehicle, clock, folder, seed
        self._beat_s = -math.inf

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[None]:
        """Open all connections, and close them at the end. `LinkError` when one cannot be opened."""
        vehicle, station, companion = self._vehicle_end(), _end(), _end()
        ends: dict[str, Link] = {"vehicle": vehicle, "station": station, "companion": companion}
        self.hub = hub = Hub(ends, self.observer.observe, self._folder / "flight.tlog")
        relay: Relay | None = None
        server: VehicleServer | None = None
        try:
            await hub.open()
            to = f"udpout:127.0.0.1:{companion.local_port}"
            self.relay = relay = Relay("udpin:127.0.0.1:0", to, seed=self._seed)
            await relay.open()
            server = self._server(vehicle)
            with ungrouped():
                async with asyncio.TaskGroup() as tasks:
                    running = tasks.create_task(hub.run(), name="hub")
                    flying = None if server is None else tasks.create_task(server.run(), name="vehicle")
                    async with Station(station.local_port) as self.station:
                        yield
                    hub.close()
                    await running
                    if server is not None and flying is not None:
                        server.close()
                        await flying
        finally:
            if relay is not None:
                relay.close()
            hub.close()
            if server is not None:
                server.close()

    def _vehicle_end(self) -> Link:
        return open_link(self._vehicle) if isinstance(self._vehicle, str) else _end()

    def _server(self, end: Link) -> VehicleServer | None:
        """Flies the fake vehicle; `None` without one."""
        if isinstance(self._vehicle, str) or not isinstance(end, UdpLink):
            return None
        assert self._clock is not None
        link = open_link(f"udpout:127.0.0.1:{end.local_port}")
        return VehicleServer(self._vehicle, [link], self._clock, stream_rate_hz=4.0)

    def report(self, message: Message) -> None:
        """Send a message of the ADS-B receiver, a component of the vehicle."""
        system_id = ADSB_RECEIVER[0] if self.observer.vehicle is None else self.observer.vehicle.system_id
        self.hub.send(message, (system_id, ADSB_RECEIVER[1]))

    # --- waiting

    async def until(self, condition: Callable[[], bool], limit_s: float, problem: str) -> None:
        """Wait until a condition has held for some seconds; `FlightTestError` after `limit_s`."""
        if not await self.settles(condition, limit_s):
            raise FlightTestError(f"{problem} within {limit_s:.0f} s, in {self.observer.mode}")

    async def settles(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Whether a condition holds for some seconds, before `limit_s` is over."""
        observer = self.observer
        began_s = since_s = observer.now_s()
        while observer.now_s() - since_s < _SETTLED_S:
            if not condition():
                since_s = observer.now_s()
            if observer.now_s() - began_s > limit_s:
                return False
            await self.pause()
        return True

    async def sleep(self, seconds: float) -> None:
        """Wait for some seconds of the vehicle."""
        until_s = self.observer.now_s() + seconds
        while self.observer.now_s() < until_s:
            await self.pause()

    async def pause(self) -> None:
        """Wait a moment; `FlightTestError` when the vehicle fell silent, restarted, or is not alone."""
        self.check()
        vehicle_time, another = self.observer.time, self.observer.another
        if another is not None:
            raise FlightTestError(f"another autopilot is at this link: system {another.system_id}")
        if vehicle_time.restarts:
            raise FlightTestError("the vehicle restarted")
        if vehicle_time.known and vehicle_time.silent_s > _SILENT_S:
            raise FlightTestError(f"nothing heard of the vehicle for {_SILENT_S:.0f} s")
        now_s = time.monotonic()
        if now_s - self._beat_s >= 1.0:
            self._beat_s = now_s
            self.report(_receiver_heartbeat())
        await asyncio.sleep(_POLL_S)


def _end() -> UdpLink:
    link = open_link("udpin:127.0.0.1:0")
    assert isinstance(link, UdpLink)
    return link


def _receiver_heartbeat() -> Message:
    """The heartbeat of an ADS-B receiver: PX4 may ask for one."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ADSB, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )
