"""The aircraft with its autopilot inside: modes, arming, mission and guided flight, without any protocol."""

import math
from collections.abc import Sequence
from dataclasses import replace

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Vec2, Vec3
from sim.dynamics import Airframe, FixedWing
from sim.vehicle import mission as mission_items
from sim.vehicle.events import INFO, Event, ItemReached, Text
from sim.vehicle.ground import LIFT_OFF_MPS, ROLL_ACCELERATION_MPS2, roll, touch_down
from sim.vehicle.guided import GuidedTargets
from sim.vehicle.mission import Mission, MissionItem
from sim.vehicle.modes import PILOTED, Mode
from sim.vehicle.navigation import Leg, circle
from sim.vehicle.parameters import Parameters

STEP_S = 0.05

# A climb or sink demand of TECS_CLMB_MAX 5 came out as 4.5 m/s.
_CLIMB_EFFICIENCY = 0.9
# As recorded, at full throttle
_CLIMB_OUT_MPS = 10.0
_CLIMB_OUT_AIRSPEED_MPS = 27.0
_FLARE_HEIGHT_M = 3.0
_FLARE_SINK_MPS = 0.7
_ENGINE_OFF_SINK_MPS = 2.5
# Whatever the parameters say
_FASTEST_MPS, _FASTEST_CLIMB_MPS = 100.0, 20.0

_NO_MISSION_TEXT = "Aircraft in auto without a running mission"


class Flight:
    """Flies one simulated plane. `advance()` moves time by `STEP_S`; `events` collects what happened."""

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
        """Stand disarmed in MANUAL at home, pointing along `heading_rad`."""
        self.home = home
        self.frame = LocalFrame(home.lat_deg, home.lon_deg)
        self.parameters = parameters
        self.mission = Mission(home, items)
        self.mode = Mode.MANUAL
        self.armed = False
        self.on_ground = True
        self.ground_speed_mps = 0.0
        self.events: list[Event] = []
        self._airframe = airframe or Airframe()
        self.aircraft = FixedWing((0.0, 0.0, -home.altitude_m), heading_rad, 0.0, wind_mps=wind_mps)
        self.aircraft.heading_rad = heading_rad  # wheels on the ground do not crab
        self.aircraft.hold_airspeed(parameters["AIRSPEED_CRUISE"])
        self.guided = GuidedTargets(home, parameters["WP_LOITER_RAD"], altitude_m=home.altitude_m)
        self.target: GeoPoint | None = None
        self._leg = Leg((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
        self._runway_rad = heading_rad
        self.apply_parameters()

    # --- what others ask ---

    @property
    def place(self) -> GeoPoint:
        """Where the aircraft is, height above mean sea level."""
        return self.frame.to_geo(*self.aircraft.position_m)

    @property
    def velocity_mps(self) -> Vec3:
        """Velocity over ground: north, east, down [m/s]."""
        if not self.on_ground:
            return self.aircraft.velocity_mps
        heading_rad = self.aircraft.heading_rad
        return (
            self.ground_speed_mps * math.cos(heading_rad),
            self.ground_speed_mps * math.sin(heading_rad),
            0.0,
        )

    @property
    def taking_off(self) -> bool:
        """True from the start of the take-off run to its height."""
        if not self.armed:
            return False
        item = self.mission.active
        if self.mode is Mode.AUTO:
            return item is not None and item.command == mission_items.NAV_TAKEOFF
        return self.mode is Mode.TAKEOFF and self.aircraft.altitude_m < self._takeoff_altitude_m()

    @property
    def landing(self) -> bool:
        """True on the way down to a landing point."""
        item = self.mission.active
        return self.mode is Mode.AUTO and item is not None and item.command == mission_items.NAV_LAND

    @property
    def wanted_altitude_m(self) -> float:
        """The height being flown to [m above mean sea level]."""
        if self.mode is Mode.GUIDED:
            return self.guided.altitude_m
        return self.target.altitude_m if self.target is not None else self.aircraft.altitude_m

    # --- what others tell it ---

    def start_in_air(self, position: GeoPoint, course_rad: float, sequence: int) -> None:
        """Be in the air, armed, in AUTO and on the way to a mission item, level at cruise speed."""
        wind_mps = self.aircraft.wind_mps
        self.aircraft = FixedWing(
            self.frame.to_ned_m(position), course_rad, self.parameters["AIRSPEED_CRUISE"], wind_mps=wind_mps
        )
        self.on_ground = False
        self.armed = True
        self.mode = Mode.AUTO
        self.apply_parameters()
        self.mission.select(sequence)
        self._start_item()

    def apply_parameters(self) -> None:
        """Let the envelope parameters limit the aircraft."""
        values = self.parameters
        self._cruising = replace(
            self._airframe,
            bank_limit_rad=math.radians(min(max(values["ROLL_LIMIT_DEG"], 5.0), 80.0)),
            airspeed_min_mps=min(max(values["AIRSPEED_MIN"], 5.0), _FASTEST_MPS),
            airspeed_max_mps=min(max(values["AIRSPEED_MAX"], 5.0), _FASTEST_MPS),
            climb_limit_mps=_CLIMB_EFFICIENCY * min(max(values["TECS_CLMB_MAX"], 0.1), _FASTEST_CLIMB_MPS),
            sink_limit_mps=_CLIMB_EFFICIENCY * min(max(values["TECS_SINK_MAX"], 0.1), _FASTEST_CLIMB_MPS),
        )
        self._climbing_out = replace(
            self._cruising,
            acceleration_limit_mps2=ROLL_ACCELERATION_MPS2,
            climb_limit_mps=max(_CLIMB_OUT_MPS, self._cruising.climb_limit_mps),
            climb_acceleration_limit_mps2=6.0,
        )
        self.aircraft.airframe = self._cruising

    def set_mode(self, mode: Mode) -> None:
        """Change the mode, as a pilot or a command does; every entry forgets the guided targets."""
        if mode is self.mode:
            return
        self.mode = mode
        self.aircraft.airframe = self._cruising
        self.aircraft.hold_airspeed(self.parameters["AIRSPEED_CRUISE"])
        here = self.place
        self.guided = GuidedTargets(here, self.parameters["WP_LOITER_RAD"], altitude_m=here.altitude_m)
        self.target = here
        if mode is Mode.AUTO:
            self._start_or_resume()
        elif mode is Mode.RTL:
            self._circle(self.home, self.home.altitude_m + self.parameters["RTL_ALTITUDE"])
        elif mode in PILOTED:
            self.aircraft.hold_altitude(here.altitude_m)

    def arm(self) -> None:
        """Allow the motor to turn."""
        if not self.armed:
            self.armed = True
            self.events.append(Text(INFO, "Throttle armed"))

    def disarm(self, *, force: bool = False) -> bool:
        """Stop the motor; refused in the air unless forced."""
        if self.armed and not self.on_ground and not force:
            return False
        if self.armed:
            self.armed = False
            self.events.append(Text(INFO, "Throttle disarmed"))
        return True

    def load_mission(self, items: Sequence[MissionItem]) -> None:
        """Fly another mission: from its first item when in AUTO, otherwise when AUTO comes."""
        self.mission.replace(items)
        if self.mode is Mode.AUTO:
            self._start_or_resume()

    def select_item(self, sequence: int) -> bool:
        """Go to a mission item, now when in AUTO; False when there is none."""
        if not self.mission.select(sequence):
            return False
        if self.mode is Mode.AUTO:
            self._start_or_resume()
        return True

    def reposition(self, place: GeoPoint, radius_m: float) -> None:
        """In GUIDED: fly there and circle; a negative radius turns left, 0 takes the parameter's."""
        self.guided.go_to(place, radius_m or self.parameters["WP_LOITER_RAD"])
        self.target = place

    # --- time ---

    def advance(self) -> None:
        """Fly on for `STEP_S`."""
        if self.on_ground:
            self._move_on_ground()
            return
        if self.taking_off:
            self._climb_out()
        elif self.mode is Mode.AUTO:
            self._fly_mission()
        elif self.mode is Mode.GUIDED:
            self.guided.fly(self.aircraft, self.frame)
        elif self.mode in PILOTED:
            self.aircraft.hold_bank(0.0)  # nobody touches the sticks
        elif self.mode is Mode.CIRCLE:
            self.aircraft.hold_bank(self.aircraft.airframe.bank_limit_rad / 3.0)
            self.aircraft.hold_altitude(self.wanted_altitude_m)
        else:
            self._fly_circle()
        if not self.armed:
            self.aircraft.hold_climb(-_ENGINE_OFF_SINK_MPS)
        self.aircraft.step(STEP_S)
        self.ground_speed_mps = self.aircraft.ground_speed_mps
        if self.aircraft.altitude_m <= self.home.altitude_m and self.aircraft.climb_mps <= 0.0:
            self._touch_down()

    # --- on the ground ---

    def _move_on_ground(self) -> None:
        """Roll for take-off, roll out after landing, or stand."""
        aircraft, taking_off = self.aircraft, self.taking_off
        self.ground_speed_mps = roll(aircraft, self.ground_speed_mps, accelerate=taking_off, dt_s=STEP_S)
        if taking_off and aircraft.airspeed_mps >= LIFT_OFF_MPS:
            self.on_ground = False
            self._runway_rad = aircraft.course_rad
        elif self.ground_speed_mps == 0.0 and self.armed and self.landing:
            self.mission.completed = True
            self.events.append(ItemReached(self.mission.current))
            self.disarm()

    def _touch_down(self) -> None:
        touch_down(self.aircraft, self.home.altitude_m)
        self.on_ground = True

    def _takeoff_altitude_m(self) -> float:
        item = self.mission.active
        if self.mode is Mode.AUTO and item is not None:
            return item.altitude_amsl_m(self.home.altitude_m)
        return self.home.altitude_m + self.parameters["TKOFF_ALT"]

    def _climb_out(self) -> None:
        """Straight ahead at full throttle until the take-off height."""
        aircraft = self.aircraft
        aircraft.airframe = self._climbing_out
        aircraft.hold_course(self._runway_rad)
        aircraft.hold_airspeed(min(_CLIMB_OUT_AIRSPEED_MPS, self._cruising.airspeed_max_mps))
        aircraft.hold_climb(_CLIMB_OUT_MPS)
        if aircraft.altitude_m < self._takeoff_altitude_m():
            return
        height_m = aircraft.altitude_m - self.home.altitude_m
        aircraft.airframe = self._cruising
        aircraft.hold_airspeed(self.parameters["AIRSPEED_CRUISE"])
        self.events.append(Text(INFO, f"Takeoff complete at {height_m:.2f}m"))
        if self.mode is Mode.AUTO:
            self._finish_item()
        else:
            self._circle(self.place, self._takeoff_altitude_m())

    # --- AUTO ---

    def _start_or_resume(self) -> None:
        if self.mission.active is None:
            self.mission.current = 0
            self.mission.advance()
        self._start_item()

    def _start_item(self) -> None:
        """Begin the active item from where the aircraft is; without one go home."""
        item = self.mission.active
        while item is not None:
            self.events.append(Text(INFO, f"Mission: {self.mission.current} {item.name}"))
            if item.command in mission_items.NAVIGATION:
                break
            if item.command == mission_items.DO_CHANGE_SPEED and item.params[0] == 0.0 < item.params[1]:
                self.aircraft.hold_airspeed(item.params[1])
            item = self.mission.advance()
        if item is None:
            because = "Mission complete, changing mode to RTL" if self.mission.items else _NO_MISSION_TEXT
            self.events.append(Text(INFO, because))
            self.set_mode(Mode.RTL)
            return
        if item.command == mission_items.NAV_TAKEOFF and not self.on_ground:
            self._runway_rad = self.aircraft.course_rad
        if item.command == mission_items.NAV_RETURN_TO_LAUNCH:
            self._circle(self.home, self.home.altitude_m + self.parameters["RTL_ALTITUDE"])
            return
        self.target = item.place(self.place, self.home.altitude_m)
        self._leg = self._leg_to(self.target)

    def _leg_to(self, target: GeoPoint) -> Leg:
        """From here to the active item, knowing where the mission turns to after it."""
        following = self.mission.next_navigation()
        end_m = next_m = self.frame.to_ned_m(target)[:2]
        if following is not None:
            next_m = self.frame.to_ned_m(following.place(target, self.home.altitude_m))[:2]
        return Leg(self.aircraft.position_m[:2], end_m, next_m)

    def _finish_item(self) -> None:
        self.events.append(ItemReached(self.mission.current))
        done, corner_m = self.mission.active, self._leg.end_m
        self.mission.advance()
        self._start_item()
        if done is not None and done.command == mission_items.NAV_WAYPOINT:
            self._leg = replace(self._leg, start_m=corner_m)  # not where the turn began

    def _fly_mission(self) -> None:
        item = self.mission.active
        if item is None:
            return
        if item.command in (mission_items.NAV_LOITER_UNLIM, mission_items.NAV_RETURN_TO_LAUNCH):
            self._fly_circle(item.params[2] if item.command == mission_items.NAV_LOITER_UNLIM else 0.0)
            return
        aircraft, leg = self.aircraft, self._leg
        here_m = (aircraft.north_m, aircraft.east_m)
        aircraft.hold_bank(leg.bank_rad(here_m, aircraft.velocity_mps[:2]))
        distance_m = math.dist(here_m, leg.end_m)
        if item.command == mission_items.NAV_LAND:
            self._glide_to(distance_m)
            return
        aircraft.hold_altitude(self.wanted_altitude_m)
        acceptance_m = item.params[1]
        if not acceptance_m > 0.0:
            acceptance_m = leg.turn_distance_m(self.ground_speed_mps, self.parameters["WP_RADIUS"])
        if distance_m <= acceptance_m or leg.is_passed(here_m):
            self.events.append(Text(INFO, f"Reached waypoint #{self.mission.current} dist {distance_m:.0f}m"))
            self._finish_item()

    def _glide_to(self, distance_m: float) -> None:
        """Come down to reach the ground at the landing point, with a flare at the end."""
        height_m = self.aircraft.altitude_m - self.home.altitude_m
        if height_m <= _FLARE_HEIGHT_M:
            self.aircraft.hold_climb(-_FLARE_SINK_MPS)
            return
        seconds = max(distance_m / max(self.ground_speed_mps, 1.0), 1.0)
        self.aircraft.hold_climb(-height_m / seconds)

    def _circle(self, centre: GeoPoint, altitude_m: float) -> None:
        self.target = GeoPoint(centre.lat_deg, centre.lon_deg, altitude_m)

    def _fly_circle(self, radius_m: float = 0.0) -> None:
        """Loiter around the target; a negative radius turns left."""
        radius_m = radius_m or self.parameters["WP_LOITER_RAD"] or 1.0
        if self.target is not None:
            circle(self.aircraft, self.frame.to_ned_m(self.target)[:2], radius_m)
        self.aircraft.hold_altitude(self.wanted_altitude_m)
