"""A fake ArduPlane: MAVLink messages in, messages out; it behaves as the real one, quirks included."""

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, ClassVar

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.model import Vec2
from sim.dynamics import Airframe
from sim.vehicle.ardupilot.commands import ArduPlaneCommands
from sim.vehicle.ardupilot.failsafe import RadioFailsafe
from sim.vehicle.ardupilot.flight import ArduPlaneFlight
from sim.vehicle.ardupilot.modes import Mode
from sim.vehicle.ardupilot.parameters import Firmware, parameters_of
from sim.vehicle.ardupilot.telemetry import DEFAULT_STREAM, STREAM_GROUPS, ArduPlaneTelemetry
from sim.vehicle.ardupilot.traffic import ArduPlaneAvoidance, TrafficList
from sim.vehicle.mission import ABSOLUTE_FRAMES, GLOBAL_FRAMES, MissionItem
from sim.vehicle.mission_protocol import MISSION
from sim.vehicle.outputs import INFO, WARNING, Text
from sim.vehicle.parameter_protocol import AsFloat
from sim.vehicle.vehicle import BOOTED_BEFORE_S, FakeVehicle


class FakeArduPlane(FakeVehicle):
    """An ArduPlane without I/O and without a clock."""

    name: ClassVar[str] = "ArduPlane"
    first_item: ClassVar[int] = 1
    default_stream: ClassVar[Sequence[int]] = DEFAULT_STREAM

    def __init__(
        self,
        home: GeoPoint,
        now_s: float,
        *,
        mission: Sequence[MissionItem] = (),
        heading_rad: float = 0.0,
        wind_mps: Vec2 = (0.0, 0.0),
        airframe: Airframe | None = None,
        system_id: int = 1,
        firmware: Firmware = "4.7",
        parameters: Mapping[str, float] | None = None,
        geoid_height_m: float = 0.0,
        guided_commands: bool = True,
    ) -> None:
        """Start disarmed in MANUAL at home at `now_s` [s, Unix]; `mission` has no home item.

        `firmware` is the imitated version, with its parameter names; `parameters` override its defaults.
        Without `guided_commands` it is a build without the 4300x commands
        (AP_PLANE_OFFBOARD_GUIDED_SLEW_ENABLED 0): they are unsupported.
        """
        values = parameters_of(firmware)
        for name, value in (parameters or {}).items():
            values.record(name, value)
        values.record("SYSID_THISMAV", system_id)
        values.record("MIS_TOTAL", len(mission) + 1 if mission else 0)
        flight = ArduPlaneFlight(
            home, values, items=mission, heading_rad=heading_rad, wind_mps=wind_mps, airframe=airframe
        )
        telemetry = ArduPlaneTelemetry(flight, now_s - BOOTED_BEFORE_S, firmware, geoid_height_m)
        super().__init__(flight, telemetry, AsFloat(), now_s, system_id=system_id, asks_for_int=False)
        self._flight: ArduPlaneFlight = flight
        self._traffic = TrafficList(values)
        self._avoidance = ArduPlaneAvoidance(flight, self._heard)
        self._radio = RadioFailsafe(flight)
        self._commands: ArduPlaneCommands = ArduPlaneCommands(flight, telemetry, self._streams, self._send)
        if not guided_commands:
            self._commands.leave_out_guided_commands()

    @classmethod
    def airborne(
        cls,
        home: GeoPoint,
        now_s: float,
        *,
        position: GeoPoint,
        course_rad: float,
        sequence: int = 1,
        **options: Any,
    ) -> "FakeArduPlane":
        """A vehicle in the air: armed, in AUTO, level at cruise speed on the way to item `sequence`."""
        vehicle = cls(home, now_s, **options)
        vehicle.flight.start_in_air(position, course_rad, sequence)
        return vehicle

    @property
    def flight(self) -> ArduPlaneFlight:
        """The aircraft and its modes."""
        return self._flight

    def set_mode(self, mode: IntEnum | str) -> None:
        """Change the mode from the pilot's transmitter; `ValueError` for an unknown mode."""
        if isinstance(mode, str):
            if mode not in Mode.__members__:
                raise ValueError(f"ArduPlane has no mode {mode!r}")
            mode = Mode[mode]
        self._flight.set_mode(Mode(mode))

    def lose_radio(self, lost: bool) -> None:
        """Lose the pilot's radio control or regain it; the parameters FS_SHORT_* and FS_LONG_* decide."""
        self._radio.lose(lost)

    def _receive_report(self, report: Message, now_s: float, _channel: int) -> None:
        self._traffic.receive(report, self._flight.place, now_s)

    def _reports_for(self, channel: int, now_s: float) -> list[Message]:
        report = self._traffic.next_for(channel, now_s)
        return [] if report is None else [report]

    def _clear_reports(self) -> None:
        self._traffic.clear()

    def _avoid_traffic(self, now_s: float) -> None:
        self._avoidance.step(now_s)
        self._radio.step()

    def _handle_set_mode(self, message: Message) -> tuple[int, int]:
        result = self._commands.set_mode(message.base_mode, message.custom_mode)
        return mavlink.MAVLINK_MSG_ID_SET_MODE, result

    def _handle_data_stream(self, message: Message, channel: int) -> None:
        """Handle REQUEST_DATA_STREAM: one rate for a group of messages; unknown groups are ignored."""
        rate_hz = message.req_message_rate if message.start_stop else 0
        for message_id in STREAM_GROUPS.get(message.req_stream_id, ()):
            interval_s = 1.0 / rate_hz if rate_hz > 0 else 0.0
            self._streams[channel].set_interval(message_id, interval_s, self.time_s)

    def _list_loaded(self, mission_type: int) -> None:
        name, items = "FENCE_TOTAL", self._flight.fence.items
        if mission_type == MISSION:
            name, items = "MIS_TOTAL", self._flight.mission.items
            if items:
                self._flight.events.append(Text(INFO, "Flight plan received"))
        self._parameter_protocol.announce(self.parameters.record(name, len(items)))

    def _mode_changed(self) -> None:
        """Send a heartbeat at once on all channels, as recorded from 4.7-dev and 4.8-dev."""
        for channel in self._heartbeat_due_s:
            self._send(channel, self._telemetry.heartbeat(self.time_s))

    def _fence_changed(self) -> None:
        self._send_all(self._telemetry.fence_status(self.time_s))

    def _handle_target(self, message: Message, _now_s: float) -> None:
        """Handle SET_POSITION_TARGET_*: ArduPlane flies only the height in it."""
        flight = self._flight
        if flight.mode is not Mode.GUIDED:
            return
        home_m = flight.home.altitude_m
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            if message.coordinate_frame == mavlink.MAV_FRAME_LOCAL_OFFSET_NED and math.isfinite(message.z):
                flight.guided.set_altitude(flight.guided.altitude_m - message.z)
                flight.events.append(Text(INFO, f"Change alt to {flight.guided.altitude_m - home_m:.1f}"))
            return
        if message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE:
            return
        if message.coordinate_frame not in GLOBAL_FRAMES:
            flight.events.append(Text(WARNING, "Invalid coord frame"))
        elif math.isfinite(message.alt):
            relative = message.coordinate_frame not in ABSOLUTE_FRAMES
            flight.guided.set_altitude(message.alt + (home_m if relative else 0.0))
