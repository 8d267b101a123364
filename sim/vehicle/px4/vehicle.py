"""A fake PX4 fixed wing: MAVLink messages in, messages out; it behaves as the real one, quirks included."""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, ClassVar

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.model import Vec2
from sim.dynamics import Airframe
from sim.vehicle.mission import MissionItem
from sim.vehicle.parameter_protocol import Bytewise
from sim.vehicle.px4.commands import Px4Commands
from sim.vehicle.px4.flight import Px4Flight
from sim.vehicle.px4.modes import Firmware, Px4Mode
from sim.vehicle.px4.parameters import default_parameters
from sim.vehicle.px4.setpoint import setpoint_from
from sim.vehicle.px4.telemetry import DEFAULT_STREAM, Px4Telemetry
from sim.vehicle.px4.traffic import DetectAndAvoid, EchoedTraffic, Px4Avoidance
from sim.vehicle.streams import Streams
from sim.vehicle.vehicle import BOOTED_BEFORE_S, FakeVehicle

_ADSB_VEHICLE = mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE
_HEARTBEAT_AFTER_MODE_S = 0.12


class FakePx4(FakeVehicle):
    """A PX4 without I/O and without a clock."""

    name: ClassVar[str] = "PX4"
    first_item: ClassVar[int] = 0
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
        firmware: Firmware = "1.16",
        parameters: Mapping[str, float] | None = None,
        geoid_height_m: float = 0.0,
        strict: bool = True,
    ) -> None:
        """Start disarmed in MANUAL at home at `now_s` [s, Unix], with `mission` loaded.

        `firmware` is the imitated version; `parameters` override its defaults. `strict`: entering OFFBOARD
        directly with position and velocity always invalidates the controller's setpoint; in the real one this
        is rare, and since 1.18 it never does.
        """
        values = default_parameters(firmware)
        for name, value in (parameters or {}).items():
            values.record(name, value)
        values.record("MAV_SYS_ID", system_id)
        flight = Px4Flight(
            home,
            values,
            items=mission,
            heading_rad=heading_rad,
            wind_mps=wind_mps,
            airframe=airframe,
            strict=strict,
            firmware=firmware,
        )
        telemetry = Px4Telemetry(flight, now_s - BOOTED_BEFORE_S, geoid_height_m, firmware)
        super().__init__(flight, telemetry, Bytewise(), now_s, system_id=system_id, asks_for_int=True)
        self._flight: Px4Flight = flight
        self._traffic = EchoedTraffic()
        self._avoidance = (
            DetectAndAvoid(flight, self._heard) if firmware == "1.18" else Px4Avoidance(flight, self._heard)
        )
        self._commands: Px4Commands = Px4Commands(flight, telemetry, self._streams, self._send)

    @classmethod
    def airborne(
        cls,
        home: GeoPoint,
        now_s: float,
        *,
        position: GeoPoint,
        course_rad: float,
        sequence: int = 0,
        **options: Any,
    ) -> "FakePx4":
        """A vehicle in the air: armed, in MISSION, level at cruise speed on the way to item `sequence`."""
        vehicle = cls(home, now_s, **options)
        vehicle.flight.start_in_air(position, course_rad, sequence)
        return vehicle

    @property
    def flight(self) -> Px4Flight:
        """The aircraft and its modes."""
        return self._flight

    def set_mode(self, mode: IntEnum | str) -> None:
        """Change the mode from the pilot's transmitter; `ValueError` for an unknown mode."""
        if isinstance(mode, str):
            if mode not in Px4Mode.__members__:
                raise ValueError(f"PX4 has no mode {mode!r}")
            mode = Px4Mode[mode]
        self._flight.set_mode(Px4Mode(mode))

    def _receive_report(self, report: Message, _now_s: float, _channel: int) -> None:
        self._traffic.receive(report, self._streams)

    def _reports_for(self, channel: int, _now_s: float) -> list[Message]:
        return self._traffic.take(channel)

    def _clear_reports(self) -> None:
        self._traffic.clear()

    def _stream(self, channel: int, streams: Streams, now_s: float) -> None:
        """Stream what was requested; traffic goes out at once unless another rate was requested."""
        super()._stream(channel, streams, now_s)
        if streams.is_stopped(_ADSB_VEHICLE):
            self._traffic.take(channel)
        elif streams.interval_s(_ADSB_VEHICLE) == 0.0:
            for report in self._traffic.take(channel):
                self._send(channel, report)

    def _avoid_traffic(self, now_s: float) -> None:
        self._avoidance.step(now_s)

    def _handle_set_mode(self, message: Message) -> tuple[int, int]:
        main, sub = message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24 & 0xFF
        return mavlink.MAV_CMD_DO_SET_MODE, self._commands.set_mode(message.base_mode, main, sub)

    def _handle_data_stream(self, _message: Message, _channel: int) -> None:
        """Ignore REQUEST_DATA_STREAM, as PX4 does."""

    def _list_loaded(self, _mission_type: int) -> None:
        """Do nothing: MISSION_ACK is the only answer."""

    def _mode_changed(self) -> None:
        """Send an early heartbeat on all channels; 1.18 waits for the next second."""
        if self._flight.firmware == "1.18":
            return
        for channel in self._heartbeat_due_s:
            due_s = self.time_s + _HEARTBEAT_AFTER_MODE_S
            self._heartbeat_due_s[channel] = min(self._heartbeat_due_s[channel], due_s)

    def _fence_changed(self) -> None:
        """Do nothing: PX4 sends no FENCE_STATUS; text and mode report the breach."""

    def _handle_target(self, message: Message, now_s: float) -> None:
        flight = self._flight
        setpoint = setpoint_from(message, now_s - self._start_s, flight.frame, flight.home.altitude_m)
        if setpoint is not None:
            flight.receive(setpoint)
