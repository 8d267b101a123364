"""What every autopilot must be able to tell and do; the engine knows no other."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from companion.autopilots.commands import CommandDesk
from companion.autopilots.limits import ParameterTable
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult, Sender
from companion.model import Guidance, Vec3


@dataclass(frozen=True, slots=True)
class Flown:
    """Guidance with what a setpoint needs beside it: where we are, how fast over ground, how far to bank."""

    guidance: Guidance
    position: GeoPoint
    velocity_mps: Vec3
    max_bank_rad: float = math.radians(30.0)


class Adapter(ABC):
    """One autopilot, addressed at `target`. Methods return the messages to send; nothing is sent in here.

    Angles and lengths are those of the house; `guidance.altitude_m` is height above mean sea level.
    """

    name: ClassVar[str]
    can_fly: ClassVar[bool]
    # Messages to ask for, with the interval wanted [s].
    intervals_s: ClassVar[dict[int, float]]
    # The command whose answers are about modes.
    mode_command: ClassVar[int] = mavlink.MAV_CMD_DO_SET_MODE
    # The parameter that holds our own transponder's address: what it transmits comes back as traffic.
    own_icao_parameter: ClassVar[str] = "ADSB_ICAO_ID"
    # The parameters that tell of the aircraft's limits, its fence and its mission.
    parameters: ClassVar[ParameterTable]

    def __init__(self, target: Sender) -> None:
        self.target = target
        self.desk = CommandDesk()

    @staticmethod
    @abstractmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""

    def is_guided(self, custom_mode: int) -> bool:
        """Whether this is the mode in which our setpoints are obeyed."""
        return custom_mode == self.guided_mode

    @property
    @abstractmethod
    def fallback_mode(self) -> int:
        """The mode to leave the aircraft in when it refuses the former one: there it looks after itself."""

    @abstractmethod
    def set_mode(self, custom_mode: int) -> Message:
        """The request for a mode; its command is `mode_command`."""

    @abstractmethod
    def command(self, flown: Flown, now_s: float, *, urgent: bool) -> list[Message]:
        """Fly this: called at every tick while flying; `urgent` when the decision was made just now."""

    @property
    @abstractmethod
    def guided_mode(self) -> int:
        """The custom mode in which our setpoints are obeyed."""

    def observe(self, fact: CommandResult, now_s: float) -> None:
        """Take note of an answer to a command."""
        self.desk.answered(fact, now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Commands that are due to be sent again."""
        return self.desk.due(now_s)

    def refusals(self) -> list[str]:
        """What the autopilot refused since the last call, in words."""
        return self.desk.refusals()

    def stand_back(self) -> None:
        """Somebody else has the aircraft: nothing asked so far may be repeated."""
        self.desk.forget()

    def request_interval(self, message_id: int, interval_s: float) -> Message:
        """MAV_CMD_SET_MESSAGE_INTERVAL, which is asked again by rate, not by answer."""
        return self.command_long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_s * 1e6)

    def request_parameter(self, name: str) -> Message:
        """PARAM_REQUEST_READ by name."""
        return mavlink.MAVLink_param_request_read_message(
            self.target.system_id, self.target.component_id, name.encode("ascii"), -1
        )

    def command_long(self, command: int, *params: float) -> Message:
        """A COMMAND_LONG to our autopilot."""
        padded = [*params, *([0.0] * (7 - len(params)))]
        return mavlink.MAVLink_command_long_message(
            self.target.system_id, self.target.component_id, command, 0, *padded
        )
