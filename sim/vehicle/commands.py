"""Commands (COMMAND_LONG, COMMAND_INT): what ArduPlane does on each, and the result that it answers."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.events import INFO, Text
from sim.vehicle.flight import Flight
from sim.vehicle.guided import Result
from sim.vehicle.mission import ABSOLUTE_FRAMES, GLOBAL_FRAMES
from sim.vehicle.modes import Mode
from sim.vehicle.streams import Streams
from sim.vehicle.telemetry import Telemetry

_FORCE = 21196.0  # the number that ArduPilot wants to see for arming or disarming by force
_CHANGE_MODE = 1  # DO_REPOSITION's flag
_CUSTOM_MODE_ENABLED = 1
_DEFAULT_INTERVAL, _NO_INTERVAL = 0.0, -1.0


@dataclass(frozen=True, slots=True)
class Call:
    """A command from either message. `frame` is None in a COMMAND_LONG, which has none."""

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


class Commands:
    """Carries out commands on one flight; `streams` by channel, `send(channel, message)` answers."""

    def __init__(
        self,
        flight: Flight,
        telemetry: Telemetry,
        streams: dict[int, Streams],
        send: Callable[[int, Message], None],
    ) -> None:
        self._flight = flight
        self._telemetry = telemetry
        self._streams = streams
        self._send = send
        self._actions: dict[int, Callable[[Call], Result]] = {
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_or_disarm,
            mavlink.MAV_CMD_GUIDED_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE: self._change_altitude,
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: self._change_heading,
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_version,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._request_home,
            mavlink.MAV_CMD_MISSION_START: self._start_mission,
            mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: self._set_current_item,
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self._return_to_launch,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self._loiter,
        }

    def run(self, call: Call) -> Result:
        """Do it, or say why not."""
        action = self._actions.get(call.command)
        if action is None:
            return Result.UNSUPPORTED
        if call.frame is None and call.command in _WITH_FRAME_ONLY:
            return Result.COMMAND_INT_ONLY
        return action(call)

    def set_custom_mode(self, base_mode: float, custom_mode: float) -> Result:
        """DO_SET_MODE and the SET_MODE message."""
        if not math.isfinite(base_mode) or not int(base_mode) & _CUSTOM_MODE_ENABLED:
            return Result.DENIED
        if custom_mode not in Mode.__members__.values():
            return Result.FAILED
        self._flight.set_mode(Mode(int(custom_mode)))
        return Result.ACCEPTED

    def _set_mode(self, call: Call) -> Result:
        return self.set_custom_mode(call.params[0], call.params[1])

    def _arm_or_disarm(self, call: Call) -> Result:
        wanted, force = call.params[0], call.params[1] == _FORCE
        if wanted == 1.0:
            self._flight.arm()
            return Result.ACCEPTED
        if wanted == 0.0:
            return Result.ACCEPTED if self._flight.disarm(force=force) else Result.FAILED
        return Result.UNSUPPORTED

    def _change_heading(self, call: Call) -> Result:
        if self._flight.mode is not Mode.GUIDED:
            return Result.FAILED
        return self._flight.guided.change_heading(*call.params[:3])

    def _change_speed(self, call: Call) -> Result:
        flight = self._flight
        if flight.mode is not Mode.GUIDED:
            return Result.FAILED
        limits_mps = flight.parameters["AIRSPEED_MIN"], flight.parameters["AIRSPEED_MAX"]
        return flight.guided.change_speed(call.params[0], call.params[1], *limits_mps)

    def _change_altitude(self, call: Call) -> Result:
        flight = self._flight
        if flight.mode is not Mode.GUIDED or call.frame is None:
            return Result.FAILED
        return flight.guided.change_altitude(call.frame, call.z_m, call.params[2], flight.home.altitude_m)

    def _reposition(self, call: Call) -> Result:
        flight = self._flight
        flags, radius_m, direction = call.params[1], call.params[2], call.params[3]
        if flight.mode is not Mode.GUIDED and not (math.isfinite(flags) and int(flags) & _CHANGE_MODE):
            return Result.FAILED
        if call.frame not in GLOBAL_FRAMES or not math.isfinite(call.z_m):
            return Result.DENIED
        if abs(call.lat_e7) > 900_000_000 or abs(call.lon_e7) > 1_800_000_000:
            return Result.DENIED
        flight.set_mode(Mode.GUIDED)
        altitude_m = call.z_m + (0.0 if call.frame in ABSOLUTE_FRAMES else flight.home.altitude_m)
        place = flight.place
        if call.lat_e7 or call.lon_e7:
            place = GeoPoint(call.lat_e7 / 1e7, call.lon_e7 / 1e7, altitude_m)
        radius_m = abs(radius_m) if math.isfinite(radius_m) else 0.0
        if direction == 1.0:
            radius_m = -(radius_m or flight.parameters["WP_LOITER_RAD"])
        flight.reposition(GeoPoint(place.lat_deg, place.lon_deg, altitude_m), radius_m)
        return Result.ACCEPTED

    def _set_interval(self, call: Call) -> Result:
        message_id, interval_us = call.params[0], call.params[1]
        streams = self._streams[call.channel]
        if interval_us == _DEFAULT_INTERVAL:
            known = streams.reset_interval(message_id_of(message_id), call.now_s)
        elif interval_us == _NO_INTERVAL:
            known = streams.set_interval(message_id_of(message_id), 0.0, call.now_s)
        elif interval_us > 0.0 and math.isfinite(interval_us):
            known = streams.set_interval(message_id_of(message_id), interval_us / 1e6, call.now_s)
        else:
            return Result.DENIED
        return Result.ACCEPTED if known else self._no_such_message(message_id, Result.DENIED)

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
        message = self._telemetry.build(message_id_of(call.params[0]), call.now_s)
        if message is None:
            return self._no_such_message(call.params[0], Result.FAILED)
        self._send(call.channel, message)
        return Result.ACCEPTED

    def _no_such_message(self, message_id: float, result: Result) -> Result:
        text = f"No ap_message for mavlink id ({message_id_of(message_id)})"
        self._flight.events.append(Text(INFO, text))
        return result

    def _request_version(self, call: Call) -> Result:
        return self._tell(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, call)

    def _request_home(self, call: Call) -> Result:
        return self._tell(mavlink.MAVLINK_MSG_ID_HOME_POSITION, call)

    def _tell(self, message_id: int, call: Call) -> Result:
        self._send(call.channel, self._telemetry.build(message_id, call.now_s))
        return Result.ACCEPTED

    def _start_mission(self, call: Call) -> Result:
        if call.params[0] != 0.0 or call.params[1] != 0.0:
            return Result.DENIED
        self._flight.set_mode(Mode.AUTO)
        return Result.ACCEPTED

    def _set_current_item(self, call: Call) -> Result:
        sequence = call.params[0]
        if not math.isfinite(sequence) or sequence < 0.0:
            return Result.DENIED
        return Result.ACCEPTED if self._flight.select_item(int(sequence)) else Result.FAILED

    def _return_to_launch(self, _call: Call) -> Result:
        self._flight.set_mode(Mode.RTL)
        return Result.ACCEPTED

    def _loiter(self, _call: Call) -> Result:
        self._flight.set_mode(Mode.LOITER)
        return Result.ACCEPTED


def message_id_of(value: float) -> int:
    """A message number from a command's parameter, -1 when it is no number."""
    return int(value) if math.isfinite(value) else -1


# These need a frame or an integer place: as COMMAND_LONG they are refused.
_WITH_FRAME_ONLY = frozenset(
    {
        mavlink.MAV_CMD_GUIDED_CHANGE_SPEED,
        mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
        mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
        mavlink.MAV_CMD_DO_REPOSITION,
    }
)
