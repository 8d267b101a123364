"""ArduPlane's flight modes: what each flies, and what happens on entry."""

from collections.abc import Sequence

from companion.geodesy import GeoPoint
from companion.model import Vec2
from sim.dynamics import ARDUPLANE, Airframe
from sim.vehicle.ardupilot.guided import GuidedTargets
from sim.vehicle.ardupilot.modes import PILOTED, Mode
from sim.vehicle.ardupilot.parameters import limits_of
from sim.vehicle.mission import Mission, MissionItem
from sim.vehicle.mission_flight import MissionFlight
from sim.vehicle.navigation import Leg
from sim.vehicle.outputs import INFO, WARNING, ModeChanged, Text
from sim.vehicle.parameters import Limits, Parameters

_NO_MISSION_TEXT = "Aircraft in auto without a running mission"
_RTL_ON_BREACH = 1  # FENCE_ACTION
# A smaller difference of height is flown at once (ALT_SLOPE_MIN), as is a climb near the ground.
_LEAST_SLOPE_M, _LOWEST_SLOPE_M = 15.0, 20.0


class ArduPlaneFlight(MissionFlight):
    """ArduPlane in the air and on the ground; starts in MANUAL."""

    def __init__(
        self,
        home: GeoPoint,
        parameters: Parameters,
        *,
        items: Sequence[MissionItem] = (),
        heading_rad: float = 0.0,
        wind_mps: Vec2 = (0.0, 0.0),
        airframe: Airframe | None = None,
    ) -> None:
        """Start disarmed in MANUAL at home, pointing along `heading_rad`."""
        self.mode: Mode = Mode.MANUAL
        super().__init__(
            home,
            parameters,
            Mission(home, items),
            airframe=airframe or ARDUPLANE,
            heading_rad=heading_rad,
            wind_mps=wind_mps,
        )
        self.guided = GuidedTargets(home, self.limits.loiter_radius_m, altitude_m=home.altitude_m)

    @property
    def on_mission(self) -> bool:
        """AUTO."""
        return self.mode is Mode.AUTO

    @property
    def companion_flies(self) -> bool:
        """GUIDED."""
        return self.mode is Mode.GUIDED

    @property
    def piloted(self) -> bool:
        """MANUAL and the assisted modes."""
        return self.mode in PILOTED

    @property
    def uncontrolled(self) -> bool:
        """Never True: ArduPlane ignores commands that it does not support."""
        return False

    @property
    def taking_off_by_mode(self) -> bool:
        """TAKEOFF below its height."""
        return self.mode is Mode.TAKEOFF and self.aircraft.altitude_m < self._takeoff_altitude_m()

    @property
    def wanted_altitude_m(self) -> float:
        """The commanded height [m above mean sea level]."""
        return self.guided.altitude_m if self.mode is Mode.GUIDED else super().wanted_altitude_m

    def set_mode(self, mode: Mode) -> None:
        """Change the mode, as a pilot or a command does; every change clears the guided targets."""
        if mode is self.mode:
            return
        self.mode = mode
        self.events.append(ModeChanged())
        self.aircraft.airframe = self._cruising
        self.aircraft.hold_airspeed(self.limits.airspeed_cruise_mps)
        here = self.place
        self.forget_commands()
        self.target = here
        if mode is Mode.AUTO:
            self._start_or_resume()
        elif mode is Mode.RTL:
            self._circle(self.home, self.home.altitude_m + self.limits.rtl_height_m)
        elif mode in PILOTED:
            self.aircraft.hold_altitude(here.altitude_m)

    def forget_commands(self) -> None:
        """Clear the guided targets: GUIDED circles here."""
        here = self.place
        self.guided = GuidedTargets(here, self.limits.loiter_radius_m, altitude_m=here.altitude_m)

    def enter_mission(self) -> None:
        """AUTO."""
        self.set_mode(Mode.AUTO)

    def return_home(self) -> None:
        """RTL."""
        self.set_mode(Mode.RTL)

    def reposition(self, place: GeoPoint, radius_m: float) -> None:
        """In GUIDED, fly to a place and circle; a negative radius turns left, 0 uses the parameter's."""
        self.guided.go_to(place, radius_m or self.limits.loiter_radius_m)
        self.target = place

    def _read_limits(self) -> Limits:
        return limits_of(self.parameters)

    def _fly_mode(self) -> None:
        if self.mode is Mode.GUIDED:
            self.guided.fly(self.aircraft, self.frame)
        elif self.mode is Mode.CIRCLE:
            self.aircraft.hold_bank(self.aircraft.airframe.bank_limit_rad / 3.0)
            self.aircraft.hold_altitude(self.wanted_altitude_m)
        else:
            self._fly_circle()

    def _takeoff_done(self) -> None:
        self._circle(self.place, self._takeoff_altitude_m())

    def _leg_altitude_m(self, item: MissionItem, leg: Leg, here_m: Vec2) -> float:  # noqa: ARG002
        """Linear along the line from where it began, unless that is nearly the item's height."""
        begun_m = leg.end_altitude_m if leg.start_altitude_m is None else leg.start_altitude_m
        up_m = leg.end_altitude_m - begun_m
        low = up_m > 0.0 and begun_m - self.home.altitude_m < _LOWEST_SLOPE_M
        return leg.end_altitude_m if low or abs(up_m) < _LEAST_SLOPE_M else leg.altitude_m(here_m)

    def _mission_over(self) -> None:
        text = "Mission complete, changing mode to RTL" if self.mission.items else _NO_MISSION_TEXT
        self.events.append(Text(INFO, text))
        self.set_mode(Mode.RTL)

    def _fence_enabled(self) -> bool:
        return self.parameters["FENCE_ENABLE"] > 0.0

    def _fence_action(self) -> None:
        self.events.append(Text(WARNING, "Polygon fence breached"))
        if self.parameters["FENCE_ACTION"] == _RTL_ON_BREACH:
            self.set_mode(Mode.RTL)

    def _say(self, text: str) -> None:
        self.events.append(Text(INFO, text))
