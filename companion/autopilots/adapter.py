"""The interface of every autopilot: guidance to messages, modes, parameters."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from companion.autopilots.commands import CommandRetrier
from companion.autopilots.parameters import ParameterTable
from companion.avoidance import Control
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult, Fact, NavigationTarget, Sender
from companion.model import Guidance, PriorFlightState, Vec3


@dataclass(frozen=True, slots=True)
class GuidanceCommand:
    """Guidance, and what else a setpoint needs: own position, ground velocity (NED), airspeed, bank limit.

    `airspeed_mps` is measured; `None` without a sensor: then no speed is commanded.
    """

    guidance: Guidance
    position: GeoPoint
    velocity_mps: Vec3
    airspeed_mps: float | None
    max_bank_rad: float


@dataclass(frozen=True, slots=True)
class RefusedValue:
    """A course [rad], airspeed [m/s] or height [m above mean sea level] that the autopilot refused."""

    control: Control
    value: float


# Commands that say where to fly in the guided mode, and nothing else: DO_CHANGE_SPEED may be the mission's.
_GUIDED_COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
        mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
        mavlink.MAV_CMD_GUIDED_CHANGE_SPEED,
        mavlink.MAV_CMD_DO_CHANGE_ALTITUDE,
    }
)
_COMMANDS = frozenset({mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_COMMAND_INT})


def is_setpoint(message: Message) -> bool:
    """Whether a message says where to fly in the guided mode, by a position target or a command for that."""
    if message.get_msgId() in _COMMANDS:
        return message.command in _GUIDED_COMMANDS
    return bool(message.get_msgId() == mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT)


class Adapter(ABC):
    """One autopilot at the address `target`; its methods return the messages to send.

    Units are SI and radians; `guidance.altitude_m` is height above mean sea level.
    """

    name: ClassVar[str]
    # Interval [s] to request for each message, by message id.
    intervals_s: ClassVar[dict[int, float]]
    # Commands that change the mode.
    mode_commands: ClassVar[frozenset[int]] = frozenset(
        {mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_DO_REPOSITION}
    )
    # The mode that flies the mission.
    mission_mode: ClassVar[str]
    # Whether the mission's item 0 is home, and whether a mode change ends the speed of its DO_CHANGE_SPEED.
    home_is_item_0: ClassVar[bool] = False
    forgets_mission_speed: ClassVar[bool] = False
    # The mission's mode is entered with a climb in a loiter if its item is further above than this.
    climbs_first_m: ClassVar[float] = math.inf
    # Modes that circle or hold a course: the aircraft must be at the circle or on the course to enter them.
    loiter_modes: ClassVar[frozenset[str]] = frozenset()
    course_hold_modes: ClassVar[frozenset[str]] = frozenset()
    # Whether the target that it reports stays where the guided mode was entered while our guidance is flown.
    keeps_guided_target: ClassVar[bool] = False
    # The parameters with the aircraft's limits, its fence and the size of its mission.
    parameters: ClassVar[ParameterTable]

    def __init__(self, target: Sender) -> None:
        self.target = target
        self.commands = CommandRetrier()
        self.guided_mode_unsupported = False  # a request for the guided mode was answered UNSUPPORTED

    @staticmethod
    @abstractmethod
    def mode_name(custom_mode: int) -> str:
        """The mode's name as ground stations show it."""

    def is_guided(self, custom_mode: int) -> bool:
        """Whether our setpoints are obeyed in this mode."""
        return custom_mode == self.guided_mode

    def is_mission(self, custom_mode: int) -> bool:
        """Whether the mission is flown in this mode."""
        return self.mode_name(custom_mode) == self.mission_mode

    def choose_way(self) -> None:  # noqa: B027 - optional
        """Choose one of several ways of flying; called only while none is flown and none is left."""

    def fall_back(self, postponements: int) -> bool:  # noqa: ARG002
        """Choose another way of flying after the guided mode was refused; true when there was one.

        `postponements`: the number of requests that were temporarily rejected; 0 for a refusal.
        """
        return False

    @property
    def entry_s(self) -> float:
        """How long [s] `entering` is streamed before the guided mode is requested."""
        return 0.0

    @property
    def heartbeat_interval_s(self) -> float | None:
        """How often [s] to request the heartbeat while the aircraft is ours; `None`: when it is overdue."""
        return None

    @property
    def exit_s(self) -> float:
        """How long [s] `leaving` is streamed before the former mode is requested."""
        return 0.0

    @property
    @abstractmethod
    def guided_mode(self) -> int:
        """The custom mode in which our setpoints are obeyed."""

    @property
    @abstractmethod
    def fallback_mode(self) -> int:
        """The mode to request when the former one is refused: the aircraft loiters in it."""

    @abstractmethod
    def setpoint_loss_mode(self) -> int | None:
        """The mode entered soon after our setpoints end; `None`: unknown, or one that a pilot may choose."""

    @property
    def invalid_after_climbs(self) -> bool:
        """Whether leaving the guided mode in a climb or descent may make the attitude setpoint invalid."""
        return False

    @property
    def last_setpoint_s(self) -> float:
        """When the newest of those setpoints was sent without which it leaves the guided mode by itself."""
        return -math.inf

    @property
    def leaves_guided_by_itself(self) -> bool:
        """Whether the autopilot leaves the guided mode by itself, to a known mode, when our setpoints end."""
        return self.setpoint_loss_mode() not in (None, self.guided_mode)

    @abstractmethod
    def set_mode(self, custom_mode: int) -> Message:
        """The request for a mode, by one of `mode_commands`."""

    def restore_mode(self, before: PriorFlightState) -> list[Message]:
        """Requests for the former mode, with its target if the autopilot would lose it otherwise."""
        return [self.set_mode(before.mode)]

    def entering(self, command: GuidanceCommand, now_s: float) -> list[Message]:  # noqa: ARG002
        """Setpoints while the guided mode is being entered; called at every tick."""
        return []

    @abstractmethod
    def command(self, command: GuidanceCommand, now_s: float, *, urgent: bool) -> list[Message]:
        """Messages that fly the command; called at every tick. `urgent`: the decision is new."""

    def setpoint_invalid(self, now_s: float) -> bool:  # noqa: ARG002
        """Whether the attitude setpoint is not a number, so that only the pilot's sticks fly the aircraft."""
        return False

    def leaving(self, command: GuidanceCommand, now_s: float) -> list[Message]:  # noqa: ARG002
        """Setpoints while the guided mode is being left; called at every tick until it is left."""
        return []

    def observe(self, fact: Fact, now_s: float) -> None:
        """Process a fact from the autopilot, such as the answer to a command or a parameter."""
        if isinstance(fact, CommandResult):
            self.commands.answered(fact, now_s)

    def tick(self, now_s: float) -> list[Message]:
        """Messages that are due to be repeated."""
        return self.commands.due(now_s)

    @property
    def restarts_mission(self) -> bool:
        """Whether entering the mission's mode again starts the mission from its first item."""
        return False

    @property
    def changed_parameters(self) -> dict[str, float]:
        """The original values of parameters that we changed for a while, by name."""
        return {}

    def restore_parameters(self, values: dict[str, float]) -> None:  # noqa: B027 - optional
        """Restore parameters that a former run changed and did not restore."""

    @abstractmethod
    def other_avoider(self, parameters: Mapping[str, float]) -> str | None:
        """The autopilot's own avoidance and its setting, if the parameters let it act; otherwise `None`."""

    @property
    def traffic_parameters(self) -> tuple[str, ...]:
        """The parameters of the autopilot's own avoidance."""
        return ()

    def ignores_traffic(self, parameters: Mapping[str, float]) -> str | None:  # noqa: ARG002
        """The parameter by which it ignores traffic that we send it, with its value; `None`: it does not."""
        return None

    def advice(self, parameters: Mapping[str, float]) -> list[str]:  # noqa: ARG002
        """Parameters that the operator should change, in words."""
        return []

    def refusals(self) -> list[str]:
        """Commands that the autopilot refused since the last call, in words."""
        refusals, self.commands.refusals = self.commands.refusals, []
        return refusals

    def refused_values(self) -> list[RefusedValue]:
        """Values that were refused twice since the last call, the second time moderated."""
        return []

    @property
    def lost_controls(self) -> frozenset[Control]:
        """The controls that cannot be flown: this autopilot refuses them, or what they need is unknown."""
        return frozenset()

    @property
    def cannot_fly(self) -> str | None:
        """The reason why this autopilot cannot be flown at all, in words; `None` when it can."""
        if not self.guided_mode_unsupported:
            return None
        return f"it does not support {self.mode_name(self.guided_mode)}"

    def is_own_target(self, target: NavigationTarget) -> bool:  # noqa: ARG002
        """Whether a reported navigation target is a place that we have commanded the autopilot to fly to."""
        return False

    def is_foreign_target(self, target: NavigationTarget) -> bool:  # noqa: ARG002
        """Whether a target reported in the guided mode is certainly not ours."""
        return False

    def restarted(self) -> None:
        """Forget what the autopilot refused: it has restarted, perhaps with another firmware."""
        self.guided_mode_unsupported = False

    def drop_commands(self) -> None:
        """Drop all commands under way, because the aircraft is no longer ours."""
        self.commands.forget()

    def request_interval(self, message_id: int, interval_s: float) -> Message:
        """MAV_CMD_SET_MESSAGE_INTERVAL; it is repeated when the measured rate is low (see `MessageRates`)."""
        return self.command_long(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, interval_s * 1e6)

    def request_message(self, message_id: int) -> Message:
        """MAV_CMD_REQUEST_MESSAGE: one message, once."""
        return self.command_long(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)

    def request_parameter(self, name: str) -> Message:
        """PARAM_REQUEST_READ by name."""
        return mavlink.MAVLink_param_request_read_message(
            self.target.system_id, self.target.component_id, name.encode("ascii"), -1
        )

    def set_parameter(self, name: str, value: float) -> Message:
        """PARAM_SET of a floating-point parameter."""
        return mavlink.MAVLink_param_set_message(
            self.target.system_id,
            self.target.component_id,
            name.encode("ascii"),
            value,
            mavlink.MAV_PARAM_TYPE_REAL32,
        )

    def select_item(self, sequence: int) -> Message:
        """MAV_CMD_DO_SET_MISSION_CURRENT."""
        return self.command_long(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, sequence)

    def change_speed(self, airspeed_mps: float) -> Message:
        """MAV_CMD_DO_CHANGE_SPEED: an airspeed for the mission, the throttle unchanged."""
        airspeed_type, no_change = 0.0, -1.0
        return self.command_long(mavlink.MAV_CMD_DO_CHANGE_SPEED, airspeed_type, airspeed_mps, no_change)

    def command_long(self, command: int, *params: float) -> Message:
        """A COMMAND_LONG to our autopilot."""
        padded = [*params, *([0.0] * (7 - len(params)))]
        return mavlink.MAVLink_command_long_message(
            self.target.system_id, self.target.component_id, command, 0, *padded
        )

    def command_int(
        self, command: int, *params: float, place: GeoPoint | None = None, z_m: float = 0.0
    ) -> Message:
        """A COMMAND_INT to our autopilot; heights are above mean sea level."""
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

    def reposition(self, place: GeoPoint, *, change_mode: bool = True) -> Message:
        """MAV_CMD_DO_REPOSITION: fly to the place and circle there.

        Without `change_mode` it is refused outside the guided mode.
        """
        present_speed, default_radius, clockwise = -1.0, 0.0, 0.0
        return self.command_int(
            mavlink.MAV_CMD_DO_REPOSITION,
            present_speed,
            float(change_mode),
            default_radius,
            clockwise,
            place=place,
        )
