"""A fake PX4 fixed wing: MAVLink messages in, messages out, with the real one's manners, good and bad."""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, ClassVar

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.model import Vec2
from sim.dynamics import Airframe
from sim.vehicle.events import CRITICAL, Text
from sim.vehicle.mission import MissionItem
from sim.vehicle.parameter_protocol import Bytewise
from sim.vehicle.px4_commands import Px4Commands
from sim.vehicle.px4_flight import Px4Flight
from sim.vehicle.px4_modes import Px4Mode
from sim.vehicle.px4_parameters import default_parameters
from sim.vehicle.px4_setpoint import setpoint_from
from sim.vehicle.px4_telemetry import DEFAULT_STREAM, Px4Telemetry
from sim.vehicle.px4_traffic import EchoedTraffic
from sim.vehicle.streams import Streams
from sim.vehicle.vehicle import BOOTED_BEFORE_S, FakeVehicle

_ADSB_VEHICLE = mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE
_HEARTBEAT_AFTER_MODE_S = 0.12
_TRAFFIC_ACTIONS = {2: Px4Mode.RETURN, 3: Px4Mode.LAND, 4: Px4Mode.HOLD}  # NAV_TRAFF_AVOID


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
        parameters: Mapping[str, float] | None = None,
        geoid_height_m: float = 0.0,
        strict: bool = True,
    ) -> None:
        """Stand disarmed in MANUAL at home at `now_s` [s, Unix], `mission` loaded.

        `parameters` are set besides its defaults. `strict`: entering OFFBOARD straight with position and
        velocity always poisons the controller, which the real one does rarely.
        """
        values = default_parameters()
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
        )
        telemetry = Px4Telemetry(flight, now_s - BOOTED_BEFORE_S, geoid_height_m)
        super().__init__(flight, telemetry, Bytewise(), now_s, system_id=system_id, asks_for_int=True)
        self._flight: Px4Flight = flight
        self._traffic = EchoedTraffic()
        self._traffic_near = False
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
        """The same in the air: armed, in MISSION, level at cruise speed on the way to item `sequence`."""
        vehicle = cls(home, now_s, **options)
        vehicle.flight.start_in_air(position, course_rad, sequence)
        return vehicle

    @property
    def flight(self) -> Px4Flight:
        """The aircraft and its modes."""
        return self._flight

    def set_mode(self, mode: IntEnum | str) -> None:
        """The pilot changes the mode on his transmitter; `ValueError` for one that there is not."""
        if isinstance(mode, str):
            if mode not in Px4Mode.__members__:
                raise ValueError(f"PX4 has no mode {mode!r}")
            mode = Px4Mode[mode]
        self._flight.set_mode(Px4Mode(mode))

    def _hear_report(self, report: Message, _now_s: float, _channel: int) -> None:
        self._traffic.receive(report, self._streams)

    def _reports_for(self, channel: int, _now_s: float) -> list[Message]:
        return self._traffic.take(channel)

    def _forget_reports(self) -> None:
        self._traffic.clear()

    def _stream(self, channel: int, streams: Streams, now_s: float) -> None:
        """Besides what was asked for: traffic at once, as long as nobody asked for another rate."""
        super()._stream(channel, streams, now_s)
        if streams.is_stopped(_ADSB_VEHICLE):
            self._traffic.take(channel)
        elif streams.interval_s(_ADSB_VEHICLE) == 0.0:
            for report in self._traffic.take(channel):
                self._send(channel, report)

    def _avoid_traffic(self, now_s: float) -> None:
        """NAV_TRAFF_AVOID: 1 only warns, more change the mode, out of OFFBOARD as well."""
        flight, values = self._flight, self.parameters
        wanted = int(values["NAV_TRAFF_AVOID"])
        near = not flight.on_ground and wanted > 0
        near = near and self._heard.is_within(
            flight.place, values["NAV_TRAFF_A_HOR"], values["NAV_TRAFF_A_VER"], now_s
        )
        if near and not self._traffic_near:
            flight.events.append(Text(CRITICAL, "Traffic alert"))
            if wanted in _TRAFFIC_ACTIONS:
                flight.set_mode(_TRAFFIC_ACTIONS[wanted])
        self._traffic_near = near

    def _take_set_mode(self, message: Message) -> tuple[int, int]:
        main, sub = message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24 & 0xFF
        return mavlink.MAV_CMD_DO_SET_MODE, self._commands.set_mode(message.base_mode, main, sub)

    def _take_data_stream(self, _message: Message, _channel: int) -> None:
        """REQUEST_DATA_STREAM is not understood."""

    def _list_loaded(self, _mission_type: int) -> None:
        """MISSION_ACK says it all."""

    def _mode_changed(self) -> None:
        """A heartbeat soon tells everybody."""
        for channel in self._heartbeat_due_s:
            due_s = self.time_s + _HEARTBEAT_AFTER_MODE_S
            self._heartbeat_due_s[channel] = min(self._heartbeat_due_s[channel], due_s)

    def _fence_changed(self) -> None:
        """Told by a text and by the mode; there is no FENCE_STATUS."""

    def _take_target(self, message: Message, now_s: float) -> None:
        flight = self._flight
        setpoint = setpoint_from(message, now_s - self._start_s, flight.frame, flight.home.altitude_m)
        if setpoint is not None:
            flight.take(setpoint)
