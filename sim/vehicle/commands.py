"""Commands (COMMAND_LONG, COMMAND_INT) that both autopilots support; each autopilot adds its own."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.mission_flight import MissionFlight
from sim.vehicle.streams import Streams
from sim.vehicle.telemetry import Telemetry

CUSTOM_MODE_ENABLED = 1
_FORCE = 21196.0  # param2 that forces arming or disarming
_DEFAULT_INTERVAL, _NO_INTERVAL = 0.0, -1.0


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    COMMAND_LONG_ONLY = 7
    COMMAND_INT_ONLY = 8


@dataclass(frozen=True, slots=True)
class Call:
    """A command from either message. `frame` is None for a COMMAND_LONG."""

    command: int
    params: tuple[float, float, float, float]
    lat_e7: float
    lon_e7: float
    z_m: float
    frame: int | None
    channel: int
    now_s: float

    @classmethod
    def from_message(cls, message: Message, channel: int, now_s: float) -> "Call":
        """Read a COMMAND_INT or COMMAND_LONG."""
        params = (message.param1, message.param2, message.param3, message.param4)
        if message.get_type() == "COMMAND_INT":
            place = (message.x, message.y, message.z)
            return cls(message.command, params, *place, message.frame, channel, now_s)
        place = (message.param5 * 1e7, message.param6 * 1e7, message.param7)
        return cls(message.command, params, *place, None, channel, now_s)

    @property
    def has_place(self) -> bool:
        """True if latitude and longitude are on Earth."""
        return abs(self.lat_e7) <= 900_000_000 and abs(self.lon_e7) <= 1_800_000_000


Action = Callable[[Call], Result]


class Commands(ABC):
    """Executes commands on one flight; `streams` are by channel, `send(channel, message)` sends answers."""

    def __init__(
        self,
        flight: MissionFlight,
        telemetry: Telemetry,
        streams: dict[int, Streams],
        send: Callable[[int, Message], None],
    ) -> None:
        self._flight = flight
        self._telemetry = telemetry
        self._streams = streams
        self._send = send
        self._actions = self._all_actions()

    def run(self, call: Call) -> Result:
        """Execute a command; returns its result."""
        action = self._actions.get(call.command)
        return Result.UNSUPPORTED if action is None else action(call)

    @abstractmethod
    def set_mode(self, base_mode: float, main: float, sub: float) -> Result:
        """DO_SET_MODE with its first three parameters."""

    @abstractmethod
    def _no_such_message(self, message_id: int, *, as_stream: bool) -> Result:
        """The answer to a request for an unknown message."""

    def _all_actions(self) -> dict[int, Action]:
        return {
            mavlink.MAV_CMD_DO_SET_MODE: lambda call: self.set_mode(*call.params[:3]),
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_or_disarm,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_version,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._request_home,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._set_current_item,
        }

    def _arm_or_disarm(self, call: Call) -> Result:
        wanted, force = call.params[0], call.params[1] == _FORCE
        if wanted == 1.0:
            self._flight.arm()
            return Result.ACCEPTED
        if wanted == 0.0:
            return Result.ACCEPTED if self._flight.disarm(force=force) else Result.FAILED
        return Result.UNSUPPORTED

    def _set_interval(self, call: Call) -> Result:
        message_id, interval_us = message_id_of(call.params[0]), call.params[1]
        streams = self._streams[call.channel]
        if interval_us == _DEFAULT_INTERVAL:
            known = streams.reset_interval(message_id, call.now_s)
        elif interval_us == _NO_INTERVAL:
            known = streams.set_interval(message_id, 0.0, call.now_s)
        elif interval_us > 0.0 and math.isfinite(interval_us):
            known = streams.set_interval(message_id, interval_us / 1e6, call.now_s)
        else:
            return Result.DENIED
        return Result.ACCEPTED if known else self._no_such_message(message_id, as_stream=True)

    def _get_interval(self, call: Call) -> Result:
        message_id = message_id_of(call.params[0])
        interval_s = self._streams[call.channel].interval_s(message_id)
        interval_us = round(interval_s * 1e6) if interval_s > 0.0 else -1
        answer = mavlink.MAVLink_message_interval_message(
            message_id=message_id & 0xFFFF, interval_us=interval_us
        )
        self._send(call.channel, answer)
        return Result.ACCEPTED

    def _request_message(self, call: Call) -> Result:
        message_id = message_id_of(call.params[0])
        message = self._telemetry.build(message_id, call.now_s)
        if message is None:
            return self._no_such_message(message_id, as_stream=False)
        self._send(call.channel, message)
        return Result.ACCEPTED

    def _request_version(self, call: Call) -> Result:
        self._send(call.channel, self._telemetry.autopilot_version(call.now_s))
        return Result.ACCEPTED

    def _request_home(self, call: Call) -> Result:
        self._send(call.channel, self._telemetry.home_position(call.now_s))
        return Result.ACCEPTED

    def _set_current_item(self, call: Call) -> Result:
        sequence = call.params[0]
        if not math.isfinite(sequence) or sequence < 0.0:
            return Result.DENIED
        return Result.ACCEPTED if self._flight.select_item(int(sequence)) else Result.FAILED


def message_id_of(value: float) -> int:
    """A message id from a command's parameter, -1 if it is not finite."""
    return int(value) if math.isfinite(value) else -1
