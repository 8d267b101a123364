"""What the frames on the hub say of the vehicle and of Companion."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from companion.autopilots import NAMES, Adapter, choose
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Sender
from companion.mavlink.framing import Frame, decode
from companion.model import Vec3
from sim.flight_test.vehicle_time import VehicleTime

_COMPANION = mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE
_QUESTIONS = {
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_GET_HOME_POSITION,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
}
_TARGETS = (
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
    mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
)
_ACCEPTED = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
_GUIDED = ("GUIDED", "OFFBOARD", "GUIDED_COURSE")  # one autopilot may be flown in either of two
# Only simulations send these.
_SIMULATION_MESSAGES = {
    mavlink.MAVLINK_MSG_ID_SIMSTATE: "SIMSTATE",
    mavlink.MAVLINK_MSG_ID_SIM_STATE: "SIM_STATE",
    mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: "HIL_STATE_QUATERNION",
}
# AUTOPILOT_VERSION.uid of PX4 on a computer instead of a board.
_PX4_SIMULATION_UID = 0x4954_414C_4449_4E4F
_READ = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_STATUSTEXT,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        *_TARGETS,
        *_SIMULATION_MESSAGES,
    }
)


class Sample(NamedTuple):
    """The vehicle's position by GLOBAL_POSITION_INT, at its own time."""

    time_s: float
    place: GeoPoint
    height_m: float  # above home
    velocity_mps: Vec3

    @property
    def speed_mps(self) -> float:
        """Speed over ground."""
        return math.hypot(*self.velocity_mps[:2])


@dataclass
class Observer:
    """The newest state of the vehicle, and callbacks for what happens. Times are the vehicle's [s]."""

    time: VehicleTime = field(default_factory=VehicleTime)
    vehicle: Sender | None = None
    autopilot: int = 0
    adapter: Adapter | None = None
    another: Sender | None = None  # another autopilot at the same link
    custom_mode: int | None = None
    armed: bool = False
    in_simulation: str | None = None  # the sign of a simulation that was seen
    sample: Sample | None = None
    sequence: int | None = None
    home: GeoPoint | None = None
    version: int | None = None
    companion_s: float = -math.inf  # its newest heartbeat
    role: int | None = None  # Companion's, by its heartbeat
    on_sample: Callable[[Sample], None] = lambda _: None
    on_mode: Callable[[str], None] = lambda _: None
    on_text: Callable[[str, str], None] = lambda _who, _text: None
    on_command: Callable[[Message], None] = lambda _: None
    on_refusal: Callable[[int, int], None] = lambda _command, _result: None

    def observe(self, frame: Frame) -> None:
        """Take in a frame."""
        if frame.message_id not in _READ:
            return
        message = decode(frame)
        if message is None:
            return
        sender = Sender(frame.system_id, frame.component_id)
        if frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and self.vehicle is None:
            self._find_vehicle(message, sender)
        if self.vehicle is None:
            return
        if frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and sender != self.vehicle:
            self._look_for_another(message, sender)
        if sender == self.vehicle:
            self._observe_vehicle(message)
        elif sender == (self.vehicle.system_id, _COMPANION):
            self._observe_companion(message)

    @property
    def name(self) -> str:
        """The autopilot's name, as in configurations."""
        return next((name for name, number in NAMES.items() if number == self.autopilot), "unknown")

    @property
    def mode(self) -> str:
        """The name of the vehicle's mode."""
        if self.adapter is None or self.custom_mode is None:
            return "unknown"
        return self.adapter.mode_name(self.custom_mode)

    @property
    def guided(self) -> bool:
        """Whether it is in a mode in which Companion flies."""
        return self.mode in _GUIDED

    @property
    def on_mission(self) -> bool:
        """Whether it flies its mission."""
        return self.adapter is not None and self.mode == self.adapter.mission_mode

    def now_s(self) -> float:
        """The vehicle's time."""
        return self.time.now_s()

    def _find_vehicle(self, heartbeat: Message, sender: Sender) -> None:
        adapter = choose(heartbeat.autopilot, sender)
        if adapter is not None and sender.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1:
            self.vehicle, self.autopilot, self.adapter = sender, heartbeat.autopilot, adapter

    def _look_for_another(self, heartbeat: Message, sender: Sender) -> None:
        """Note a second autopilot: the one that is commanded may not be the one that was checked."""
        if sender.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1 and choose(heartbeat.autopilot, sender):
            self.another = sender

    def _observe_vehicle(self, message: Message) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self._observe_heartbeat(message)
        elif kind == "GLOBAL_POSITION_INT":
            self._observe_position(message)
        elif kind == "HOME_POSITION":
            self.home = GeoPoint(message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3)
        elif kind == "MISSION_CURRENT":
            self.sequence = message.seq
        elif kind == "AUTOPILOT_VERSION":
            self.version = message.flight_sw_version
            if message.uid == _PX4_SIMULATION_UID:
                self.in_simulation = self.in_simulation or "the uid in its AUTOPILOT_VERSION"
        elif kind == "STATUSTEXT":
            self.on_text("vehicle", message.text)
        elif kind == "COMMAND_ACK":
            ours = getattr(message, "target_component", 0) == _COMPANION
            if ours and message.result not in _ACCEPTED and message.command not in _QUESTIONS:
                self.on_refusal(message.command, message.result)
        elif message.get_msgId() in _SIMULATION_MESSAGES:
            self.in_simulation = self.in_simulation or _SIMULATION_MESSAGES[message.get_msgId()]

    def _observe_heartbeat(self, message: Message) -> None:
        self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        if message.base_mode & mavlink.MAV_MODE_FLAG_HIL_ENABLED:
            self.in_simulation = self.in_simulation or "the HIL flag of its heartbeat"
        if message.custom_mode != self.custom_mode:
            self.custom_mode = message.custom_mode
            self.on_mode(self.mode)

    def _observe_position(self, message: Message) -> None:
        time_s = message.time_boot_ms / 1e3
        self.time.observe(time_s)
        if self.sample is not None and time_s == self.sample.time_s:
            return
        place = GeoPoint(message.lat / 1e7, message.lon / 1e7, message.alt / 1e3)
        velocity_mps = message.vx / 100.0, message.vy / 100.0, message.vz / 100.0
        self.sample = Sample(time_s, place, message.relative_alt / 1e3, velocity_mps)
        self.on_sample(self.sample)

    def _observe_companion(self, message: Message) -> None:
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.companion_s, self.role = self.now_s(), message.custom_mode
        elif kind == "STATUSTEXT":
            self.on_text("companion", message.text)
        elif message.get_msgId() in _TARGETS or (
            kind in ("COMMAND_LONG", "COMMAND_INT") and message.command not in _QUESTIONS
        ):
            self.on_command(message)
