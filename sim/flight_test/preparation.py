"""Before the encounters: the vehicle is found, checked and set up, and it takes off. After them: put back."""

import asyncio
import math
import time
from collections.abc import Callable, Mapping

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import mavlink
from sim.flight_test.connections import Connections, FlightTestError
from sim.flight_test.mission import MissionFlown, items_of
from sim.flight_test.pilot import set_mode
from sim.flight_test.safety import refuse_real_aircraft, sign_of_simulation
from sim.flight_test.station import StationError
from sim.scenario import MissionPlan

_FOUND_WITHIN_S = 60.0  # of our time: a simulation may have to start
_HOME_WITHIN_S, _ARMED_WITHIN_S = 120.0, 180.0
_IN_THE_AIR_M = 30.0
_FLOAT32 = 1e-6  # relative precision of parameters
_RATES_HZ = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 5.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 2.0,
}


class Preparation:
    """Prepares one vehicle, and restores it afterwards; `note` shows what is done."""

    def __init__(self, connections: Connections, note: Callable[[str], None]) -> None:
        self._connections, self._observer, self._note = connections, connections.observer, note
        self._before: dict[str, float] = {}  # parameters that were changed

    async def find_vehicle(self) -> None:
        """Wait for the vehicle and for its position."""
        begun_s, observer = time.monotonic(), self._observer
        while observer.vehicle is None or observer.sample is None:
            if time.monotonic() - begun_s > _FOUND_WITHIN_S:
                missing = "no ArduPilot or PX4" if observer.vehicle is None else "no position"
                raise FlightTestError(
                    f"{missing} at {self._connections.vehicle_name} within {_FOUND_WITHIN_S:.0f} s"
                )
            await self._connections.pause()  # our heartbeat goes out: some vehicles answer who speaks first
            if observer.vehicle is not None and observer.sample is None:
                self._request_position(observer.vehicle.system_id)
                await asyncio.sleep(0.5)
        await self._connections.station.find(observer.vehicle.system_id)

    def _request_position(self, system_id: int) -> None:
        self._connections.report(
            mavlink.MAVLink_command_long_message(
                system_id, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0,
                mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 1e5, 0, 0, 0, 0, 0,
            )
        )  # fmt: skip

    async def check_simulated(self, *, real_aircraft: bool) -> str | None:
        """The sign that it is a simulation; `RealAircraftError` without one, unless allowed."""
        sign = await sign_of_simulation(self._observer, self._connections.station)
        refuse_real_aircraft(self._observer, sign, allowed=real_aircraft)
        return sign

    async def set_parameters(self, wanted: Mapping[str, float], *, allowed: bool) -> None:
        """Set those parameters that differ; `FlightTestError` when that is not allowed."""
        station = self._connections.station
        different = {}
        for name, value in wanted.items():
            present = await station.read(name)
            if present is not None and not math.isclose(present, value, rel_tol=_FLOAT32):
                different[name] = (present, value)
        if different and not allowed:
            names = ", ".join(f"{name} {value:g}" for name, (_, value) in different.items())
            raise FlightTestError(
                f"the test needs these parameters: {names}; set them, or allow it with --set-parameters "
                f"(they are restored afterwards)"
            )
        for name, (present, value) in different.items():
            self._note(f"parameter {name} set to {value:g}, was {present:g}")
            self._before[name] = present  # before it is written: the answer may be lost
            await station.write(name, value)

    async def request_rates(self) -> None:
        """Request the messages that the judge needs."""
        for message_id, rate_hz in _RATES_HZ.items():
            interval_us = 1e6 / rate_hz
            await self._connections.station.command(
                mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_us
            )

    async def take_off(self, plan: MissionPlan) -> MissionFlown:
        """Arm and take off with this mission; if the aircraft already flies one, that is used."""
        observer, station = self._observer, self._connections.station
        home, sample = await self._find_home(), observer.sample
        assert sample is not None
        flying = observer.armed and observer.on_mission and sample.height_m > _IN_THE_AIR_M
        if observer.armed and not flying:
            raise FlightTestError(
                f"the aircraft is armed, in {observer.mode}: disarm it, or let it fly its mission"
            )
        if flying:
            self._note("it flies a mission already: that one is used")
            return MissionFlown(await station.download(), home, observer, flown_before=True)
        items = items_of(plan, home, observer.name)
        await station.upload(items)
        await self._arm()
        return MissionFlown(items, home, observer)

    async def _find_home(self) -> GeoPoint:
        """Home as the vehicle reports it, which it does once it knows where it is."""
        begun_s = self._observer.now_s()
        while self._observer.home is None:
            if self._observer.now_s() - begun_s > _HOME_WITHIN_S:
                raise FlightTestError(f"the vehicle reported no home within {_HOME_WITHIN_S:.0f} s")
            request = mavlink.MAV_CMD_REQUEST_MESSAGE
            await self._connections.station.command(request, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
            await self._connections.sleep(1.0)
        return self._observer.home

    async def _arm(self) -> None:
        observer, station = self._observer, self._connections.station
        began_s = observer.now_s()
        while not (observer.armed and observer.on_mission):
            if observer.armed:
                raise FlightTestError(f"in {observer.mode} after arming: someone else has the aircraft")
            if observer.now_s() - began_s > _ARMED_WITHIN_S:
                raise FlightTestError(f"not armed in its mission's mode within {_ARMED_WITHIN_S:.0f} s")
            if not observer.on_mission:
                await set_mode(observer, station, "mission")
            await self._connections.sleep(1.0)
            if observer.on_mission and not observer.armed:
                await station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            await self._connections.sleep(2.0)

    async def restore_parameters(self) -> str | None:
        """Set the changed parameters back; a problem in words."""
        problem = None
        for name, value in self._before.items():
            try:
                await self._connections.station.write(name, value)
            except StationError as error:
                problem = problem or f"not restored: {error}"
        self._before.clear()
        return problem
