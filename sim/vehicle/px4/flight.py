"""PX4's flight modes as a fixed wing: what each flies, and what happens on entry."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.geodesy import GeoPoint
from companion.model import Vec2
from sim.dynamics import PX4, Airframe
from sim.vehicle import mission as mission_items
from sim.vehicle.mission import Mission, MissionItem
from sim.vehicle.mission_flight import MissionFlight
from sim.vehicle.navigation import Leg
from sim.vehicle.outputs import CRITICAL, INFO, WARNING, ModeChanged, Text
from sim.vehicle.parameters import Limits, Parameters
from sim.vehicle.px4.course import GuidedCourse, guided_airframe
from sim.vehicle.px4.modes import PILOTED, WITHOUT_POSITION_CONTROL, Firmware, Px4Mode
from sim.vehicle.px4.offboard import Offboard
from sim.vehicle.px4.parameters import limits_of
from sim.vehicle.px4.path import MISSION_TIME_S, course_to_line_rad
from sim.vehicle.px4.setpoint import Kind, Setpoint

_LAND_SINK_MPS = 1.5
# With an invalid setpoint it rolls off slowly and descends; these rates were not measured.
_ROLL_OFF_RPS = math.radians(3.0)
_FALLING_MPS = 2.0

_LOSS_ACTIONS = {
    0: Px4Mode.POSCTL,
    1: Px4Mode.ALTCTL,
    2: Px4Mode.MANUAL,
    3: Px4Mode.RETURN,
    4: Px4Mode.LAND,
    5: Px4Mode.HOLD,
}  # COM_OBL_RC_ACT
_FENCE_ACTIONS = {2: Px4Mode.HOLD, 3: Px4Mode.RETURN, 5: Px4Mode.LAND}  # GF_ACTION


class Px4Flight(MissionFlight):
    """PX4 in the air and on the ground; starts in MANUAL."""

    armed_text = "Armed by external command"
    disarmed_text = "Disarmed"

    def __init__(
        self,
        home: GeoPoint,
        parameters: Parameters,
        *,
        items: Sequence[MissionItem] = (),
        heading_rad: float = 0.0,
        wind_mps: Vec2 = (0.0, 0.0),
        airframe: Airframe | None = None,
        strict: bool = True,
        firmware: Firmware = "1.16",
    ) -> None:
        """Start disarmed in MANUAL at home, pointing along `heading_rad`; `strict` as for `Offboard`."""
        self.mode: Px4Mode = Px4Mode.MANUAL
        self.firmware = firmware
        self.offboard = Offboard(strict=strict, latches=firmware != "1.18")
        self.course = GuidedCourse(heading_rad, home.altitude_m)
        self._setpoint_was_invalid = False
        self._may_re_enter = False
        self._frozen = False
        self._climb_at: GeoPoint | None = None
        super().__init__(
            home,
            parameters,
            Mission(home, items, has_home=False),
            airframe=airframe or PX4,
            heading_rad=heading_rad,
            wind_mps=wind_mps,
        )

    @property
    def slopes_after_takeoff(self) -> bool:
        """Since 1.18, as recorded."""
        return self.firmware == "1.18"

    @property
    def on_mission(self) -> bool:
        """MISSION."""
        return self.mode is Px4Mode.MISSION

    @property
    def companion_flies(self) -> bool:
        """OFFBOARD and GUIDED_COURSE."""
        return self.mode in (Px4Mode.OFFBOARD, Px4Mode.GUIDED_COURSE)

    @property
    def in_offboard(self) -> bool:
        """OFFBOARD."""
        return self.mode is Px4Mode.OFFBOARD

    @property
    def in_course(self) -> bool:
        """GUIDED_COURSE."""
        return self.mode is Px4Mode.GUIDED_COURSE

    @property
    def piloted(self) -> bool:
        """MANUAL and the assisted modes."""
        return self.mode in PILOTED

    @property
    def uncontrolled(self) -> bool:
        """True with an invalid setpoint in a mode that the position controller flies."""
        invalid = self.offboard.setpoint_invalid
        return invalid and not self.on_ground and self.mode not in WITHOUT_POSITION_CONTROL

    @property
    def taking_off_by_mode(self) -> bool:
        """TAKEOFF."""
        return self.mode is Px4Mode.TAKEOFF

    @property
    def reports_failsafe(self) -> bool:
        """Also after a lost stream, until a mode is chosen: measured on PX4 1.16, which stayed CRITICAL."""
        return super().reports_failsafe or self._may_re_enter

    @property
    def landing(self) -> bool:
        """True while landing, by mode or by mission."""
        return self.mode is Px4Mode.LAND or super().landing

    # --- commands ---

    def set_mode(self, mode: Px4Mode) -> bool:
        """Change the mode, as a pilot or a command does; False if it cannot be entered."""
        if mode is Px4Mode.OFFBOARD and not self.offboard.may_enter(self.flown_s):
            return False
        if mode is Px4Mode.MISSION and not self.mission.items:
            return False
        self._may_re_enter = False
        self._change_mode(mode)
        return True

    def enter_mission(self) -> None:
        """MISSION, if a mission is stored."""
        self.set_mode(Px4Mode.MISSION)

    def return_home(self) -> None:
        """RETURN."""
        self.set_mode(Px4Mode.RETURN)

    def receive(self, setpoint: Setpoint) -> None:
        """Handle a valid setpoint; the first one after a lost stream re-enters OFFBOARD."""
        self.offboard.receive(setpoint, self.aircraft.altitude_m)
        if self._may_re_enter:
            self._may_re_enter = False
            self._change_mode(Px4Mode.OFFBOARD)

    def reposition(self, place: GeoPoint) -> None:
        """Enter HOLD around a place."""
        self.set_mode(Px4Mode.HOLD)
        self.target = place

    def change_course(self, course_rad: float) -> bool:
        """GUIDED_CHANGE_HEADING: a course over ground; False outside GUIDED_COURSE."""
        if self.in_course:
            self.course.change_course(course_rad, self.flown_s)
            self._show_course_target()
        return self.in_course

    def change_altitude(self, altitude_m: float) -> bool:
        """DO_CHANGE_ALTITUDE: True if it is acknowledged, which it is outside the fence too.

        1.18 changes the height of GUIDED_COURSE and HOLD alone; earlier versions enter HOLD.
        """
        if self.firmware != "1.18":
            self.set_mode(Px4Mode.HOLD)
        if not (self.in_course or self.mode is Px4Mode.HOLD):
            return False
        highest_m = self.parameters["GF_MAX_VER_DIST"]
        if 0.0 < highest_m < altitude_m - self.home.altitude_m and self._fence_enabled():
            self.events.append(Text(CRITICAL, "Altitude change is outside geofence"))
        elif self.in_course:
            self.course.change_altitude(altitude_m, self.flown_s)
            self._show_course_target()
        elif self.target is not None:
            self.target = self.target._replace(altitude_m=altitude_m)
        return True

    def _show_course_target(self) -> None:
        """Set the reported target: the place of the last command, and the height."""
        self.target = self.place._replace(altitude_m=self.course.altitude_m)

    def change_speed(self, airspeed_mps: float) -> None:
        """DO_CHANGE_SPEED: flown in the modes that navigate by themselves, until the mode changes.

        GUIDED_COURSE acknowledges any speed, and flies the nearest one within its limits.
        """
        if self.in_course:
            self.course.change_speed(airspeed_mps)
        elif not (self.in_offboard or self.piloted):
            self.aircraft.hold_airspeed(airspeed_mps)

    def forget_commands(self) -> None:
        """Reset stream and controller, as a reboot does; without a stream OFFBOARD is lost."""
        self.offboard = Offboard(strict=self.offboard.strict, latches=self.offboard.latches)
        self._may_re_enter = False
        if self.in_offboard:
            self._change_mode(self._loss_action())

    def apply_parameters(self) -> None:
        """Limit the aircraft by the envelope parameters; a new FW_AIRSPD_TRIM is flown at once."""
        before_mps = self.limits.airspeed_cruise_mps
        super().apply_parameters()
        if self.limits.airspeed_cruise_mps != before_mps:
            self.aircraft.hold_airspeed(self.limits.airspeed_cruise_mps)

    # --- time ---

    def advance(self) -> None:
        """Fly for one step; a lost stream ends OFFBOARD."""
        silent_s = self.offboard.silent_for_s(self.flown_s)
        if self.in_offboard and silent_s > self.parameters["COM_OF_LOSS_T"]:
            self.events.append(Text(CRITICAL, "Offboard control lost"))
            self._change_mode(self._loss_action())
            self._may_re_enter = True
        super().advance()
        if self.offboard.setpoint_invalid != self._setpoint_was_invalid:
            self._setpoint_was_invalid = self.offboard.setpoint_invalid
            self._report_setpoint_validity()

    def _report_setpoint_validity(self) -> None:
        """Announce the change; the real autopilot is silent about it, which would hide it from a tester."""
        invalid = self.offboard.setpoint_invalid
        what = "attitude setpoint is NaN" if invalid else "attitude setpoint is sane again"
        self.events.append(Text(CRITICAL, f"FAKE VEHICLE: {what}"))

    def _command(self) -> None:
        if self.uncontrolled:
            aircraft = self.aircraft
            aircraft.hold_bank(aircraft.bank_rad + _ROLL_OFF_RPS * aircraft.airframe.roll_lag_s)
            aircraft.hold_climb(-_FALLING_MPS)
            if self.in_offboard:
                self.offboard.control(self.flown_s)
            return
        super()._command()

    def _loss_action(self) -> Px4Mode:
        return _LOSS_ACTIONS.get(int(self.parameters["COM_OBL_RC_ACT"]), Px4Mode.HOLD)

    # --- modes ---

    def _change_mode(self, mode: Px4Mode) -> None:
        if mode is self.mode:
            return
        if self.in_offboard:
            self.offboard.leave(self.flown_s, self.aircraft.altitude_m)
        self.mode = mode
        self.events.append(ModeChanged())
        self.aircraft.airframe = self._cruising
        self.aircraft.hold_airspeed(self.limits.airspeed_cruise_mps)
        self.target = here = self.place
        self._frozen = False
        self._climb_at = None
        if mode is Px4Mode.OFFBOARD:
            self.offboard.enter(self.flown_s)
        elif self.in_course:
            self.course = GuidedCourse(self.aircraft.course_rad, here.altitude_m)
            self.aircraft.airframe = guided_airframe(self._cruising)
        elif mode is Px4Mode.MISSION:
            self._start_or_resume()
            self._climb_first()
            self._repeat_speed_change()
        elif mode is Px4Mode.RETURN:
            lowest_m = self.home.altitude_m + self.limits.rtl_height_m
            self._circle(self.home, max(lowest_m, here.altitude_m))
        elif mode in PILOTED:
            self.aircraft.hold_altitude(here.altitude_m)

    def _fly_mode(self) -> None:
        if self.in_offboard:
            self._fly_setpoint()
        elif self.in_course:
            self.course.fly(self.aircraft, self.flown_s)
        elif self.mode is Px4Mode.LAND:
            self.aircraft.hold_bank(0.0)
            self.aircraft.hold_climb(-_LAND_SINK_MPS)
        else:
            self._fly_circle()

    def _fly_setpoint(self) -> None:
        aircraft, setpoint = self.aircraft, self.offboard.control(self.flown_s)
        if setpoint is None or setpoint.kind is Kind.FROZEN:
            if not self._frozen:
                aircraft.hold_bank(aircraft.bank_rad)
                aircraft.hold_climb(aircraft.climb_mps)
            self._frozen = True
            return
        self._frozen = False
        setpoint.fly(aircraft, self.limits.loiter_radius_m)
        if setpoint.kind is not Kind.INVALID:
            self.target = self.frame.to_geo(*setpoint.place_m, -setpoint.altitude_m)

    # --- the mission ---

    def _start_or_resume(self) -> None:
        if self.mission.active is None and self.mission.completed:
            self._mission_over()
        else:
            super()._start_or_resume()

    def resume_line(self) -> None:
        """Fly on to the active item straight from here, without the climb of an entry."""
        self._climb_at = None
        super().resume_line()

    def _climb_first(self) -> None:
        """Plan a climb in a loiter if the item is further above than NAV_FW_ALT_RAD, as PX4 does."""
        below_m = self.wanted_altitude_m - self.aircraft.altitude_m
        far_below = below_m > self.parameters["NAV_FW_ALT_RAD"]
        if far_below and not self.on_ground and not self.taking_off:
            here = self.place
            self._climb_at = GeoPoint(here.lat_deg, here.lon_deg, self.wanted_altitude_m)

    def _repeat_speed_change(self) -> None:
        """Fly the mission's last speed again; unlike ArduPlane, PX4 remembers it at a mode change."""
        airspeed_mps = self.mission.airspeed_mps()
        if airspeed_mps is not None and airspeed_mps > 0.0:
            self.aircraft.hold_airspeed(airspeed_mps)

    def _leg_altitude_m(self, item: MissionItem, leg: Leg, here_m: Vec2) -> float:
        """A first-order hold toward a waypoint, reached at its acceptance; a loiter's height at once."""
        if item.command in mission_items.LOITERS:
            return leg.end_altitude_m
        acceptance_m = item.params[1] if item.params[1] > 0.0 else self.parameters["NAV_ACC_RAD"]
        return leg.altitude_m(here_m, acceptance_m)

    def _fly_mission(self) -> None:
        if self._climb_at is None:
            super()._fly_mission()
            return
        target, self.target = self.target, self._climb_at
        self._fly_circle()
        self.target = target
        if self._climb_at.altitude_m - self.aircraft.altitude_m <= self.parameters["NAV_FW_ALT_RAD"]:
            # As recorded from 1.18, it returns to the line from where the mission was entered.
            start_m, up_to_m = self.frame.to_ned_m(self._climb_at)[:2], self._climb_at.altitude_m
            self._climb_at = None
            self._leg = replace(self._leg, start_m=start_m, start_altitude_m=up_to_m)

    def _follow(self, leg: Leg) -> None:
        course_rad = course_to_line_rad(self.aircraft, leg.end_m, leg.course_rad, MISSION_TIME_S)
        self.aircraft.hold_course(course_rad)

    def _takeoff_done(self) -> None:
        self._change_mode(Px4Mode.HOLD)

    def _mission_over(self) -> None:
        if self.mission.items:
            self.events.append(Text(INFO, "Mission finished, loitering"))
        else:
            self._change_mode(Px4Mode.HOLD)

    def _fence_enabled(self) -> bool:
        return self.parameters["GF_ACTION"] > 0.0

    def _fence_action(self) -> None:
        self.events.append(Text(WARNING, "Geofence violated"))
        action = _FENCE_ACTIONS.get(int(self.parameters["GF_ACTION"]))
        if action is not None:
            self.set_mode(action)

    def _say(self, text: str) -> None:
        """Do nothing: PX4 does not report mission progress."""

    def _read_limits(self) -> Limits:
        return limits_of(self.parameters)
