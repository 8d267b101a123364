"""A fixed wing as a point mass: coordinated turns, lags and limits, carried by the wind."""

import math
from dataclasses import dataclass

from companion.model import Vec2, Vec3
from companion.units import STANDARD_GRAVITY_MPS2, wrap_two_pi

_PI = math.pi
_TWO_PI = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class Airframe:
    """What an aircraft can do. The defaults follow ArduPlane's simulated plane as it was measured."""

    bank_limit_rad: float = math.radians(45.0)
    roll_rate_limit_rps: float = math.radians(75.0)
    roll_lag_s: float = 0.5
    # Degrees of bank per radian of course error. With 41 and a bank limit of atan(5 / g) the turn from 91 to
    # 14 degrees on the way to 10 takes the 9.5 s that were measured.
    bank_per_course_error: float = math.radians(41.0)
    airspeed_min_mps: float = 10.0
    airspeed_max_mps: float = 30.0
    acceleration_limit_mps2: float = 1.0
    airspeed_lag_s: float = 1.0
    climb_limit_mps: float = 4.5
    sink_limit_mps: float = 4.5
    climb_acceleration_limit_mps2: float = 3.0
    climb_lag_s: float = 0.7
    altitude_lag_s: float = 3.0


class FixedWing:
    """Position (north, east, down) and motion of one aircraft, and the commands that it follows.

    Commands stay until replaced: a bank or a course over ground; a climb rate or an altitude; an airspeed.
    `altitude_m` is height above the zero of the frame, so down is its negative. Limits are clamped, never
    refused. There is no clock: `step(dt_s)` is all that moves time, and the same steps give the same bits.
    """

    __slots__ = (
        "_altitude_command_m",
        "_bank_command_rad",
        "_bank_limit_rad",
        "_climb_command_mps",
        "_course_command_rad",
        "airframe",
        "airspeed_command_mps",
        "airspeed_mps",
        "altitude_m",
        "bank_rad",
        "climb_mps",
        "east_m",
        "heading_rad",
        "north_m",
        "wind_east_mps",
        "wind_north_mps",
    )

    def __init__(
        self,
        position_m: Vec3 = (0.0, 0.0, 0.0),
        course_rad: float = 0.0,
        airspeed_mps: float = 22.0,
        *,
        wind_mps: Vec2 = (0.0, 0.0),
        airframe: Airframe | None = None,
    ) -> None:
        """Start level and steady on a course over ground; `wind_mps` is the air's velocity (north, east)."""
        self.airframe = airframe or Airframe()
        self.north_m, self.east_m = position_m[0], position_m[1]
        self.altitude_m = -position_m[2]
        self.wind_north_mps, self.wind_east_mps = wind_mps
        self.airspeed_mps = airspeed_mps
        self.heading_rad = heading_for_course_rad(course_rad, airspeed_mps, wind_mps)
        self.bank_rad = 0.0
        self.climb_mps = 0.0
        self.airspeed_command_mps = airspeed_mps
        self._bank_limit_rad = self.airframe.bank_limit_rad
        self._bank_command_rad = 0.0
        self._course_command_rad: float | None = course_rad
        self._climb_command_mps = 0.0
        self._altitude_command_m: float | None = self.altitude_m

    @property
    def position_m(self) -> Vec3:
        """North, east, down [m]."""
        return self.north_m, self.east_m, -self.altitude_m

    @property
    def velocity_mps(self) -> Vec3:
        """Velocity over ground: north, east, down [m/s]."""
        north_mps, east_mps = self.ground_velocity_mps
        return north_mps, east_mps, -self.climb_mps

    @property
    def course_rad(self) -> float:
        """Course over ground, clockwise from true north, in [0, 2 pi); the heading when standing still."""
        north_mps, east_mps = self.ground_velocity_mps
        if north_mps * north_mps + east_mps * east_mps < 1e-6:
            return wrap_two_pi(self.heading_rad)
        return wrap_two_pi(math.atan2(east_mps, north_mps))

    @property
    def ground_speed_mps(self) -> float:
        """Horizontal speed over ground [m/s]."""
        return math.hypot(*self.ground_velocity_mps)

    @property
    def wind_mps(self) -> Vec2:
        """Velocity of the air over the ground: north, east [m/s]."""
        return self.wind_north_mps, self.wind_east_mps

    @property
    def turn_rate_rps(self) -> float:
        """Rate of change of heading in the coordinated turn, g tan(bank) / V [rad/s]."""
        return STANDARD_GRAVITY_MPS2 * math.tan(self.bank_rad) / max(self.airspeed_mps, 1.0)

    def hold_bank(self, bank_rad: float) -> None:
        """Roll to a bank angle, positive to the right."""
        self._bank_command_rad = _limited(bank_rad, self.airframe.bank_limit_rad)
        self._course_command_rad = None

    def hold_course(self, course_rad: float, bank_limit_rad: float | None = None) -> None:
        """Turn to a course over ground and keep it, crabbing into the wind."""
        limit_rad = self.airframe.bank_limit_rad
        self._bank_limit_rad = limit_rad if bank_limit_rad is None else min(abs(bank_limit_rad), limit_rad)
        self._course_command_rad = course_rad

    def hold_altitude(self, altitude_m: float) -> None:
        """Climb or sink to an altitude and keep it."""
        self._altitude_command_m = altitude_m

    def hold_climb(self, climb_mps: float) -> None:
        """Keep a climb rate, positive up."""
        self._climb_command_mps = climb_mps
        self._altitude_command_m = None

    def hold_airspeed(self, airspeed_mps: float) -> None:
        """Accelerate or slow down to an airspeed and keep it."""
        frame = self.airframe
        self.airspeed_command_mps = min(max(airspeed_mps, frame.airspeed_min_mps), frame.airspeed_max_mps)

    def step(self, dt_s: float) -> None:
        """Fly on for a short time (0.1 s at most for the lags to be smooth)."""
        frame = self.airframe
        bank_rad = self._roll(frame, dt_s)

        error_mps = self.airspeed_command_mps - self.airspeed_mps
        acceleration_mps2 = _limited(error_mps / frame.airspeed_lag_s, frame.acceleration_limit_mps2)
        airspeed_mps = self.airspeed_mps = self.airspeed_mps + acceleration_mps2 * dt_s

        climb_mps = self._climb(frame, dt_s)

        # g tan(bank) / V, and the heading halfway through the step carries the position.
        slow_mps = airspeed_mps if airspeed_mps > 1.0 else 1.0
        turn_rad = STANDARD_GRAVITY_MPS2 * math.tan(bank_rad) / slow_mps * dt_s
        midway_rad = self.heading_rad + 0.5 * turn_rad
        self.heading_rad = (self.heading_rad + turn_rad) % _TWO_PI
        over_ground_m = _horizontal_mps(airspeed_mps, climb_mps) * dt_s
        self.north_m += over_ground_m * math.cos(midway_rad) + self.wind_north_mps * dt_s
        self.east_m += over_ground_m * math.sin(midway_rad) + self.wind_east_mps * dt_s

    def _roll(self, frame: Airframe, dt_s: float) -> float:
        """Follow the bank command, or the bank that the course command asks for; the new bank [rad]."""
        if self._course_command_rad is not None:
            north_mps, east_mps = self.ground_velocity_mps
            error_rad = (self._course_command_rad - math.atan2(east_mps, north_mps) + _PI) % _TWO_PI - _PI
            wanted_rad = _limited(frame.bank_per_course_error * error_rad, self._bank_limit_rad)
        else:
            wanted_rad = self._bank_command_rad
        rate_rps = _limited((wanted_rad - self.bank_rad) / frame.roll_lag_s, frame.roll_rate_limit_rps)
        self.bank_rad += rate_rps * dt_s
        return self.bank_rad

    def _climb(self, frame: Airframe, dt_s: float) -> float:
        """Follow the climb or altitude command, and move up or down with it; the new climb rate [m/s]."""
        if self._altitude_command_m is not None:
            wanted_mps = (self._altitude_command_m - self.altitude_m) / frame.altitude_lag_s
        else:
            wanted_mps = self._climb_command_mps
        if wanted_mps > frame.climb_limit_mps:
            wanted_mps = frame.climb_limit_mps
        elif wanted_mps < -frame.sink_limit_mps:
            wanted_mps = -frame.sink_limit_mps
        before_mps = self.climb_mps
        rate_mps2 = _limited(
            (wanted_mps - before_mps) / frame.climb_lag_s, frame.climb_acceleration_limit_mps2
        )
        climb_mps = self.climb_mps = before_mps + rate_mps2 * dt_s
        self.altitude_m += 0.5 * (before_mps + climb_mps) * dt_s
        return climb_mps

    @property
    def ground_velocity_mps(self) -> Vec2:
        """Horizontal velocity over ground: north, east [m/s]."""
        horizontal_mps, heading_rad = _horizontal_mps(self.airspeed_mps, self.climb_mps), self.heading_rad
        return (
            horizontal_mps * math.cos(heading_rad) + self.wind_north_mps,
            horizontal_mps * math.sin(heading_rad) + self.wind_east_mps,
        )


def _horizontal_mps(airspeed_mps: float, climb_mps: float) -> float:
    """What of the airspeed is not climb."""
    square = airspeed_mps * airspeed_mps - climb_mps * climb_mps
    return math.sqrt(square) if square > 0.0 else 0.0


def _limited(value: float, limit: float) -> float:
    """As `min` and `max` would, in a third of their time: a step has many of these, a campaign millions."""
    return limit if value > limit else -limit if value < -limit else value


def heading_for_course_rad(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> float:
    """The heading that makes a course good in a wind; straight upwind of it where the wind is too strong."""
    across_mps = wind_mps[1] * math.cos(course_rad) - wind_mps[0] * math.sin(course_rad)
    if airspeed_mps <= 0.0:
        return wrap_two_pi(course_rad)
    crab = min(max(across_mps / airspeed_mps, -1.0), 1.0)
    return wrap_two_pi(course_rad - math.asin(crab))
