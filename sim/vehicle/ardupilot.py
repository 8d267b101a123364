"""A fake ArduPlane: MAVLink messages in, messages out, with the manners of the real one, good and bad."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.model import Vec2, Vec3
from sim.dynamics import Airframe
from sim.vehicle.adsb import TrafficList
from sim.vehicle.commands import Call, Commands
from sim.vehicle.events import INFO, WARNING, ItemReached, Text
from sim.vehicle.flight import STEP_S, Flight
from sim.vehicle.mission import ABSOLUTE_FRAMES, GLOBAL_FRAMES, MissionItem
from sim.vehicle.mission_protocol import MissionProtocol
from sim.vehicle.modes import Mode
from sim.vehicle.parameters import Parameter, Parameters
from sim.vehicle.streams import Streams
from sim.vehicle.telemetry import Telemetry

_HEARTBEAT_PERIOD_S = 1.0
_STATUSTEXT_BYTES = 50
_PARAMETER_CHANGED = 65535  # PARAM_VALUE.param_index of a value that was not asked for by its place
_TOLERANCE_S = 1e-6
_BOOTED_BEFORE_S = 30.0


class Outgoing(NamedTuple):
    """A message to send on a channel, from `FakeArduPlane.system_id`, component 1."""

    channel: int
    message: Message


@dataclass(frozen=True, slots=True)
class Truth:
    """What really happens, for scoring. `position_m` is north-east-down from home, down 0 at sea level."""

    time_s: float
    place: GeoPoint
    position_m: Vec3
    velocity_mps: Vec3
    airspeed_mps: float
    heading_rad: float
    bank_rad: float
    mode: Mode
    armed: bool
    on_ground: bool
    mission_sequence: int
    mission_completed: bool


class FakeArduPlane:
    """An ArduPlane without I/O and without a clock.

    `receive()` takes what a channel heard, `step()` lets time pass and returns what to send. Flight moves in
    equal steps of `STEP_S` from the moment of construction, so how often `step()` is called changes nothing.
    """

    component_id = 1

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
    ) -> None:
        """Stand disarmed in MANUAL at home at `now_s` [s, Unix], `mission` (without its home item) loaded."""
        self.system_id = system_id
        self.parameters = Parameters()
        self.parameters.record("SYSID_THISMAV", system_id)
        self.parameters.record("MIS_TOTAL", len(mission) + 1 if mission else 0)
        self.flight = Flight(
            home,
            self.parameters,
            items=mission,
            heading_rad=heading_rad,
            wind_mps=wind_mps,
            airframe=airframe,
        )
        self._start_s = now_s
        self._steps = 0
        self._outbox: list[Outgoing] = []
        self._streams: dict[int, Streams] = {}
        self._heartbeat_due_s: dict[int, float] = {}
        self._traffic = TrafficList(self.parameters)
        self._telemetry = Telemetry(self.flight, now_s - _BOOTED_BEFORE_S)
        self._missions = MissionProtocol(self.flight, self._send, self._announce)
        self._commands = Commands(self.flight, self._telemetry, self._streams, self._send)

    @classmethod
    def airborne(
        cls,
        home: GeoPoint,
        now_s: float,
        *,
        mission: Sequence[MissionItem],
        position: GeoPoint,
        course_rad: float,
        sequence: int = 1,
        wind_mps: Vec2 = (0.0, 0.0),
        airframe: Airframe | None = None,
        system_id: int = 1,
    ) -> "FakeArduPlane":
        """The same in the air: armed, in AUTO, level at cruise speed on the way to item `sequence`."""
        vehicle = cls(home, now_s, mission=mission, wind_mps=wind_mps, airframe=airframe, system_id=system_id)
        vehicle.flight.start_in_air(position, course_rad, sequence)
        vehicle.flight.events.clear()
        return vehicle

    @property
    def time_s(self) -> float:
        """The time up to which it has flown [s, Unix]."""
        return self._start_s + self._steps * STEP_S

    @property
    def truth(self) -> Truth:
        """Where it really is and what it really does."""
        flight = self.flight
        return Truth(
            time_s=self.time_s,
            place=flight.place,
            position_m=flight.aircraft.position_m,
            velocity_mps=flight.velocity_mps,
            airspeed_mps=flight.aircraft.airspeed_mps,
            heading_rad=flight.aircraft.heading_rad,
            bank_rad=flight.aircraft.bank_rad,
            mode=flight.mode,
            armed=flight.armed,
            on_ground=flight.on_ground,
            mission_sequence=flight.mission.current,
            mission_completed=flight.mission.completed,
        )

    def add_channel(self, channel: int, *, stream_rate_hz: float = 2.0) -> None:
        """Open a telemetry channel; `stream_rate_hz` stands for its SRn_* parameters, 0 keeps it quiet."""
        self._streams[channel] = Streams(self.time_s, stream_rate_hz)
        self._heartbeat_due_s[channel] = self.time_s

    def set_mode(self, mode: Mode) -> None:
        """The pilot changes the mode on his transmitter."""
        self.flight.set_mode(mode)

    def arm(self) -> None:
        """The pilot arms."""
        self.flight.arm()

    # --- time ---

    def step(self, now_s: float) -> list[Outgoing]:
        """Fly on until `now_s` and return what has to be sent since the last call, oldest first."""
        while self._start_s + (self._steps + 1) * STEP_S <= now_s + _TOLERANCE_S:
            self.flight.advance()
            self._steps += 1
            if self._streams:
                self._talk()
            else:
                self.flight.events.clear()
        self._tell_events()
        outbox, self._outbox = self._outbox, []
        return outbox

    def _talk(self) -> None:
        """Send what is due after one step."""
        now_s = self.time_s
        self._telemetry.consume(STEP_S)
        self._missions.step(now_s)
        self._tell_events()
        for channel, streams in self._streams.items():
            asked_for = streams.interval_s(mavlink.MAVLINK_MSG_ID_HEARTBEAT) > 0.0
            if not asked_for and now_s + _TOLERANCE_S >= self._heartbeat_due_s[channel]:
                self._heartbeat_due_s[channel] = now_s + _HEARTBEAT_PERIOD_S
                self._send(channel, self._telemetry.heartbeat(now_s))
            for message_id in streams.due(now_s):
                if message_id == mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE:
                    message = self._traffic.next_for(channel, now_s)
                elif message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                    message = self._telemetry.heartbeat(now_s)
                else:
                    message = self._telemetry.build(message_id, now_s)
                if message is not None:
                    self._send(channel, message)

    def _tell_events(self) -> None:
        events = self.flight.events
        if not events:
            return
        for event in events:
            if isinstance(event, ItemReached):
                self._send_all(mavlink.MAVLink_mission_item_reached_message(seq=event.sequence))
            else:
                text = event.text.encode("ascii", errors="replace")[:_STATUSTEXT_BYTES]
                self._send_all(mavlink.MAVLink_statustext_message(severity=event.severity, text=text))
        events.clear()

    def _send(self, channel: int, message: Message) -> None:
        header = message.get_header()
        header.srcSystem, header.srcComponent = self.system_id, self.component_id
        self._outbox.append(Outgoing(channel, message))

    def _send_all(self, message: Message) -> None:
        for channel in self._streams:
            self._send(channel, message)

    def _announce(self, parameter: Parameter) -> None:
        self._send_all(_param_value(parameter, len(self.parameters), _PARAMETER_CHANGED))

    # --- messages ---

    def receive(self, message: Message, now_s: float, channel: int = 0) -> None:
        """Take a message that `channel` heard. What is not for us is ignored."""
        kind = message.get_type()
        if kind == "ADSB_VEHICLE":
            self._traffic.receive(message, self.flight.place, now_s, channel)
            return
        if not self._is_for_us(message):
            return
        if channel not in self._streams:
            self.add_channel(channel)
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            result = self._commands.run(Call.from_message(message, channel, now_s))
            self._acknowledge(message.command, result, sender, channel)
        elif kind == "SET_MODE":
            result = self._commands.set_custom_mode(message.base_mode, message.custom_mode)
            self._acknowledge(mavlink.MAVLINK_MSG_ID_SET_MODE, result, sender, channel)
        elif kind in ("SET_POSITION_TARGET_GLOBAL_INT", "SET_POSITION_TARGET_LOCAL_NED"):
            self._take_target(message)
        elif kind.startswith("PARAM_"):
            self._take_parameter(message, channel)
        elif kind == "REQUEST_DATA_STREAM":
            rate_hz = message.req_message_rate if message.start_stop else 0
            self._streams[channel].set_group(message.req_stream_id, rate_hz, self.time_s)
        elif kind == "TIMESYNC" and message.tc1 == 0:
            boot_ns = self._telemetry.boot_ms(now_s) * 1_000_000
            self._send(channel, mavlink.MAVLink_timesync_message(tc1=boot_ns, ts1=message.ts1))
        elif kind == "PING" and message.target_system == 0 and message.target_component == 0:
            answer = mavlink.MAVLink_ping_message(message.time_usec, message.seq, *sender)
            self._send(channel, answer)
        else:
            self._missions.receive(message, sender, channel, now_s)

    def _is_for_us(self, message: Message) -> bool:
        target = (getattr(message, "target_system", 0), getattr(message, "target_component", 0))
        return target in ((self.system_id, self.component_id), (self.system_id, 0), (0, 0))

    def _acknowledge(self, command: int, result: int, sender: tuple[int, int], channel: int) -> None:
        self._send(
            channel,
            mavlink.MAVLink_command_ack_message(
                command=command,
                result=int(result),
                target_system=sender[0],
                target_component=sender[1],
            ),
        )

    def _take_target(self, message: Message) -> None:
        """SET_POSITION_TARGET_*: of all that these carry, ArduPlane flies the height alone."""
        flight = self.flight
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

    def _take_parameter(self, message: Message, channel: int) -> None:
        kind = message.get_type()
        if kind == "PARAM_REQUEST_LIST":
            for parameter in self.parameters:
                self._send(channel, _param_value(parameter, len(self.parameters), parameter.index))
        elif kind == "PARAM_REQUEST_READ":
            by_name = message.param_index < 0
            found = (
                self.parameters.find(message.param_id) if by_name else self.parameters.at(message.param_index)
            )
            if found is not None:
                self._send(channel, _param_value(found, len(self.parameters), found.index))
        elif kind == "PARAM_SET":
            changed = self.parameters.set(message.param_id, message.param_value)
            if changed is not None:
                self.flight.apply_parameters()
                self._announce(changed)


def _param_value(parameter: Parameter, count: int, index: int) -> Message:
    return mavlink.MAVLink_param_value_message(
        param_id=parameter.name.encode("ascii"),
        param_value=parameter.value,
        param_type=parameter.type,
        param_count=count,
        param_index=index,
    )
