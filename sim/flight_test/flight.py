"""One flight test from connecting to giving the aircraft back. All times are the vehicle's own."""

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

from companion.errors import CompanionError, ConfigError, ungrouped
from companion.geodesy import GeoPoint, LocalFrame
from companion.links import Link, open_link
from companion.links.udp import UdpLink
from companion.mavlink.dialect import Message, mavlink
from companion.model import Role
from companion.units import wrap_pi
from sim.clock import ScaledClock
from sim.flight_test.beside import Beside, beside
from sim.flight_test.deeds import Deeds, mode_number, set_mode, set_role
from sim.flight_test.hub import Hub
from sim.flight_test.judge import AT_HEIGHT_M, ON_LEG_M, Judged, Leg
from sim.flight_test.mission import items_of, legs_of, shifted, with_waypoint
from sim.flight_test.observer import Observer, Sample
from sim.flight_test.plan import EncounterPlan, FlightTest
from sim.flight_test.safety import refuse_real_aircraft, sign_of_simulation
from sim.flight_test.station import Station, StationError
from sim.flight_test.traffic import Meeting, Traffic
from sim.flight_test.vehicle_time import VehicleTime
from sim.relay import Relay
from sim.server import VehicleServer
from sim.traffic import ADSB_RECEIVER
from sim.vehicle import FakeVehicle, MissionItem

_POLL_S = 0.02
_FOUND_WITHIN_S = 60.0  # of our time: a simulation may have to start
_SILENT_S = 15.0
_HOME_WITHIN_S, _ARMED_WITHIN_S, _ON_LEG_WITHIN_S = 120.0, 180.0, 600.0
_COMPANION_WITHIN_S = 60.0
_SETTLED_S = 5.0
_ALIGNED_RAD = math.radians(10.0)
_UPLOAD_SHIFT_M = 60.0
# The aircraft needs more of its leg than until the meeting.
_LEG_MARGIN_S = 60.0
# A waypoint that leads back to the leg is this far ahead.
_REJOIN_S, _REJOIN_M = 60.0, 1200.0
_READY_AFTER_S = 8.0  # for Companion to read parameters and mission
_RATES_HZ = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 10.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 5.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 2.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: 2.0,
}
_SIMULATED_FLAG = mavlink.ADSB_FLAGS_SIMULATED


class FlightTestError(CompanionError):
    """The flight cannot go on."""


@dataclass(frozen=True)
class Options:
    """What is flown. `vehicle` is a link, or a fake vehicle in this process that flies by `clock`."""

    test: FlightTest
    vehicle: str | FakeVehicle
    folder: Path
    clock: ScaledClock | None = None
    companion: str | None = None
    set_parameters: bool = False
    real_aircraft: bool = False
    simulated_flag: bool = False
    only: tuple[str, ...] = ()
    seed: int = 0


@dataclass
class Result:
    """What a flight showed. `problem`: why it ended early."""

    autopilot: str = "unknown"
    version: str | None = None
    companion: str = ""
    simulation: str | None = None
    encounters: list[Judged] = field(default_factory=list)
    failures: dict[str, list[str]] = field(default_factory=dict)
    problem: str | None = None
    rate: float = 1.0
    flown_s: float = 0.0
    wall_s: float = 0.0
    left_out: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether all encounters came out as expected."""
        return self.problem is None and bool(self.encounters) and not any(self.failures.values())


class Flight:
    """Flies one test; `result` grows while it does, and `doing` says in words what happens."""

    def __init__(
        self, options: Options, on_event: Callable[[float, str], None] = lambda _s, _text: None
    ) -> None:
        self.options, self.result = options, Result()
        self.observer = Observer(VehicleTime())
        self.doing = "waiting for the vehicle"
        self.judged: Judged | None = None
        self._on_event = on_event
        self._hub: Hub | None = None
        self._relay: Relay | None = None
        self._station: Station | None = None
        self._beside: Beside = beside(options.companion, options.folder, options.clock)
        self._legs: dict[int, Leg] = {}
        self._items: list[MissionItem] = []
        self._restored: dict[str, float] = {}
        self._number = 1
        observer = self.observer
        observer.on_sample, observer.on_mode = self._sampled, self._mode_changed
        observer.on_text, observer.on_refusal = self._said, self._refused
        observer.on_command = self._commanded

    async def run(self) -> Result:
        """Fly; the result. `CompanionError` when the test cannot begin; cancelling ends it in order."""
        begun_s = time.monotonic()
        async with self._connected():
            try:
                await self._prepare()
                await self._fly_encounters()
            except (FlightTestError, StationError) as error:
                self.result.problem = str(error)
            finally:
                await asyncio.shield(self._give_back())
        self.result.wall_s = time.monotonic() - begun_s
        return self.result

    # --- connections

    @asynccontextmanager
    async def _connected(self) -> AsyncIterator[None]:
        """The hub with its ends, MAVSDK, and the fake vehicle if that is flown."""
        options = self.options
        vehicle, station, companion = self._vehicle_end(), *(_end() for _ in range(2))
        ends: dict[str, Link] = {"vehicle": vehicle, "station": station, "companion": companion}
        tlog = options.folder / "flight.tlog"
        self._hub = hub = Hub(ends, self.observer.observe, tlog)
        await hub.open()
        self._relay = relay = Relay(
            "udpin:127.0.0.1:0", f"udpout:127.0.0.1:{companion.local_port}", seed=options.seed
        )
        await relay.open()
        server = None
        if isinstance(options.vehicle, FakeVehicle):
            assert isinstance(vehicle, UdpLink)
            assert options.clock is not None
            link = open_link(f"udpout:127.0.0.1:{vehicle.local_port}")
            server = VehicleServer(options.vehicle, [link], options.clock, stream_rate_hz=4.0)
        try:
            with ungrouped():
                async with asyncio.TaskGroup() as tasks:
                    running = tasks.create_task(hub.run(), name="hub")
                    flying = None if server is None else tasks.create_task(server.run(), name="vehicle")
                    async with Station(station.local_port) as self._station:
                        yield
                    hub.close()
                    await running
                    if server is not None and flying is not None:
                        server.close()
                        await flying
        finally:
            relay.close()
            hub.close()
            if server is not None:
                server.close()

    def _vehicle_end(self) -> Link:
        if isinstance(self.options.vehicle, str):
            return open_link(self.options.vehicle)
        return _end()

    # --- before the encounters

    async def _prepare(self) -> None:
        station, observer = self._the_station, self.observer
        await self._find_vehicle()
        sign = await sign_of_simulation(observer, station)
        self.result.autopilot, self.result.simulation = observer.name, sign
        self.result.version = _version_words(observer.version)
        refuse_real_aircraft(observer, sign, allowed=self.options.real_aircraft)
        self._check_modes()
        await self._set_parameters()
        for message_id, rate_hz in _RATES_HZ.items():
            await station.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 1e6 / rate_hz)
        await self._start_companion()
        await self._take_off()

    async def _find_vehicle(self) -> None:
        begun_s = time.monotonic()
        while self.observer.vehicle is None or self.observer.sample is None:
            if time.monotonic() - begun_s > _FOUND_WITHIN_S:
                missing = "no ArduPilot or PX4" if self.observer.vehicle is None else "no position"
                raise FlightTestError(f"{missing} at {self.options.vehicle} within {_FOUND_WITHIN_S:.0f} s")
            self._the_hub.send(_receiver_heartbeat(), ADSB_RECEIVER)  # PX4 answers who speaks first
            await asyncio.sleep(0.5)
            if self.observer.vehicle is not None and self.observer.sample is None:
                self._request_position(self.observer.vehicle.system_id)
        await self._the_station.find()

    def _request_position(self, system_id: int) -> None:
        message = mavlink.MAVLink_command_long_message(
            system_id, 1, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 1e5, 0, 0, 0, 0, 0,
        )  # fmt: skip
        self._the_hub.send(message, ADSB_RECEIVER)

    def _check_modes(self) -> None:
        """Refuse a plan with a mode that the autopilot does not have, before anything is flown."""
        for plan in self._plans:
            wanted = [action.mode for action in plan.actions if action.mode] + (
                [plan.expect.mode] if plan.expect.mode else []
            )
            for name in wanted:
                try:
                    mode_number(self.observer, name)
                except ValueError as error:
                    raise ConfigError(f"encounter {plan.name}: {error}") from error

    async def _set_parameters(self) -> None:
        wanted = self.options.test.parameters.get(self.observer.name, {})  # type: ignore[call-overload]
        station = self._the_station
        different = {}
        for name, value in wanted.items():
            present = await station.read(name)
            if present is not None and present != value:
                different[name] = value
                self._restored[name] = present
        if not different:
            return
        if not self.options.set_parameters:
            self._restored.clear()
            names = ", ".join(f"{name} {value:g}" for name, value in different.items())
            raise FlightTestError(
                f"the test needs these parameters: {names}; set them, or allow it with --set-parameters "
                f"(they are restored afterwards)"
            )
        for name, value in different.items():
            self._note(f"parameter {name} set to {value:g}, was {self._restored[name]:g}")
            await station.write(name, value)

    async def _start_companion(self) -> None:
        assert self._relay is not None
        self.doing = "starting companion"
        await self._beside.start(self._relay.local_port)
        self.result.companion = self._beside.name
        begun_s = time.monotonic()
        while math.isinf(self.observer.companion_s):
            if time.monotonic() - begun_s > _COMPANION_WITHIN_S:
                raise FlightTestError(f"no heartbeat of companion ({self._beside.name})")
            await self._pause()

    async def _take_off(self) -> None:
        """Arm and take off with the test's mission, unless the aircraft is already flying one."""
        observer, station = self.observer, self._the_station
        home = await self._find_home()
        sample = observer.sample
        assert sample is not None
        flying = observer.armed and observer.on_mission and sample.height_m > 30.0
        if flying:
            self._note("it flies a mission already: that one is used")
            self._items = await station.download()
        elif observer.armed:
            raise FlightTestError(
                f"the aircraft is armed, in {observer.mode}: disarm it, or let it fly its mission"
            )
        else:
            self._items = items_of(self.options.test.mission, home, observer.name)
            self.doing = "uploading the mission"
            await station.upload(self._items)
        self._legs = legs_of(self._items, home, self.observer.name)
        if not flying:
            await self._arm()
        self.doing = "climbing to the leg"
        await self._until(self._settled, _ON_LEG_WITHIN_S, "the aircraft did not come to its leg")
        await self._sleep(_READY_AFTER_S)

    async def _find_home(self) -> GeoPoint:
        """Home as the vehicle reports it, which it does once it knows where it is."""
        self.doing = "waiting for home"
        begun_s = self.observer.now_s()
        while self.observer.home is None:
            if self.observer.now_s() - begun_s > _HOME_WITHIN_S:
                raise FlightTestError(f"the vehicle reported no home position within {_HOME_WITHIN_S:.0f} s")
            request = mavlink.MAV_CMD_REQUEST_MESSAGE
            await self._the_station.command(request, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
            await self._sleep(1.0)
        return self.observer.home

    async def _arm(self) -> None:
        observer, station = self.observer, self._the_station
        self.doing = "waiting to arm"
        began_s = observer.now_s()
        while not (observer.armed and observer.on_mission):
            if observer.now_s() - began_s > _ARMED_WITHIN_S:
                raise FlightTestError(f"not armed in its mission's mode within {_ARMED_WITHIN_S:.0f} s")
            if not observer.on_mission:
                await set_mode(observer, station, "mission")
            await self._sleep(1.0)
            if observer.on_mission and not observer.armed:
                await station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            await self._sleep(2.0)

    # --- encounters

    @property
    def _plans(self) -> list[EncounterPlan]:
        chosen = [
            p for p in self.options.test.encounters if not self.options.only or p.name in self.options.only
        ]
        return [p for p in chosen if self.observer.name in p.autopilots]

    async def _fly_encounters(self) -> None:
        chosen = self._plans
        names = {plan.name for plan in chosen}
        self.result.left_out = [p.name for p in self.options.test.encounters if p.name not in names]
        for plan in chosen:
            self.doing = f"waiting for the leg before {plan.name}"
            await self._rejoin()
            await self._until(self._settled, _ON_LEG_WITHIN_S, f"not on its leg before {plan.name}")
            await self._fly(plan)

    async def _fly(self, plan: EncounterPlan) -> None:
        observer, sample = self.observer, self.observer.sample
        assert sample is not None
        meeting, frame = self._meeting(plan, sample)
        flags = _SIMULATED_FLAG if self.options.simulated_flag else 0
        traffic = Traffic(plan, meeting, frame, self._number, flags=flags, seed=self.options.seed)
        self._number += len(plan.intruders)
        judged = Judged(
            plan, observer.now_s(), frame, traffic.intruders, sees_commands=self._beside.on_our_link
        )
        judged.on_mission, judged.modes = observer.on_mission, [observer.mode]
        self.judged, self.doing = judged, plan.name
        self.result.encounters.append(judged)
        deeds = Deeds(
            plan.actions, observer, self._the_station, self._relay if self._beside.on_our_link else None,
            self._beside, self._upload,
        )  # fmt: skip
        try:
            await self._until_over(plan, judged, traffic, deeds, meeting)
        finally:
            deeds.cancel()
            self.result.failures[plan.name] = judged.failures(observer.mode)
            self.judged = None
            self.result.rate, self.result.flown_s = observer.time.rate, observer.now_s()
        await self._put_right(plan)

    async def _until_over(
        self, plan: EncounterPlan, judged: Judged, traffic: Traffic, deeds: Deeds, meeting: Meeting
    ) -> None:
        observer = self.observer
        earliest_s = meeting.time_s + plan.lasts_s
        latest_s = meeting.time_s + plan.lasts_s + plan.expect.back_within_s
        while observer.now_s() < latest_s:
            own = observer.sample
            assert own is not None
            for report in traffic.reports(observer.now_s(), judged.frame.to_ned_m(own.place)):
                self._the_hub.send(report, ADSB_RECEIVER)
            deeds.step(judged)
            if observer.now_s() >= earliest_s and deeds.done and judged.is_over:
                return
            await self._pause()

    def _meeting(self, plan: EncounterPlan, sample: Sample) -> tuple[Meeting, LocalFrame]:
        """Where the aircraft will be on its leg when the intruders meet it."""
        leg = self._leg
        assert leg is not None
        frame = LocalFrame(sample.place.lat_deg, sample.place.lon_deg)
        speed_mps = sample.speed_mps
        here = leg.ahead(sample.place, 0.0)
        there = leg.ahead(sample.place, speed_mps * plan.meets_s)
        end_m = frame.to_ned_m(leg.end)
        if math.hypot(*end_m[:2]) < speed_mps * (plan.meets_s + _LEG_MARGIN_S):
            raise FlightTestError(f"the leg is too short for {plan.name}: its end is near")
        climb_mps = (there.altitude_m - here.altitude_m) / plan.meets_s
        north_m, east_m, down_m = frame.to_ned_m(there)
        course_rad = math.atan2(north_m, east_m)
        velocity_mps = speed_mps * math.sin(course_rad), speed_mps * math.cos(course_rad), -climb_mps
        return Meeting(self.observer.now_s() + plan.meets_s, (north_m, east_m, down_m), velocity_mps), frame

    async def _put_right(self, plan: EncounterPlan) -> None:
        """Resume the mission when the encounter left the aircraft in another mode."""
        observer = self.observer
        if any(action.role is not None for action in plan.actions):
            await set_role(self._the_station, Role.FLY)
        if not observer.on_mission:
            self._note(f"the test resumes the mission, after {observer.mode}")
            await set_mode(observer, self._the_station, "mission")
            await self._until(lambda: observer.on_mission, 60.0, "the mission could not be resumed")

    async def _rejoin(self) -> None:
        """Lead the aircraft back to its leg if an encounter left it beside: both autopilots fly on parallel."""
        observer, sample, leg = self.observer, self.observer.sample, self._leg
        if sample is None or leg is None or observer.sequence is None or leg is self._first_leg:
            return
        aside_m, above_m = leg.off_m(sample.place)
        if aside_m <= ON_LEG_M and abs(above_m) <= AT_HEIGHT_M:
            return
        self._note(f"{aside_m:.0f} m beside the leg: a waypoint on it is added ahead")
        place = leg.ahead(sample.place, max(sample.speed_mps * _REJOIN_S, _REJOIN_M))
        number = observer.sequence
        await self._change_mission(with_waypoint(self._items, number, place), number)

    async def _upload(self, what: str) -> None:
        """Upload the mission again, or one beside it, and go on with the same item."""
        items = shifted(self._items, _UPLOAD_SHIFT_M) if what == "shifted" else self._items
        await self._change_mission(items, self.observer.sequence)

    async def _change_mission(self, items: list[MissionItem], sequence: int | None) -> None:
        home = self.observer.home
        assert home is not None
        await self._the_station.upload(items)
        if sequence is not None:
            await self._the_station.select_item(sequence)
        self._items, self._legs = items, legs_of(items, home, self.observer.name)

    # --- after the encounters

    async def _give_back(self) -> None:
        """End Companion, give the aircraft back to its mission, and restore the parameters."""
        self.doing = "giving the aircraft back"
        observer, station = self.observer, self._station
        problem = await self._beside.stop()
        if problem is not None and self.result.problem is None:
            self.result.problem = problem
        if station is None or observer.vehicle is None:
            return
        with contextlib.suppress(StationError):
            if observer.armed and self._legs and not observer.on_mission:
                await set_mode(observer, station, "mission")
        for name, value in self._restored.items():
            try:
                await station.write(name, value)
            except StationError as error:
                self.result.problem = self.result.problem or f"not restored: {error}"
        self.doing = "done"

    # --- what the observer reports

    def _sampled(self, sample: Sample) -> None:
        leg = self._leg
        if self.judged is not None and leg is not None:
            self.judged.observe_position(sample, leg)

    def _mode_changed(self, mode: str) -> None:
        observer = self.observer
        if self.judged is not None:
            self.judged.observe_mode(
                observer.now_s(), mode, guided=observer.guided, on_mission=observer.on_mission
            )
        self._note(f"mode {mode}")

    def _said(self, who: str, text: str) -> None:
        if self.judged is not None:
            self.judged.note(self.observer.now_s(), f"{who}: {text}")
        self._note(f"{who}: {text}")

    def _refused(self, command: int, result: int) -> None:
        if self.judged is not None:
            self.judged.observe_refusal(command, result)

    def _commanded(self, message: Message) -> None:
        if self.judged is not None:
            self.judged.observe_command(self.observer.now_s(), message)

    def _note(self, text: str) -> None:
        now_s = self.observer.now_s()
        self._on_event(0.0 if math.isnan(now_s) else now_s, text)

    # --- waiting

    @property
    def _leg(self) -> Leg | None:
        sequence = self.observer.sequence
        return None if sequence is None else self._legs.get(sequence)

    def _settled(self) -> bool:
        """Whether the aircraft flies its mission on its leg, at its height, along it."""
        observer, sample, leg = self.observer, self.observer.sample, self._leg
        if sample is None or leg is None or not observer.on_mission or leg is self._first_leg:
            return False
        aside_m, above_m = leg.off_m(sample.place)
        course_rad = math.atan2(sample.velocity_mps[1], sample.velocity_mps[0])
        aligned = abs(wrap_pi(course_rad - leg.course_rad)) < _ALIGNED_RAD
        return aside_m <= ON_LEG_M and abs(above_m) <= AT_HEIGHT_M and aligned

    @property
    def _first_leg(self) -> Leg | None:
        """The leg of the take-off, on which nothing is flown."""
        return next(iter(self._legs.values()), None) if len(self._legs) > 1 else None

    async def _until(self, condition: Callable[[], bool], limit_s: float, problem: str) -> None:
        """Wait until a condition has held for some seconds of the vehicle's time."""
        began_s = since_s = self.observer.now_s()
        while self.observer.now_s() - since_s < _SETTLED_S:
            if not condition():
                since_s = self.observer.now_s()
            if self.observer.now_s() - began_s > limit_s:
                raise FlightTestError(f"{problem} within {limit_s:.0f} s, in {self.observer.mode}")
            await self._pause()

    async def _sleep(self, seconds: float) -> None:
        until_s = self.observer.now_s() + seconds
        while self.observer.now_s() < until_s:
            await self._pause()

    async def _pause(self) -> None:
        if self.observer.time.known and self.observer.time.silent_s > _SILENT_S:
            raise FlightTestError(f"nothing heard of the vehicle for {_SILENT_S:.0f} s")
        now_s = time.monotonic()
        if now_s - self._beat_s >= 1.0:
            self._beat_s = now_s
            self._the_hub.send(_receiver_heartbeat(), ADSB_RECEIVER)
        await asyncio.sleep(_POLL_S)

    _beat_s = -math.inf

    @property
    def _the_hub(self) -> Hub:
        assert self._hub is not None
        return self._hub

    @property
    def _the_station(self) -> Station:
        assert self._station is not None
        return self._station


def _end() -> UdpLink:
    link = open_link("udpin:127.0.0.1:0")
    assert isinstance(link, UdpLink)
    return link


def _receiver_heartbeat() -> mavlink.MAVLink_heartbeat_message:
    """The heartbeat of an ADS-B receiver: PX4 may ask for one."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ADSB, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


def _version_words(version: int | None) -> str | None:
    return None if not version else f"{version >> 24 & 0xFF}.{version >> 16 & 0xFF}.{version >> 8 & 0xFF}"
