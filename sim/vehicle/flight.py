"""The aircraft with an autopilot inside, as far as all autopilots are alike: ground, take-off, fence, time.

How the mission is flown is `mission_flight`; what any other mode flies, and what happens on entering it, is
the personality's (`ardupilot_flight`, `px4_flight`).
"""

import math
from abc import ABC, abstractmethod
from dataclasses import replace
from enum import IntEnum

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Vec2, Vec3
from sim.dynamics import Airframe, FixedWing
from sim.vehicle import mission as mission_items
from sim.vehicle.events import INFO, Event, FenceChanged, ItemReached, Text
from sim.vehicle.fence import Fence
from sim.vehicle.ground import LIFT_OFF_MPS, ROLL_ACCELERATION_MPS2, roll, touch_down
from sim.vehicle.limits import Limits
from sim.vehicle.mission import Mission
from sim.vehicle.navigation import circle
from sim.vehicle.parameters import Parameters
from sim.vehicle.sticks import Sticks

STEP_S = 0.05

# As recorded, at full throttle
_CLIMB_OUT_MPS = 10.0
_CLIMB_OUT_AIRSPEED_MPS = 27.0
_ENGINE_OFF_SINK_MPS = 2.5


class Flight(ABC):
    """Flies one simulated plane. `advance()` moves time by `STEP_S`; `events` collects what happened."""

    mode: IntEnum
    armed_text = "Throttle armed"
    disarmed_text = "Throttle disarmed"

    def __init__(
        self,
        home: GeoPoint,
        parameters: Parameters,
        mission: Mission,
        *,
        airframe: Airframe,
        heading_rad: float = 0.0,
        wind_mps: Vec2 = (0.0, 0.0),
    ) -> None:
        """Stand disarmed at home, pointing along `heading_rad`."""
        self.home = home
        self.frame = LocalFrame(home.lat_deg, home.lon_deg)
        self.parameters = parameters
        self.mission = mission
        self.fence = Fence(self.frame)
        self.fence_broken = False
        self.fence_breaches = 0
        self.armed = False
        self.on_ground = True
        self.in_trouble = False
        self.ground_speed_mps = 0.0
        self.flown_s = 0.0
        self.sticks = Sticks()
        self.events: list[Event] = []
        self._airframe = airframe
        self.limits = self._read_limits()
        self.aircraft = FixedWing((0.0, 0.0, -home.altitude_m), heading_rad, 0.0, wind_mps=wind_mps)
        self.aircraft.heading_rad = heading_rad  # wheels on the ground do not crab
        self.aircraft.hold_airspeed(self.limits.airspeed_cruise_mps)
        self.target: GeoPoint | None = None
        self._runway_rad = heading_rad
        self.apply_parameters()

    # --- what each autopilot does in its own way ---

    @property
    @abstractmethod
    def on_mission(self) -> bool:
        """Whether the mode is the one that flies the mission."""

    @property
    @abstractmethod
    def companion_flies(self) -> bool:
        """Whether the mode is the one that takes a companion's commands."""

    @property
    @abstractmethod
    def piloted(self) -> bool:
        """Whether the sticks fly."""

    @property
    @abstractmethod
    def uncontrolled(self) -> bool:
        """Whether the controller has gone wrong, and nothing that is asked for is flown."""

    @property
    @abstractmethod
    def taking_off_by_mode(self) -> bool:
        """Whether the mode is the one that takes off, and its height is not reached yet."""

    @abstractmethod
    def enter_mission(self) -> None:
        """Change to the mode that flies the mission."""

    @abstractmethod
    def return_home(self) -> None:
        """Change to the mode that flies home."""

    @abstractmethod
    def forget_commands(self) -> None:
        """As after a reboot: nothing that a companion asked for is known any more."""

    @abstractmethod
    def _read_limits(self) -> Limits:
        """What the parameters say now."""

    @abstractmethod
    def _fly_mode(self) -> None:
        """Command the aircraft for one step in the present mode, which is not the mission's."""

    @abstractmethod
    def _fly_mission(self) -> None:
        """Command the aircraft for one step of the mission."""

    @abstractmethod
    def _takeoff_done(self) -> None:
        """The height of a take-off that no mission asked for is reached."""

    @abstractmethod
    def _finish_item(self) -> None:
        """The mission item being flown is done."""

    @abstractmethod
    def _fence_action(self) -> None:
        """Do what the parameters want done when a fence is broken."""

    @abstractmethod
    def _fence_enabled(self) -> bool:
        """Whether fences are watched."""

    @abstractmethod
    def _say(self, text: str) -> None:
        """Tell the operator how the mission goes, where the autopilot does so."""

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
        if self.on_mission:
            return item is not None and item.command == mission_items.NAV_TAKEOFF
        return self.taking_off_by_mode

    @property
    def landing(self) -> bool:
        """True on the way down to a landing point."""
        item = self.mission.active
        return self.on_mission and item is not None and item.command == mission_items.NAV_LAND

    @property
    def wanted_altitude_m(self) -> float:
        """The height being flown to [m above mean sea level]."""
        return self.target.altitude_m if self.target is not None else self.aircraft.altitude_m

    # --- what others tell it ---

    def start_in_air(self, position: GeoPoint, course_rad: float, sequence: int) -> None:
        """Be in the air, armed and on the way to a mission item, level at cruise speed."""
        wind_mps = self.aircraft.wind_mps
        self.aircraft = FixedWing(
            self.frame.to_ned_m(position), course_rad, self.limits.airspeed_cruise_mps, wind_mps=wind_mps
        )
        self.on_ground = False
        self.armed = True
        self.apply_parameters()
        self.mission.select(sequence)
        self.enter_mission()
        self.events.clear()

    def apply_parameters(self) -> None:
        """Let the envelope parameters limit the aircraft."""
        self.limits = self._read_limits()
        self._cruising = self.limits.bound(self._airframe)
        self._climbing_out = replace(
            self._cruising,
            acceleration_limit_mps2=ROLL_ACCELERATION_MPS2,
            climb_limit_mps=max(_CLIMB_OUT_MPS, self._cruising.climb_limit_mps),
            climb_acceleration_limit_mps2=6.0,
        )
        self.aircraft.airframe = self._cruising

    def arm(self) -> None:
        """Allow the motor to turn."""
        if not self.armed:
            self.armed = True
            self.events.append(Text(INFO, self.armed_text))

    def disarm(self, *, force: bool = False) -> bool:
        """Stop the motor; refused in the air unless forced."""
        if self.armed and not self.on_ground and not force:
            return False
        if self.armed:
            self.armed = False
            self.events.append(Text(INFO, self.disarmed_text))
        return True

    # --- time ---

    def advance(self) -> None:
        """Fly on for `STEP_S`."""
        self.flown_s += STEP_S
        if self.on_ground:
            self._move_on_ground()
            return
        self._command()
        if not self.armed:
            self.aircraft.hold_climb(-_ENGINE_OFF_SINK_MPS)
        self.aircraft.step(STEP_S)
        self.ground_speed_mps = self.aircraft.ground_speed_mps
        if self.aircraft.altitude_m <= self.home.altitude_m and self.aircraft.climb_mps <= 0.0:
            self._touch_down()
        self._watch_fence()

    def _command(self) -> None:
        """Tell the aircraft what to do in the next step."""
        if self.taking_off:
            self._climb_out()
        elif self.on_mission:
            self._fly_mission()
        elif self.piloted:
            self.aircraft.hold_bank(self.sticks.roll * self.aircraft.airframe.bank_limit_rad)
        else:
            self._fly_mode()

    def _watch_fence(self) -> None:
        broken = self._fence_enabled() and self.fence.is_broken_at(self.aircraft.position_m[:2])
        if broken == self.fence_broken:
            return
        self.fence_broken = broken
        if broken:
            self.fence_breaches += 1
            self._fence_action()
        self.events.append(FenceChanged())

    # --- on the ground ---

    def _move_on_ground(self) -> None:
        """Roll for take-off, roll out after landing, or stand."""
        aircraft, taking_off = self.aircraft, self.taking_off
        self.ground_speed_mps = roll(aircraft, self.ground_speed_mps, accelerate=taking_off, dt_s=STEP_S)
        if taking_off and aircraft.airspeed_mps >= LIFT_OFF_MPS:
            self.on_ground = False
            self._runway_rad = aircraft.course_rad
        elif self.ground_speed_mps == 0.0 and self.armed and self.landing:
            if self.on_mission:
                self.mission.completed = True
                self.events.append(ItemReached(self.mission.current))
            self.disarm()

    def _touch_down(self) -> None:
        touch_down(self.aircraft, self.home.altitude_m)
        self.on_ground = True

    def _takeoff_altitude_m(self) -> float:
        item = self.mission.active
        if self.on_mission and item is not None:
            return item.altitude_amsl_m(self.home.altitude_m)
        return self.home.altitude_m + self.limits.takeoff_height_m

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
        aircraft.hold_airspeed(self.limits.airspeed_cruise_mps)
        self._say(f"Takeoff complete at {height_m:.2f}m")
        if self.on_mission:
            self._finish_item()
        else:
            self._takeoff_done()

    def _circle(self, centre: GeoPoint, altitude_m: float) -> None:
        self.target = GeoPoint(centre.lat_deg, centre.lon_deg, altitude_m)

    def _fly_circle(self, radius_m: float = 0.0) -> None:
        """Loiter around the target; a negative radius turns left."""
        radius_m = radius_m or self.limits.loiter_radius_m or 1.0
        if self.target is not None:
            circle(self.aircraft, self.frame.to_ned_m(self.target)[:2], radius_m)
        self.aircraft.hold_altitude(self.wanted_altitude_m)
