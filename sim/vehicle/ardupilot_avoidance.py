"""ArduPlane's own avoidance (AVD_*): off by default; when told to act it takes the mode."""

from sim.vehicle.ardupilot_flight import ArduPlaneFlight
from sim.vehicle.ardupilot_modes import Mode
from sim.vehicle.events import CRITICAL, INFO, Text
from sim.vehicle.heard_traffic import HeardTraffic

# AVD_F_ACTION: up to this one it only reports
_REPORT, _RTL = 1.0, 5.0
_RESUME_PREVIOUS_MODE = 1.0  # AVD_F_RCVRY
_CLEAR_FOR_S = 5.0


class ArduPlaneAvoidance:
    """Changes the mode when traffic is nearer than AVD_F_DIST_XY and AVD_F_DIST_Z, and back afterwards."""

    def __init__(self, flight: ArduPlaneFlight, heard: HeardTraffic) -> None:
        self._flight = flight
        self._heard = heard
        self._before: Mode | None = None
        self._near_s = 0.0

    def step(self, now_s: float) -> None:
        """Look around."""
        flight, values = self._flight, self._flight.parameters
        if not values["AVD_ENABLE"] or values["AVD_F_ACTION"] <= _REPORT or flight.on_ground:
            return
        near = self._heard.is_within(flight.place, values["AVD_F_DIST_XY"], values["AVD_F_DIST_Z"], now_s)
        if near:
            self._near_s = now_s
        if near and self._before is None:
            self._act()
        elif self._before is not None and now_s - self._near_s > _CLEAR_FOR_S:
            self._recover(self._before)

    def _act(self) -> None:
        flight = self._flight
        self._before = flight.mode
        wanted = Mode.RTL if flight.parameters["AVD_F_ACTION"] == _RTL else Mode.AVOID_ADSB
        flight.events.append(Text(CRITICAL, "Avoid: Performing action: " + wanted.name))
        flight.set_mode(wanted)

    def _recover(self, before: Mode) -> None:
        flight = self._flight
        self._before = None
        flight.events.append(Text(INFO, "Avoid: clear"))
        if flight.parameters["AVD_F_RCVRY"] == _RESUME_PREVIOUS_MODE and flight.mode is Mode.AVOID_ADSB:
            flight.set_mode(before)
