"""PX4's commands and their results."""

import math
from collections.abc import Callable

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.commands import CUSTOM_MODE_ENABLED, Action, Call, Commands, Result
from sim.vehicle.px4.flight import Px4Flight
from sim.vehicle.px4.modes import Px4Mode, mode_of
from sim.vehicle.streams import Streams
from sim.vehicle.telemetry import Telemetry

_CHANGE_MODE = 1.0  # DO_REPOSITION's flag
_HERE = 2**31 - 1  # COMMAND_INT: latitude or longitude not given


class Px4Commands(Commands):
    """Executes the commands that PX4 supports; MAV_CMD_GUIDED_CHANGE_* are not among them."""

    def __init__(
        self,
        flight: Px4Flight,
        telemetry: Telemetry,
        streams: dict[int, Streams],
        send: Callable[[int, Message], None],
    ) -> None:
        super().__init__(flight, telemetry, streams, send)
        self._flight: Px4Flight = flight

    def set_mode(self, base_mode: float, main: float, sub: float) -> Result:
        """DO_SET_MODE: main and sub mode."""
        if not math.isfinite(base_mode) or not int(base_mode) & CUSTOM_MODE_ENABLED:
            return Result.DENIED
        mode = mode_of(main, sub)
        return Result.DENIED if mode is None else self._change_to(mode)

    def _all_actions(self) -> dict[int, Action]:
        return {
            **super()._all_actions(),
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

    def _change_speed(self, call: Call) -> Result:
        """DO_CHANGE_SPEED: always accepted, flown only in the modes that navigate by themselves."""
        if math.isfinite(call.params[1]) and call.params[1] > 0.0:
            self._flight.change_speed(call.params[1])
        return Result.ACCEPTED

    def _reposition(self, call: Call) -> Result:
        """DO_REPOSITION: the height is above mean sea level in any frame; the radius is ignored."""
        if call.params[1] != _CHANGE_MODE:
            return Result.UNSUPPORTED
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
