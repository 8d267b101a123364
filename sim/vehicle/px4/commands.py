"""PX4's commands and their results."""

import math
from collections.abc import Callable

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import AVAILABLE_MODES, Message, mavlink
from sim.vehicle.commands import CUSTOM_MODE_ENABLED, Action, Call, Commands, Result, message_id_of
from sim.vehicle.outputs import CRITICAL, Text
from sim.vehicle.px4.flight import Px4Flight
from sim.vehicle.px4.modes import Px4Mode, mode_of
from sim.vehicle.px4.telemetry import Px4Telemetry
from sim.vehicle.streams import Streams

_AUTO = 4
_COURSE_OVER_GROUND = 0
_CHANGE_MODE = 1.0  # DO_REPOSITION's flag
_HERE = 2**31 - 1  # COMMAND_INT: latitude or longitude not given


class Px4Commands(Commands):
    """Executes the commands that PX4 supports; of MAV_CMD_GUIDED_CHANGE_*, the course since 1.18."""

    def __init__(
        self,
        flight: Px4Flight,
        telemetry: Px4Telemetry,
        streams: dict[int, Streams],
        send: Callable[[int, Message], None],
    ) -> None:
        self._flight: Px4Flight = flight
        self._telemetry: Px4Telemetry = telemetry
        super().__init__(flight, telemetry, streams, send)

    def set_mode(self, base_mode: float, main: float, sub: float) -> Result:
        """DO_SET_MODE: main and sub mode."""
        if not math.isfinite(base_mode) or not int(base_mode) & CUSTOM_MODE_ENABLED:
            return Result.DENIED
        if not (math.isfinite(main) and math.isfinite(sub)):
            return Result.DENIED
        mode = mode_of(main, sub, self._flight.firmware)
        if mode is not None:
            return self._change_to(mode)
        if main == _AUTO:
            self._flight.events.append(Text(CRITICAL, "Unsupported auto mode"))
        elif self._flight.firmware != "1.18":
            return Result.ACCEPTED  # an unknown main mode changes nothing
        return Result.TEMPORARILY_REJECTED

    def _all_actions(self) -> dict[int, Action]:
        since_1_18: dict[int, Action] = {mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: self._change_course}
        return {
            **super()._all_actions(),
            **(since_1_18 if self._flight.firmware == "1.18" else {}),
            mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: self._change_altitude,
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_MISSION_START: lambda _: self._change_to(Px4Mode.MISSION),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self._change_to(Px4Mode.RETURN),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda _: self._change_to(Px4Mode.HOLD),
            mavlink.MAV_CMD_NAV_TAKEOFF: lambda _: self._change_to(Px4Mode.TAKEOFF),
            mavlink.MAV_CMD_NAV_LAND: lambda _: self._change_to(Px4Mode.LAND),
        }

    def _change_to(self, mode: Px4Mode) -> Result:
        entered = self._flight.set_mode(mode)
        return Result.ACCEPTED if entered else Result.TEMPORARILY_REJECTED

    def _change_course(self, call: Call) -> Result:
        """GUIDED_CHANGE_HEADING: a course over ground in GUIDED_COURSE; everything else is denied."""
        kind, degrees = call.params[0], call.params[1]
        if not math.isfinite(kind) or round(kind) != _COURSE_OVER_GROUND or not math.isfinite(degrees):
            return Result.DENIED
        return Result.ACCEPTED if self._flight.change_course(math.radians(degrees)) else Result.DENIED

    def _change_altitude(self, call: Call) -> Result:
        altitude_m = call.params[0] if math.isfinite(call.params[0]) else self._flight.place.altitude_m
        changed = self._flight.change_altitude(altitude_m)
        return Result.ACCEPTED if changed else Result.TEMPORARILY_REJECTED

    def _set_interval(self, call: Call) -> Result:
        """SET_MESSAGE_INTERVAL: the heartbeat's is fixed."""
        if message_id_of(call.params[0]) == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return Result.FAILED
        return super()._set_interval(call)

    def _request_message(self, call: Call) -> Result:
        """REQUEST_MESSAGE: AVAILABLE_MODES lists all modes, or the one of the index asked for."""
        modes = self._telemetry.available_modes()
        if message_id_of(call.params[0]) != AVAILABLE_MODES or not modes:
            return super()._request_message(call)
        index = round(call.params[1]) if math.isfinite(call.params[1]) else -1
        if not 0 <= index <= len(modes):
            return Result.DENIED
        for message in modes if index == 0 else [modes[index - 1]]:
            self._send(call.channel, message)
        return Result.ACCEPTED

    def _change_speed(self, call: Call) -> Result:
        """DO_CHANGE_SPEED: always accepted, flown only in the modes that navigate by themselves."""
        if math.isfinite(call.params[1]) and call.params[1] > 0.0:
            self._flight.change_speed(call.params[1])
        return Result.ACCEPTED

    def _reposition(self, call: Call) -> Result:
        """DO_REPOSITION: the height is above mean sea level in any frame; the radius is ignored."""
        if call.params[1] != _CHANGE_MODE:
            return Result.UNSUPPORTED if self._flight.firmware != "1.18" else Result.DENIED
        here = self._flight.place
        lat_deg, lon_deg = here.lat_deg, here.lon_deg
        given = math.isfinite(call.lat_e7) and math.isfinite(call.lon_e7)
        if given and _HERE not in (call.lat_e7, call.lon_e7):
            if not call.has_place:
                return Result.DENIED
            lat_deg, lon_deg = call.lat_e7 / 1e7, call.lon_e7 / 1e7
        altitude_m = call.z_m if math.isfinite(call.z_m) else here.altitude_m
        self._flight.reposition(GeoPoint(lat_deg, lon_deg, altitude_m))
        return Result.ACCEPTED

    def _no_such_message(self, _message_id: int, *, as_stream: bool) -> Result:  # noqa: ARG002
        return Result.FAILED
