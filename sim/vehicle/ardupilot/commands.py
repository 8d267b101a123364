"""ArduPlane's commands and their results."""

import math
from collections.abc import Callable

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.ardupilot.flight import ArduPlaneFlight
from sim.vehicle.ardupilot.modes import Mode
from sim.vehicle.commands import CUSTOM_MODE_ENABLED, Action, Call, Commands, Result
from sim.vehicle.mission import ABSOLUTE_FRAMES, GLOBAL_FRAMES
from sim.vehicle.outputs import INFO, Text
from sim.vehicle.streams import Streams
from sim.vehicle.telemetry import Telemetry

_CHANGE_MODE = 1  # DO_REPOSITION's flag
GUIDED_COMMANDS = (
    mavlink.MAV_CMD_GUIDED_CHANGE_SPEED,
    mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
    mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
)


class ArduPlaneCommands(Commands):
    """Executes the commands that ArduPlane supports."""

    def __init__(
        self,
        flight: ArduPlaneFlight,
        telemetry: Telemetry,
        streams: dict[int, Streams],
        send: Callable[[int, Message], None],
    ) -> None:
        super().__init__(flight, telemetry, streams, send)
        self._flight: ArduPlaneFlight = flight

    def leave_out_guided_commands(self) -> None:
        """Be a build without the 4300x commands."""
        for command in GUIDED_COMMANDS:
            del self._actions[command]

    def run(self, call: Call) -> Result:
        """Execute a command; returns its result."""
        if call.command not in self._actions:
            return Result.UNSUPPORTED
        if call.frame is None and call.command in _WITH_FRAME_ONLY:
            return Result.COMMAND_INT_ONLY
        return super().run(call)

    def set_mode(self, base_mode: float, main: float, _sub: float = 0.0) -> Result:
        """DO_SET_MODE and the SET_MODE message: `main` is the mode's number."""
        if not math.isfinite(base_mode) or not int(base_mode) & CUSTOM_MODE_ENABLED:
            return Result.DENIED
        if main not in Mode.__members__.values():
            return Result.FAILED
        self._flight.set_mode(Mode(int(main)))
        return Result.ACCEPTED

    def _all_actions(self) -> dict[int, Action]:
        return {
            **super()._all_actions(),
            mavlink.MAV_CMD_GUIDED_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE: self._change_altitude,
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: self._change_heading,
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_cruise_speed,
            mavlink.MAV_CMD_MISSION_START: self._start_mission,
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: self._change_to(Mode.RTL),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda _: self._change_to(Mode.LOITER),
        }

    def _change_to(self, mode: Mode) -> Result:
        self._flight.set_mode(mode)
        return Result.ACCEPTED

    def _change_heading(self, call: Call) -> Result:
        if self._flight.mode is not Mode.GUIDED:
            return Result.FAILED
        return self._flight.guided.change_heading(*call.params[:3])

    def _change_speed(self, call: Call) -> Result:
        flight = self._flight
        if flight.mode is not Mode.GUIDED:
            return Result.FAILED
        limits_mps = flight.limits.airspeed_min_mps, flight.limits.airspeed_max_mps
        return flight.guided.change_speed(call.params[0], call.params[1], *limits_mps)

    def _change_cruise_speed(self, call: Call) -> Result:
        """DO_CHANGE_SPEED: an airspeed within the limits, forgotten at the next change of mode."""
        flight, airspeed_mps = self._flight, call.params[1]
        if call.params[0] != 0.0:
            return Result.DENIED
        if not flight.limits.airspeed_min_mps <= airspeed_mps <= flight.limits.airspeed_max_mps:
            return Result.DENIED
        flight.aircraft.hold_airspeed(airspeed_mps)
        return Result.ACCEPTED

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
        if call.frame not in GLOBAL_FRAMES or not math.isfinite(call.z_m) or not call.has_place:
            return Result.DENIED
        flight.set_mode(Mode.GUIDED)
        altitude_m = call.z_m + (0.0 if call.frame in ABSOLUTE_FRAMES else flight.home.altitude_m)
        place = flight.place
        if call.lat_e7 or call.lon_e7:
            place = GeoPoint(call.lat_e7 / 1e7, call.lon_e7 / 1e7, altitude_m)
        radius_m = abs(radius_m) if math.isfinite(radius_m) else 0.0
        if direction == 1.0:
            radius_m = -(radius_m or flight.limits.loiter_radius_m)
        flight.reposition(GeoPoint(place.lat_deg, place.lon_deg, altitude_m), radius_m)
        return Result.ACCEPTED

    def _start_mission(self, call: Call) -> Result:
        if call.params[0] != 0.0 or call.params[1] != 0.0:
            return Result.DENIED
        return self._change_to(Mode.AUTO)

    def _no_such_message(self, message_id: int, *, as_stream: bool) -> Result:
        self._flight.events.append(Text(INFO, f"No ap_message for mavlink id ({message_id})"))
        return Result.DENIED if as_stream else Result.FAILED


# These need a frame or an integer position: as COMMAND_LONG they are refused.
_WITH_FRAME_ONLY = frozenset(
    {
        mavlink.MAV_CMD_GUIDED_CHANGE_SPEED,
        mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
        mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
        mavlink.MAV_CMD_DO_REPOSITION,
    }
)
