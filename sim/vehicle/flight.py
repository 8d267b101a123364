"""The part of the flight that both autopilots share: ground roll, take-off, fence, time steps.

`mission_flight` flies the mission; `ardupilot.flight` and `px4.flight` fly the other modes.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import replace
from enum import IntEnum

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Vec2, Vec3
from sim.dynamics import Airframe, FixedWing
from sim.vehicle import mission as mission_items
from sim.vehicle.fence import Fence
from sim.vehicle.mission import Mission
from sim.vehicle.navigation import circle
from sim.vehicle.outputs import INFO, Event, FenceChanged, ItemReached, Text
from sim.vehicle.parameters import Limits, Parameters
from sim.vehicle.peripherals import Sticks

STEP_S = 0.05

# Recorded from ArduPlane's simulated plane at full throttle.
_ROLL_ACCELERATION_MPS2 = 6.5
_LIFT_OFF_MPS = 18.0
_BRAKING_MPS2 = 3.0
_CLIMB_OUT_MPS = 10.0
_CLIMB_OUT_AIRSPEED_MPS = 27.0
_ENGINE_OFF_SINK_MPS = 2.5
# ICAO standard atmosphere: relative fall of temperature, and half the exponent of density.
_LAPSE_PER_M, _HALF_DENSITY_EXPONENT = 2.25577e-5, 2.12794


class Flight(ABC):
    """Flies one simulated plane. `advance()` moves time by `STEP_S`; `events` are still to be reported."""

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
        """Start disarmed at home, pointing along `heading_rad`."""
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
        self.aircraft.heading_rad = heading_rad  # no crab angle on the ground
        self.aircraft.hold_airspeed(self.limits.airspeed_cruise_mps)
        self.target: GeoPoint | None = None
        self._runway_rad = heading_rad
        self.apply_parameters()

    # --- what each autopilot implements ---

    @property
    def reports_failsafe(self) -> bool:
        """Whether the heartbeat shows a failsafe."""
        return self.in_trouble

    @property
    @abstractmethod
    def on_mission(self) -> bool:
        """True in the mode that flies the mission."""

    @property
    @abstractmethod
    def companion_flies(self) -> bool:
        """True in the mode that accepts a companion's commands."""

    @property
    @abstractmethod
    def piloted(self) -> bool:
        """True in the modes flown by the sticks."""

    @property
    @abstractmethod
    def uncontrolled(self) -> bool:
        """True while the controller's setpoint is invalid and commands have no effect."""

    @property
    @abstractmethod
    def taking_off_by_mode(self) -> bool:
        """True in the take-off mode until its height is reached."""

    @abstractmethod
    def enter_mission(self) -> None:
        """Change to the mode that flies the mission."""

    @abstractmethod
    def return_home(self) -> None:
        """Change to the mode that flies home."""

    @abstractmethod
    def forget_commands(self) -> None:
        """Drop all commands of a companion, as a reboot does."""

    @abstractmethod
    def _read_limits(self) -> Limits:
        """The limits by the present parameters."""

    @abstractmethod
    def _fly_mode(self) -> None:
        """Command the aircraft for one step in a mode other than the mission's."""

    @abstractmethod
    def _fly_mission(self) -> None:
        """Command the aircraft for one step of the mission."""

    @abstractmethod
    def _takeoff_done(self) -> None:
        """Called when a take-off outside the mission reaches its height."""

    @abstractmethod
    def _finish_item(self) -> None:
        """Called when the current mission item is done."""

    @abstractmethod
    def _fence_action(self) -> None:
        """Carry out the configured fence action."""

    @abstractmethod
    def _fence_enabled(self) -> bool:
        """True if the parameters enable fences."""

    @abstractmethod
    def _say(self, text: str) -> None:
        """Report mission progress to the operator, if the autopilot does so."""

    # --- state ---

    @property
    def place(self) -> GeoPoint:
        """Position of the aircraft, height above mean sea level."""
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
        """True from the start of the take-off run until its height is reached."""
        if not self.armed:
            return False
        item = self.mission.active
        if self.on_mission:
            return item is not None and item.command == mission_items.NAV_TAKEOFF
        return self.taking_off_by_mode

    @property
    def landing(self) -> bool:
        """True while descending to a landing point."""
        item = self.mission.active
        return self.on_mission and item is not None and item.command == mission_items.NAV_LAND

    @property
    def wanted_altitude_m(self) -> float:
        """The commanded height [m above mean sea level]."""
        return self.target.altitude_m if self.target is not None else self.aircraft.altitude_m

    # --- commands ---

    def start_in_air(self, position: GeoPoint, course_rad: float, sequence: int) -> None:
        """Start in the air, armed, level at cruise speed, on the way to a mission item."""
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
        """Limit the aircraft by the envelope parameters."""
        self.limits = self._read_limits()
        self._cruising = self.limits.bound(self._airframe)
        self._climbing_out = replace(
            self._cruising,
            acceleration_limit_mps2=_ROLL_ACCELERATION_MPS2,
            climb_limit_mps=max(_CLIMB_OUT_MPS, self._cruising.climb_limit_mps),
            climb_acceleration_limit_mps2=6.0,
        )
        self.aircraft.airframe = self._cruising

    def arm(self) -> None:
        """Arm the motor."""
        if not self.armed:
            self.armed = True
            self.events.append(Text(INFO, self.armed_text))

    def disarm(self, *, force: bool = False) -> bool:
        """Disarm the motor; refused in the air (False) unless forced."""
        if self.armed and not self.on_ground and not force:
            return False
        if self.armed:
            self.armed = False
            self.events.append(Text(INFO, self.disarmed_text))
        return True

    # --- time ---

    def advance(self) -> None:
        """Fly for `STEP_S`."""
        self.flown_s += STEP_S
        if self.on_ground:
            self._move_on_ground()
            return
        self.aircraft.true_per_indicated = true_per_indicated(self.aircraft.altitude_m)
        self._command()
        if not self.armed:
            self.aircraft.hold_climb(-_ENGINE_OFF_SINK_MPS)
        self.aircraft.step(STEP_S)
        self.ground_speed_mps = self.aircraft.ground_speed_mps
        if self.aircraft.altitude_m <= self.home.altitude_m and self.aircraft.climb_mps <= 0.0:
            self._touch_down()
        self._watch_fence()

    def _command(self) -> None:
        """Command the aircraft for the next step."""
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
        self.ground_speed_mps = _roll(aircraft, self.ground_speed_mps, accelerate=taking_off)
        if taking_off and aircraft.airspeed_mps >= _LIFT_OFF_MPS:
            self.on_ground = False
            self._runway_rad = aircraft.course_rad
        elif self.ground_speed_mps == 0.0 and self.armed and self.landing:
            if self.on_mission:
                self.mission.completed = True
                self.events.append(ItemReached(self.mission.current))
            self.disarm()

    def _touch_down(self) -> None:
        """Put the aircraft level on the ground, pointing along its course."""
        aircraft = self.aircraft
        aircraft.heading_rad = aircraft.course_rad
        aircraft.altitude_m = self.home.altitude_m
        aircraft.climb_mps = 0.0
        aircraft.bank_rad = 0.0
        self.on_ground = True

    def _takeoff_altitude_m(self) -> float:
        item = self.mission.active
        if self.on_mission and item is not None:
            return item.altitude_amsl_m(self.home.altitude_m)
        return self.home.altitude_m + self.limits.takeoff_height_m

    def _climb_out(self) -> None:
        """Fly straight ahead at full throttle until the take-off height."""
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
        """Loiter around the target; a negative radius turns left, 0 uses the parameter's."""
        radius_m = radius_m or self.limits.loiter_radius_m or 1.0
        if self.target is not None:
            circle(self.aircraft, self.frame.to_ned_m(self.target)[:2], radius_m)
        self.aircraft.hold_altitude(self.wanted_altitude_m)


def true_per_indicated(altitude_m: float) -> float:
    """True airspeed per indicated airspeed: the root of the density ratio of the standard atmosphere."""
    return math.pow(1.0 - _LAPSE_PER_M * min(max(altitude_m, -500.0), 11_000.0), -_HALF_DENSITY_EXPONENT)


def _roll(aircraft: FixedWing, ground_speed_mps: float, *, accelerate: bool) -> float:
    """Roll straight for one step, accelerating or braking; returns the ground speed afterwards [m/s]."""
    rate_mps2 = _ROLL_ACCELERATION_MPS2 if accelerate else -_BRAKING_MPS2
    speed_mps = max(ground_speed_mps + rate_mps2 * STEP_S, 0.0)
    ahead_n, ahead_e = math.cos(aircraft.heading_rad), math.sin(aircraft.heading_rad)
    way_m = 0.5 * (ground_speed_mps + speed_mps) * STEP_S
    aircraft.north_m += way_m * ahead_n
    aircraft.east_m += way_m * ahead_e
    tailwind_mps = aircraft.wind_north_mps * ahead_n + aircraft.wind_east_mps * ahead_e
    aircraft.airspeed_mps = max(speed_mps - tailwind_mps, 0.0)
    return speed_mps
