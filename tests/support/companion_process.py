"""The companion as a process over loopback UDP, and a vehicle in real time that it flies."""

import asyncio
import contextlib
import os
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path

from companion.links import open_link
from sim.clock import ScaledClock
from sim.scenario import Autopilot
from sim.server import VehicleServer
from sim.vehicle import FakeVehicle
from tests.support.faulty_flight import free_ports, world_of
from tests.support.forked import Forked, fork


class Aircraft:
    """A vehicle in real time, and the companion as a process that can be killed."""

    vehicle: FakeVehicle

    def __init__(self, config: Path, *, stuck_log: bool = False) -> None:
        """With `stuck_log`, its log goes into a full pipe that no one reads."""
        self._config = config
        self._stuck_log = stuck_log
        self._ends: list[int] = []
        self._process: Forked | None = None

    async def start(self) -> float:
        """Start the companion, and wait for its first line of log; returns how long that took [s]."""
        began_s = time.monotonic()
        if self._stuck_log:
            await self._start_with_stuck_log()
            return time.monotonic() - began_s
        self._process = await fork("run", str(self._config))
        await asyncio.wait_for(self._process.stderr.readline(), 30.0)
        return time.monotonic() - began_s

    async def _start_with_stuck_log(self) -> None:
        self._ends = [*os.pipe()]
        os.set_blocking(self._ends[1], False)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(self._ends[1], b"x" * 4096)
        os.set_blocking(self._ends[1], True)
        self._process = await fork("run", str(self._config), into=self._ends[1])

    async def end(self, number: int) -> tuple[int | None, str]:
        """Send a signal to the companion; returns its exit code and its log."""
        assert self._process is not None
        self._process.send_signal(number)
        _, errors = await asyncio.wait_for(self._process.communicate(), 20.0)
        return self._process.returncode, errors.decode()

    def signal(self, number: int) -> None:
        """Send a signal and do not wait."""
        assert self._process is not None
        self._process.send_signal(number)

    @property
    def running(self) -> bool:
        """Whether the companion has not ended."""
        return self._process is not None and self._process.returncode is None

    async def ended(self) -> int | None:
        """Wait until the companion has ended; returns its exit code."""
        assert self._process is not None
        return await asyncio.wait_for(self._process.wait(), 20.0)

    def close_log(self) -> None:
        """Close our ends of its stdout and stderr, as a closed terminal or an ended `| tee` does."""
        assert self._process is not None
        self._process.close_pipes()

    async def kill_if_running(self) -> None:
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()
        for end in self._ends:
            os.close(end)

    async def until(self, condition: Callable[[], bool], limit_s: float = 30.0) -> None:
        async with asyncio.timeout(limit_s):
            while not condition():  # noqa: ASYNC110 - a simulated vehicle sets no events
                await asyncio.sleep(0.02)

    async def flown(self) -> None:
        """Wait until the companion has flown the aircraft for a second."""
        await self.until(lambda: self.vehicle.truth.companion_flies)
        await asyncio.sleep(1.0)
        assert self.vehicle.truth.companion_flies


@contextlib.asynccontextmanager
async def aircraft(
    autopilot: Autopilot,
    folder: Path,
    *,
    below_m: float = 0.0,
    options: str = "",
    stuck_log: bool = False,
    without_vehicle: bool = False,
    display: bool = False,
) -> AsyncIterator[Aircraft]:
    """An aircraft in flight and its companion; with `display`, that one starts its display too."""
    (port,) = free_ports(1)
    config = folder / "companion.yaml"
    config.write_text(
        f"links: [udpin:127.0.0.1:{port}]\nrecording: {{enabled: false}}\n"
        f"state_file: {folder / 'state'}\nweb: {{enabled: {str(display).lower()}}}\n{options}"
    )
    flight = Aircraft(config, stuck_log=stuck_log)
    await flight.start()
    if without_vehicle:
        yield flight
        await flight.kill_if_running()
        return
    start_s = time.time()
    world, receiver = world_of(autopilot, below_m=below_m, start_s=start_s)
    flight.vehicle = world.vehicle
    links = [open_link(f"udpout:127.0.0.1:{port}")]
    server = VehicleServer(world.vehicle, links, ScaledClock(1.0, start_s=start_s), receiver=receiver)
    flying = asyncio.create_task(server.run())
    try:
        yield flight
    finally:
        await flight.kill_if_running()
        server.close()
        await flying
