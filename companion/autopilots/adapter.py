"""What every autopilot must be able to tell and do; the engine knows no other."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from companion.autopilots.commands import CommandRetrier
from companion.autopilots.limits import ParameterTable
from companion.avoidance.envelope import Control
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult, Fact, Sender
from companion.model import Guidance, PriorFlightState, Vec3


@dataclass(frozen=True, slots=True)
class GuidanceCommand:
    """Guidance with what a setpoint needs beside it: where we are, how fast over ground, how far to bank."""

    guidance: Guidance
    position: GeoPoint
    velocity_mps: Vec3
    airspeed_mps: float
    max_bank_rad: float


@dataclass(frozen=True, slots=True)
class RefusedValue:
    """A course [rad], airspeed [m/s] or height [m above mean sea level] that the autopilot will not fly."""

    control: Control
    value: float


class Adapter(ABC):
    """One autopilot, addressed at `target`. Methods return the messages to send; nothing is sent in here.

    Angles and lengths are those of the house; `guidance.altitude_m` is height above mean sea level.
    """

    name: ClassVar[str]
    # Messages to ask for, with the interval wanted [s].
    intervals_s: ClassVar[dict[int, float]]
    # The commands whose answers are about modes.
    mode_commands: ClassVar[frozenset[int]] = frozenset(
        {mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_DO_REPOSITION}
    )
    # For so long `entering` is streamed before the guided mode is asked for, `leaving` before another one is.
    entry_s: ClassVar[float] = 0.0
    exit_s: ClassVar[float] = 0.0
    # Modes without a mission that hold a circle or a course: flown back to before they are entered again.
    places: ClassVar[frozenset[str]] = frozenset()
    courses: ClassVar[frozenset[str]] = frozenset()
    # The parameters that tell of the aircraft's limits, its fence and its mission.
    parameters: ClassVar[ParameterTable]

    def __init__(self, target: Sender) -> None:
        self.target = target
        self.desk = CommandRetrier()

    @staticmethod
    @abstractmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""

    def is_guided(self, custom_mode: int) -> bool:
        """Whether this is the mode in which our setpoints are obeyed."""
        return custom_mode == self.guided_mode

    @property
    @abstractmethod
    def guided_mode(self) -> int:
        """The custom mode in which our setpoints are obeyed."""

    @property
    @abstractmethod
    def fallback_mode(self) -> int:
        """The mode to leave the aircraft in when it refuses the former one: there it looks after itself."""

    @abstractmethod
    def left_behind_mode(self) -> int | None:
        """The mode it is in soon after a companion that flew it was killed; `None`: that says nothing."""

    @property
    def loses_itself_in_climbs(self) -> bool:
        """Whether its controller may be lost when the guided mode ends in a climb or descent, by anyone."""
        return False

    @property
    def left_to_itself_is_safe(self) -> bool:
        """Whether it takes up a mode of its own, and no guided one, when it hears nothing from us."""
        return self.left_behind_mode() not in (None, self.guided_mode)

    @abstractmethod
    def set_mode(self, custom_mode: int) -> Message:
        """The request for a mode; its command is one of `mode_commands`."""

    def give_back(self, before: PriorFlightState) -> list[Message]:
        """The request for the former mode, with its target where the autopilot would not keep it."""
        return [self.set_mode(before.mode)]

    def entering(self, flown: GuidanceCommand, now_s: float) -> list[Message]:  # noqa: ARG002
        """What is streamed while the guided mode is being entered: called at every tick."""
        return []

    @abstractmethod
    def command(self, flown: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """Fly this: called at every tick while flying; `urgent` when the decision was made just now."""

    def setpoint_invalid(self, now_s: float) -> bool:  # noqa: ARG002
        """Whether the autopilot's controller has lost itself, and only the pilot's sticks fly."""
        return False

    def leaving(self, flown: GuidanceCommand, now_s: float) -> list[Message]:  # noqa: ARG002
        """What is streamed while the guided mode is being left: called at every tick until it is."""
        return []

    def observe(self, fact: Fact, now_s: float) -> None:
        """Take note of what the autopilot says: answers to commands, parameters."""
        if isinstance(fact, CommandResult):
            self.desk.answered(fact, now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Commands that are due to be sent again."""
        return self.desk.due(now_s)

    @property
    def borrowed(self) -> dict[str, float]:
        """Parameters of the autopilot that we changed for a while, with the values to put back."""
        return {}

    def put_back(self, values: dict[str, float]) -> None:  # noqa: B027 - most borrow nothing
        """Put back what another companion, since killed, had borrowed."""

    @abstractmethod
    def other_avoider(self, parameters: Mapping[str, float]) -> str | None:
        """The autopilot's own avoidance, where its parameters say that it acts by itself."""

    def advice(self, parameters: Mapping[str, float]) -> list[str]:  # noqa: ARG002
        """What the operator should better set otherwise, in words."""
        return []

    def refusals(self) -> list[str]:
        """What the autopilot refused since the last call, in words."""
        return self.desk.refusals()

    def refused_values(self) -> list[RefusedValue]:
        """What it will not fly, not even when asked within its limits, since the last call."""
        return []

    def stand_back(self) -> None:
        """Somebody else has the aircraft: nothing asked so far may be repeated."""
        self.desk.forget()

    def request_interval(self, message_id: int, interval_s: float) -> Message:
        """MAV_CMD_SET_MESSAGE_INTERVAL, which is asked again by rate, not by answer."""
        return self.command_long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_s * 1e6)

    def request_message(self, message_id: int) -> Message:
        """MAV_CMD_REQUEST_MESSAGE: once."""
        return self.command_long(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)

    def request_parameter(self, name: str) -> Message:
        """PARAM_REQUEST_READ by name."""
        return mavlink.MAVLink_param_request_read_message(
            self.target.system_id, self.target.component_id, name.encode("ascii"), -1
        )

    def select_item(self, sequence: int) -> Message:
        """MAV_CMD_DO_SET_MISSION_CURRENT."""
        return self.command_long(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, sequence)

    def command_long(self, command: int, *params: float) -> Message:
        """A COMMAND_LONG to our autopilot."""
        padded = [*params, *([0.0] * (7 - len(params)))]
        return mavlink.MAVLink_command_long_message(
            self.target.system_id, self.target.component_id, command, 0, *padded
        )

    def command_int(
        self, command: int, *params: float, place: GeoPoint | None = None, z_m: float = 0.0
    ) -> Message:
        """A COMMAND_INT to our autopilot, heights above mean sea level."""
        padded = [*params, *([0.0] * (4 - len(params)))]
        lat_e7 = 0 if place is None else round(place.lat_deg * 1e7)
        lon_e7 = 0 if place is None else round(place.lon_deg * 1e7)
        return mavlink.MAVLink_command_int_message(
            self.target.system_id,
            self.target.component_id,
            mavlink.MAV_FRAME_GLOBAL,
            command,
            0,
            0,
            *padded,
            lat_e7,
            lon_e7,
            z_m if place is None else place.altitude_m,
        )

    def reposition(self, place: GeoPoint) -> Message:
        """MAV_CMD_DO_REPOSITION with change of mode: fly there and circle."""
        as_now, change_mode, usual_radius, clockwise = -1.0, 1.0, 0.0, 0.0
        return self.command_int(
            mavlink.MAV_CMD_DO_REPOSITION, as_now, change_mode, usual_radius, clockwise, place=place
        )
