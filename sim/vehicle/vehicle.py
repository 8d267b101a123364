"""The part of a fake vehicle that both autopilots share, without I/O and without a clock."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import IntEnum
from typing import ClassVar

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.commands import Call, Commands
from sim.vehicle.flight import STEP_S
from sim.vehicle.mission_flight import MissionFlight
from sim.vehicle.mission_protocol import MissionProtocol
from sim.vehicle.outputs import Event, FenceChanged, ItemReached, ModeChanged, Outgoing, Text, Truth
from sim.vehicle.parameter_protocol import ParameterCoding, ParameterProtocol
from sim.vehicle.parameters import Parameters
from sim.vehicle.peripherals import Sticks
from sim.vehicle.streams import Streams
from sim.vehicle.telemetry import AirspeedSensor, Telemetry
from sim.vehicle.traffic import HeardTraffic

BOOTED_BEFORE_S = 30.0
_HEARTBEAT_PERIOD_S = 1.0
_STATUSTEXT_BYTES = 50
_TOLERANCE_S = 1e-6
# RC_CHANNELS_OVERRIDE
_LEFT_ALONE = 65_535
_CENTRE_US, _REACH_US = 1500, 500
_HEARTBEAT, _ADSB_VEHICLE = mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE


class FakeVehicle(ABC):
    """A vehicle of either autopilot.

    `receive()` takes a message from a channel; `step()` advances time and returns the messages to send. The
    flight moves in equal steps of `STEP_S` from construction on, so the rhythm of the calls has no effect.
    With these methods, tests make it fail as real vehicles do: `refuse`, `silence`, `withhold`, `set_clock`,
    `reboot`, `fail_safe`, `move_sticks`, `show_vtol_state`.
    """

    component_id = 1
    name: ClassVar[str]  # of the autopilot, for display
    first_item: ClassVar[int]  # sequence number of the first mission item that is flown
    default_stream: ClassVar[Sequence[int]]
    _commands: Commands

    def __init__(
        self,
        flight: MissionFlight,
        telemetry: Telemetry,
        coding: ParameterCoding,
        now_s: float,
        *,
        system_id: int,
        asks_for_int: bool,
    ) -> None:
        """Start the vehicle's time at `now_s` [s, Unix]."""
        self.system_id = system_id
        self.boots = 1
        self._flight = flight
        self._telemetry = telemetry
        self._start_s = now_s
        self._steps = 0
        self._outbox: list[Outgoing] = []
        self._streams: dict[int, Streams] = {}
        self._heartbeat_due_s: dict[int, float] = {}
        self._refused: dict[int, int] = {}
        self._silenced: dict[int, bool] = {}
        self._withheld: set[int] = set()
        self._heard = HeardTraffic()
        self._parameter_protocol = ParameterProtocol(self.parameters, coding, self._send, self._send_all)
        self._missions = MissionProtocol(flight, self._send, self._list_loaded, asks_for_int=asks_for_int)

    # --- what each autopilot implements ---

    @abstractmethod
    def set_mode(self, mode: IntEnum | str) -> None:
        """Change the mode from the pilot's transmitter; `ValueError` for an unknown mode."""

    @abstractmethod
    def _receive_report(self, report: Message, now_s: float, channel: int) -> None:
        """Handle an ADSB_VEHICLE from a receiver."""

    @abstractmethod
    def _reports_for(self, channel: int, now_s: float) -> list[Message]:
        """The ADSB_VEHICLE messages that are due on a channel."""

    @abstractmethod
    def _clear_reports(self) -> None:
        """Delete all traffic reports."""

    @abstractmethod
    def _handle_target(self, message: Message, now_s: float) -> None:
        """Handle SET_POSITION_TARGET_*."""

    @abstractmethod
    def _handle_set_mode(self, message: Message) -> tuple[int, int]:
        """Handle SET_MODE; the command and result to acknowledge."""

    @abstractmethod
    def _handle_data_stream(self, message: Message, channel: int) -> None:
        """Handle REQUEST_DATA_STREAM."""

    @abstractmethod
    def _list_loaded(self, mission_type: int) -> None:
        """Called after a mission or fence was uploaded or cleared."""

    @abstractmethod
    def _mode_changed(self) -> None:
        """Called after the flight changed its mode."""

    @abstractmethod
    def _fence_changed(self) -> None:
        """Called after a fence breach began or ended."""

    @abstractmethod
    def _avoid_traffic(self, now_s: float) -> None:
        """Run the autopilot's own avoidance, once a step."""

    # --- state ---

    @property
    def flight(self) -> MissionFlight:
        """The aircraft and its modes."""
        return self._flight

    @property
    def parameters(self) -> Parameters:
        """The parameters."""
        return self._flight.parameters

    @property
    def time_s(self) -> float:
        """The time up to which the vehicle has flown [s, Unix]."""
        return self._start_s + self._steps * STEP_S

    @property
    def truth(self) -> Truth:
        """The true state, for scoring."""
        flight = self._flight
        return Truth(
            time_s=self.time_s,
            place=flight.place,
            position_m=flight.aircraft.position_m,
            velocity_mps=flight.velocity_mps,
            airspeed_mps=flight.aircraft.airspeed_mps,
            heading_rad=flight.aircraft.heading_rad,
            bank_rad=flight.aircraft.bank_rad,
            mode=flight.mode.name,
            companion_flies=flight.companion_flies,
            on_mission=flight.on_mission,
            uncontrolled=flight.uncontrolled,
            armed=flight.armed,
            on_ground=flight.on_ground,
            mission_sequence=flight.mission.current,
            mission_completed=flight.mission.completed,
        )

    # --- actions of pilots and tests ---

    def add_channel(self, channel: int, *, stream_rate_hz: float = 2.0) -> None:
        """Open a telemetry channel; `stream_rate_hz` is the rate of the default messages, 0 for none."""
        streamed = self._telemetry.built | {_ADSB_VEHICLE, _HEARTBEAT}
        self._streams[channel] = Streams(
            self.time_s, stream_rate_hz, default=self.default_stream, streamed=streamed
        )
        self._heartbeat_due_s[channel] = self.time_s

    def start_mission(self) -> None:
        """Change to the mode that flies the mission."""
        self._flight.enter_mission()

    def arm(self) -> None:
        """Arm from the pilot's transmitter."""
        self._flight.arm()

    def move_sticks(
        self, roll: float = 0.0, pitch: float = 0.0, throttle: float = 0.0, yaw: float = 0.0
    ) -> None:
        """Move the pilot's sticks; roll has an effect in the piloted modes."""
        self._flight.sticks = Sticks(roll, pitch, throttle, yaw)

    def fail_safe(self, failing: bool, *, return_home: bool = False) -> None:
        """Begin or end a failsafe (`system_status` CRITICAL), with or without a return home."""
        self._flight.in_trouble = failing
        if failing and return_home:
            self._flight.return_home()

    def refuse(self, command: int, result: int | None) -> None:
        """Answer a command with `result` and do not execute it; None restores the normal answer."""
        if result is None:
            self._refused.pop(command, None)
        else:
            self._refused[command] = result

    def silence(self, command: int, *, does: bool | None) -> None:
        """Send no acknowledgement of a command; `does`: execute it or not, None restores the answer."""
        if does is None:
            self._silenced.pop(command, None)
        else:
            self._silenced[command] = does

    def withhold(self, message_id: int, withheld: bool) -> None:
        """Never send a message, even on request; False sends it again."""
        (self._withheld.add if withheld else self._withheld.discard)(message_id)

    def set_clock(self, error_s: float) -> None:
        """Make the Unix time in SYSTEM_TIME wrong by `error_s`."""
        self._telemetry.clock_error_s = error_s

    def remove_airspeed_sensor(self, shown: AirspeedSensor) -> None:
        """Fly without an airspeed sensor; `shown` is what VFR_HUD shows as airspeed instead."""
        self._telemetry.airspeed_sensor = shown

    def show_vtol_state(self, vtol_state: int) -> None:
        """Report this MAV_VTOL_STATE; the flight itself stays that of a wing."""
        self._telemetry.vtol_state = vtol_state

    def reboot(self, now_s: float) -> None:
        """Restart in flight: it stays armed and in its mode; boot time, commands and streams are reset.

        `boots` increases; the encoder of its messages must then restart the sequence numbers.
        """
        self._outbox = self.step(now_s)
        self.boots += 1
        self._telemetry.reboot(now_s)
        self._missions.cancel()
        self._heard.clear()
        self._clear_reports()
        self._flight.forget_commands()
        for channel, streams in list(self._streams.items()):
            self.add_channel(channel, stream_rate_hz=streams.default_rate_hz)

    # --- time ---

    def step(self, now_s: float) -> list[Outgoing]:
        """Fly until `now_s`; returns the messages to send since the last call, oldest first."""
        while self._start_s + (self._steps + 1) * STEP_S <= now_s + _TOLERANCE_S:
            self._flight.advance()
            self._steps += 1
            self._avoid_traffic(self.time_s)
            if self._streams:
                self._send_due()
            else:
                self._flight.events.clear()
        self._send_events()
        outbox, self._outbox = self._outbox, []
        return outbox

    def _send_due(self) -> None:
        """Send the messages that are due after one step."""
        now_s = self.time_s
        self._telemetry.consume(STEP_S)
        self._missions.step(now_s)
        self._send_events()
        for channel, streams in self._streams.items():
            requested = streams.interval_s(_HEARTBEAT) > 0.0
            if not requested and now_s + _TOLERANCE_S >= self._heartbeat_due_s[channel]:
                self._heartbeat_due_s[channel] = now_s + _HEARTBEAT_PERIOD_S
                self._send(channel, self._telemetry.heartbeat(now_s))
            self._stream(channel, streams, now_s)

    def _stream(self, channel: int, streams: Streams, now_s: float) -> None:
        for message_id in streams.due(now_s):
            if message_id == _ADSB_VEHICLE:
                for report in self._reports_for(channel, now_s):
                    self._send(channel, report)
                continue
            message = self._telemetry.build(message_id, now_s)
            if message is not None:
                self._send(channel, message)

    def _send_events(self) -> None:
        events = self._flight.events
        while events:
            self._send_event(events.pop(0))

    def _send_event(self, event: Event) -> None:
        if isinstance(event, ItemReached):
            self._send_all(mavlink.MAVLink_mission_item_reached_message(seq=event.sequence))
        elif isinstance(event, Text):
            text = event.text.encode("ascii", errors="replace")[:_STATUSTEXT_BYTES]
            self._send_all(mavlink.MAVLink_statustext_message(severity=event.severity, text=text))
        elif isinstance(event, FenceChanged):
            self._fence_changed()
        elif isinstance(event, ModeChanged):
            self._mode_changed()

    def _send(self, channel: int, message: Message) -> None:
        if message.get_msgId() in self._withheld:
            return
        header = message.get_header()
        header.srcSystem, header.srcComponent = self.system_id, self.component_id
        self._outbox.append(Outgoing(channel, message))

    def _send_all(self, message: Message) -> None:
        for channel in self._streams:
            self._send(channel, message)

    # --- messages ---

    def receive(self, message: Message, now_s: float, channel: int = 0) -> None:
        """Handle a message from `channel`; messages for other vehicles are ignored."""
        kind = message.get_type()
        if kind == "ADSB_VEHICLE":
            self._heard.receive(message, now_s)
            self._receive_report(message, now_s, channel)
            return
        if not self._is_for_us(message):
            return
        if channel not in self._streams:
            self.add_channel(channel)
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            self._handle_command(Call.from_message(message, channel, now_s), sender)
        elif kind == "SET_MODE":
            self._acknowledge(*self._handle_set_mode(message), sender, channel)
        elif kind in ("SET_POSITION_TARGET_GLOBAL_INT", "SET_POSITION_TARGET_LOCAL_NED"):
            self._handle_target(message, now_s)
        elif kind.startswith("PARAM_"):
            if self._parameter_protocol.receive(message, channel):
                self._flight.apply_parameters()
        elif kind == "RC_CHANNELS_OVERRIDE":
            self._override_sticks(message)
        elif kind == "REQUEST_DATA_STREAM":
            self._handle_data_stream(message, channel)
        elif kind == "TIMESYNC" and message.tc1 == 0:
            boot_ns = self._telemetry.boot_ms(now_s) * 1_000_000
            self._send(channel, mavlink.MAVLink_timesync_message(tc1=boot_ns, ts1=message.ts1))
        elif kind == "PING" and message.target_system == 0 and message.target_component == 0:
            answer = mavlink.MAVLink_ping_message(message.time_usec, message.seq, *sender)
            self._send(channel, answer)
        else:
            self._missions.receive(message, sender, channel, now_s)

    def _override_sticks(self, message: Message) -> None:
        """Take roll and pitch from a ground station; a channel of 0 is given back to the centered sticks."""
        roll, pitch = _deflection(message.chan1_raw), _deflection(message.chan2_raw)
        present = self._flight.sticks
        self._flight.sticks = Sticks(
            present.roll if roll is None else roll,
            present.pitch if pitch is None else pitch,
            present.throttle,
            present.yaw,
        )

    def _handle_command(self, call: Call, sender: tuple[int, int]) -> None:
        silent = call.command in self._silenced
        if silent and not self._silenced[call.command]:
            return
        refused = self._refused.get(call.command)
        result = self._commands.run(call) if refused is None else refused
        if not silent:
            self._acknowledge(call.command, result, sender, call.channel)

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


def _deflection(pulse_us: int) -> float | None:
    """The deflection of a stick from -1 to 1; `None` when the channel is left alone."""
    if pulse_us == _LEFT_ALONE:
        return None
    return 0.0 if pulse_us == 0 else (pulse_us - _CENTRE_US) / _REACH_US
