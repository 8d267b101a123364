"""A fixed wing as a point mass, and the bank that follows a line.

Compiled where there is a C compiler, otherwise plain Python with the same bits. The rules for a change are
those of `companion.compiled.kernels`. Everything is double precision, and operations are neither reordered
nor fused.
"""

from __future__ import annotations

import numpy as np

from companion.units import STANDARD_GRAVITY_MPS2
from sim.airframe import Airframe, heading_for_course_rad

try:
    import cython as c
except ImportError:
    from companion.compiled import no_cython as c

if c.compiled:
    from cython.cimports.libc.math import asin, atan, atan2, cos, fmod, hypot, sin, sqrt, tan
else:
    from math import asin, atan, atan2, cos, fmod, sin, sqrt, tan

    def hypot(north, east):
        """The C library's hypot; that of Python's `math` rounds differently."""
        return abs(complex(north, east))


GRAVITY_MPS2 = c.declare(c.double, STANDARD_GRAVITY_MPS2)
PI = c.declare(c.double, 3.141592653589793)
TWO_PI = c.declare(c.double, 2.0 * PI)
# ArduPlane's L1 controller with its defaults: NAVL1_PERIOD 17 s and NAVL1_DAMPING 0.75.
L1_TIME_S = 0.75 * 17.0 / PI
L1_S = c.declare(c.double, L1_TIME_S)
L1_GAIN = c.declare(c.double, 4.0 * 0.75 * 0.75)
HUGE = c.declare(c.double, 1e9)
STEEPEST = c.declare(c.double, 0.7071)  # sine of the largest angle at which a line is intercepted


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _limited(value: c.double, limit: c.double) -> c.double:
    return limit if value > limit else -limit if value < -limit else value


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _modulo(value: c.double, divisor: c.double) -> c.double:
    """The remainder in [0, divisor), as Python's `%`."""
    left = fmod(value, divisor)
    return left + divisor if left < 0.0 else left


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _wrap_two_pi(angle_rad: c.double) -> c.double:
    """The same angle in [0, 2 pi)."""
    wrapped = _modulo(angle_rad, TWO_PI)
    return 0.0 if wrapped >= TWO_PI else wrapped  # a tiny negative angle rounds up to 2 pi itself


@c.cfunc
@c.inline
@c.exceptval(check=False)
def _wrap_pi(angle_rad: c.double) -> c.double:
    """The same angle in [-pi, pi)."""
    return _modulo(angle_rad + PI, TWO_PI) - PI


@c.cclass
class FixedWing:
    """Position (north, east, down) and motion of one aircraft, and the commands that it follows.

    A command holds until it is replaced: a bank or a course over ground; a climb rate or an altitude; an
    airspeed. `altitude_m` is height above the zero of the frame, so down is its negative. Commands beyond a
    limit are clamped, never refused. There is no clock: only `step(dt_s)` and `fly` move time, and the same
    steps give the same bits.
    """

    north_m = c.declare(c.double, visibility="public")
    east_m = c.declare(c.double, visibility="public")
    altitude_m = c.declare(c.double, visibility="public")
    wind_north_mps = c.declare(c.double, visibility="public")
    wind_east_mps = c.declare(c.double, visibility="public")
    airspeed_mps = c.declare(c.double, visibility="public")
    heading_rad = c.declare(c.double, visibility="public")
    bank_rad = c.declare(c.double, visibility="public")
    climb_mps = c.declare(c.double, visibility="public")
    airspeed_command_mps = c.declare(c.double, visibility="public")
    true_per_indicated = c.declare(c.double, visibility="public")
    _airframe: object
    _bank_limit_rad: c.double
    _bank_command_rad: c.double
    _course_command_rad: c.double
    _climb_command_mps: c.double
    _altitude_command_m: c.double
    _altitude_rate_mps: c.double
    _altitude_demand_m: c.double
    _holds_course: c.bint
    _holds_altitude: c.bint
    # The airframe's, for the steps.
    _most_bank_rad: c.double
    _roll_rate_limit_rps: c.double
    _roll_lag_s: c.double
    _turn_share: c.double
    _bank_per_course_error: c.double
    _acceleration_limit_mps2: c.double
    _airspeed_lag_s: c.double
    _climb_without_acceleration_mps: c.double
    _airspeed_gain_climbing: c.double
    _airspeed_loss_sinking: c.double
    _climb_limit_mps: c.double
    _sink_limit_mps: c.double
    _climb_acceleration_limit_mps2: c.double
    _climb_lag_s: c.double
    _altitude_lag_s: c.double
    _altitude_feed_forward: c.double
    _catch_up: c.double
    _climb_loss_slow: c.double

    def __init__(
        self, position_m=(0.0, 0.0, 0.0), course_rad: c.double = 0.0, airspeed_mps: c.double = 22.0, *,
        wind_mps=(0.0, 0.0), airframe=None,
    ):  # fmt: skip
        """Start level and steady on a course over ground; `wind_mps` is the air's velocity (north, east)."""
        self.airframe = Airframe() if airframe is None else airframe
        self.north_m, self.east_m = float(position_m[0]), float(position_m[1])
        self.altitude_m = float(-position_m[2])
        self.wind_north_mps, self.wind_east_mps = wind_mps
        self.airspeed_mps = self.airspeed_command_mps = airspeed_mps
        self.heading_rad = heading_for_course_rad(course_rad, airspeed_mps, wind_mps)
        self.bank_rad = self.climb_mps = 0.0
        self._bank_limit_rad = self._airframe.bank_limit_rad
        self._bank_command_rad = self._climb_command_mps = 0.0
        self._holds_course, self._course_command_rad = True, course_rad
        self._holds_altitude = True
        self._altitude_command_m = self._altitude_demand_m = self.altitude_m
        self._altitude_rate_mps = HUGE
        self.true_per_indicated = 1.0

    @property
    def airframe(self):
        """Limits and lags of the aircraft; may be replaced at any time."""
        return self._airframe

    @airframe.setter
    def airframe(self, airframe):
        self._airframe, self._most_bank_rad = airframe, airframe.bank_limit_rad
        self._roll_rate_limit_rps, self._roll_lag_s = airframe.roll_rate_limit_rps, airframe.roll_lag_s
        self._turn_share = airframe.turn_share
        self._bank_per_course_error = airframe.bank_per_course_error
        self._acceleration_limit_mps2 = airframe.acceleration_limit_mps2
        self._airspeed_lag_s = airframe.airspeed_lag_s
        self._climb_without_acceleration_mps = airframe.climb_without_acceleration_mps
        self._airspeed_gain_climbing = airframe.airspeed_gain_climbing
        self._airspeed_loss_sinking = airframe.airspeed_loss_sinking
        self._climb_limit_mps, self._sink_limit_mps = airframe.climb_limit_mps, airframe.sink_limit_mps
        self._climb_acceleration_limit_mps2 = airframe.climb_acceleration_limit_mps2
        self._climb_lag_s, self._altitude_lag_s = airframe.climb_lag_s, airframe.altitude_lag_s
        self._altitude_feed_forward = airframe.altitude_feed_forward
        self._catch_up, self._climb_loss_slow = airframe.catch_up, airframe.climb_loss_slow

    @property
    def position_m(self):
        """North, east, down [m]."""
        return self.north_m, self.east_m, -self.altitude_m

    @property
    def velocity_mps(self):
        """Velocity over ground: north, east, down [m/s]."""
        return self._north_mps(), self._east_mps(), -self.climb_mps

    @property
    def ground_velocity_mps(self):
        """Horizontal velocity over ground: north, east [m/s]."""
        return self._north_mps(), self._east_mps()

    @property
    def course_rad(self):
        """Course over ground, clockwise from true north, in [0, 2 pi); the heading when standing still."""
        north_mps, east_mps = self._north_mps(), self._east_mps()
        if north_mps * north_mps + east_mps * east_mps < 1e-6:
            return _wrap_two_pi(self.heading_rad)
        return _wrap_two_pi(atan2(east_mps, north_mps))

    @property
    def ground_speed_mps(self):
        """Horizontal speed over ground [m/s]."""
        return hypot(self._north_mps(), self._east_mps())

    @property
    def wind_mps(self):
        """Velocity of the air over the ground: north, east [m/s]."""
        return self.wind_north_mps, self.wind_east_mps

    @property
    def turn_rate_rps(self):
        """Rate of change of heading: a share of that of the coordinated turn, g tan(bank) / V [rad/s]."""
        return self._turn_rate_rps()

    def hold_bank(self, bank_rad: c.double):
        """Roll to a bank angle, positive to the right."""
        self._hold_bank(bank_rad)

    def hold_course(self, course_rad: c.double, bank_limit_rad=None):
        """Turn to a course over ground and keep it, crabbing into the wind."""
        limit_rad = self._most_bank_rad
        self._bank_limit_rad = limit_rad if bank_limit_rad is None else min(abs(bank_limit_rad), limit_rad)
        self._holds_course, self._course_command_rad = True, course_rad

    def hold_altitude(self, altitude_m: c.double, rate_mps: c.double = HUGE):
        """Climb or sink to an altitude, no faster than a rate, and keep it."""
        if not self._holds_altitude:
            self._altitude_demand_m = self.altitude_m
        self._holds_altitude, self._altitude_command_m, self._altitude_rate_mps = True, altitude_m, rate_mps

    def hold_climb(self, climb_mps: c.double):
        """Keep a climb rate, positive up."""
        self._holds_altitude, self._climb_command_mps = False, climb_mps

    def hold_airspeed(self, airspeed_mps: c.double):
        """Accelerate or slow down to an airspeed and keep it."""
        low_mps: c.double = self._airframe.airspeed_min_mps
        high_mps: c.double = self._airframe.airspeed_max_mps
        self.airspeed_command_mps = min(max(airspeed_mps, low_mps), high_mps)

    def step(self, dt_s: c.double):
        """Fly for a short time, at most 0.1 s, so that the lags are smooth."""
        self._step(dt_s)

    def fly(self, steps: c.Py_ssize_t, dt_s: c.double, line=None):
        """Fly a number of steps; returns the position after each, north-east-down [m], (steps, 3).

        The aircraft follows its commands or, with `line`, the bank that joins the line from one place (north,
        east) to another.
        """
        start_north_m: c.double = 0.0
        start_east_m: c.double = 0.0
        end_north_m: c.double = 0.0
        end_east_m: c.double = 0.0
        follows = line is not None
        if follows:
            (start_north_m, start_east_m), (end_north_m, end_east_m) = line
        positions_m = np.empty((steps, 3))
        position_m: c.double[:, ::1] = positions_m
        for i in range(steps):
            if follows:
                self._hold_bank(_line_bank_rad(
                    self.north_m, self.east_m, self._north_mps(), self._east_mps(),
                    start_north_m, start_east_m, end_north_m, end_east_m,
                ))  # fmt: skip
            self._step(dt_s)
            position_m[i, 0], position_m[i, 1], position_m[i, 2] = self.north_m, self.east_m, -self.altitude_m
        return positions_m

    @c.cfunc
    @c.exceptval(check=False)
    def _hold_bank(self, bank_rad: c.double) -> c.void:
        self._bank_command_rad = _limited(bank_rad, self._most_bank_rad)
        self._holds_course = False

    @c.cfunc
    @c.exceptval(check=False)
    def _step(self, dt_s: c.double) -> c.void:
        self._roll(dt_s)
        self._accelerate(dt_s)
        # The heading halfway through the step carries the position.
        turn_rad = self._turn_rate_rps() * dt_s
        midway_rad = self.heading_rad + 0.5 * turn_rad
        self.heading_rad = _modulo(self.heading_rad + turn_rad, TWO_PI)
        over_ground_m = self._horizontal_mps() * dt_s
        self.north_m += over_ground_m * cos(midway_rad) + self.wind_north_mps * dt_s
        self.east_m += over_ground_m * sin(midway_rad) + self.wind_east_mps * dt_s

    @c.cfunc
    @c.exceptval(check=False)
    def _accelerate(self, dt_s: c.double) -> c.void:
        """Follow the airspeed command with the power that a climb leaves, and climb."""
        offset_mps: c.double = self._airspeed_offset_mps()
        error_mps = self.airspeed_command_mps - (self.airspeed_mps - offset_mps)
        power = max(1.0 - max(self.climb_mps, 0.0) / self._climb_without_acceleration_mps, 0.0)
        gain_mps2 = error_mps / self._airspeed_lag_s
        gain_mps2 = min(max(gain_mps2, -self._acceleration_limit_mps2), power * self._acceleration_limit_mps2)
        self._climb(dt_s)
        self.airspeed_mps += self._airspeed_offset_mps() - offset_mps + gain_mps2 * dt_s

    @c.cfunc
    @c.exceptval(check=False)
    def _roll(self, dt_s: c.double) -> c.void:
        """Follow the bank command, or the bank for the course command."""
        wanted_rad = self._bank_command_rad
        if self._holds_course:
            error_rad = _wrap_pi(self._course_command_rad - atan2(self._east_mps(), self._north_mps()))
            wanted_rad = _limited(self._bank_per_course_error * error_rad, self._bank_limit_rad)
        self.bank_rad += _limited(
            (wanted_rad - self.bank_rad) / self._roll_lag_s, self._roll_rate_limit_rps
        ) * dt_s  # fmt: skip

    @c.cfunc
    @c.exceptval(check=False)
    def _airspeed_offset_mps(self) -> c.double:
        """Airspeed gained by the present climb, or lost by the present sink [m/s]."""
        per_climb = self._airspeed_gain_climbing if self.climb_mps > 0.0 else self._airspeed_loss_sinking
        return per_climb * self.climb_mps

    @c.cfunc
    @c.exceptval(check=False)
    def _climb(self, dt_s: c.double) -> c.void:
        """Follow the climb or altitude command, and move up or down with it.

        A pitch that changes the height in level flight does less in a bank: ArduPlane at 65 degrees sank at
        2.3 m/s instead of 4.8.
        """
        before_mps, wanted_mps = self.climb_mps, self._climb_command_mps
        most_mps: c.double = self._climb_limit_mps
        least_mps: c.double = -self._sink_limit_mps
        if self._holds_altitude:
            most_mps, least_mps = self._catch_up * most_mps, self._catch_up * least_mps
            wanted_mps = self._climb_to_demand_mps(dt_s, least_mps, most_mps)
        wanted_mps = min(max(wanted_mps, least_mps), most_mps) * cos(self.bank_rad)
        self.climb_mps = before_mps + _limited(
            (wanted_mps - before_mps) / self._climb_lag_s, self._climb_acceleration_limit_mps2
        ) * dt_s  # fmt: skip
        self.altitude_m += 0.5 * (before_mps + self.climb_mps) * dt_s

    @c.cfunc
    @c.exceptval(check=False)
    def _climb_to_demand_mps(self, dt_s: c.double, least_mps: c.double, most_mps: c.double) -> c.double:
        """Move the demanded altitude toward the command; the climb rate [m/s] with which it is followed.

        The demand stays so near that it is followed at the given rates at most (TECS waits as well).
        """
        up_mps = min(self._climb_limit_mps, self._altitude_rate_mps)
        down_mps = min(self._sink_limit_mps, self._altitude_rate_mps)
        before_m: c.double = self._altitude_demand_m
        rate_mps = (self._altitude_command_m - before_m) / dt_s
        demand_m = before_m + min(max(rate_mps, -down_mps), up_mps) * dt_s
        lag_s: c.double = self._altitude_lag_s
        demand_m = max(demand_m, self.altitude_m + least_mps * lag_s)
        demand_m = min(demand_m, self.altitude_m + most_mps * lag_s)
        self._altitude_demand_m = demand_m
        rate_mps = (demand_m - before_m) / dt_s
        wanted_mps = self._altitude_feed_forward * rate_mps + (demand_m - self.altitude_m) / lag_s
        if wanted_mps > 0.0:
            slow_mps = max(self.airspeed_command_mps - self.airspeed_mps, 0.0)
            wanted_mps = max(wanted_mps - self._climb_loss_slow * slow_mps, 0.0)
        return wanted_mps

    @c.cfunc
    @c.exceptval(check=False)
    def _turn_rate_rps(self) -> c.double:
        true_mps = max(self.true_per_indicated * self.airspeed_mps, 1.0)
        return self._turn_share * GRAVITY_MPS2 * tan(self.bank_rad) / true_mps

    @c.cfunc
    @c.exceptval(check=False)
    def _horizontal_mps(self) -> c.double:
        """Horizontal true airspeed [m/s]: without the part that is climb."""
        true_mps = self.true_per_indicated * self.airspeed_mps
        return sqrt(max(true_mps * true_mps - self.climb_mps * self.climb_mps, 0.0))

    @c.cfunc
    @c.exceptval(check=False)
    def _north_mps(self) -> c.double:
        return self._horizontal_mps() * cos(self.heading_rad) + self.wind_north_mps

    @c.cfunc
    @c.exceptval(check=False)
    def _east_mps(self) -> c.double:
        return self._horizontal_mps() * sin(self.heading_rad) + self.wind_east_mps


def line_bank_rad(position_m, velocity_mps, start_m, end_m):
    """Bank [rad] that joins and follows the line from start to end (L1 guidance, Park et al. 2004)."""
    return _line_bank_rad(
        position_m[0], position_m[1], velocity_mps[0], velocity_mps[1],
        start_m[0], start_m[1], end_m[0], end_m[1],
    )  # fmt: skip


@c.cfunc
@c.exceptval(check=False)
def _line_bank_rad(
    north_m: c.double, east_m: c.double, north_mps: c.double, east_mps: c.double, start_north_m: c.double,
    start_east_m: c.double, end_north_m: c.double, end_east_m: c.double,
) -> c.double:  # fmt: skip
    ground_mps = max(hypot(north_mps, east_mps), 1.0)
    l1_m, course_rad = L1_S * ground_mps, atan2(east_mps, north_mps)
    line_north, line_east = end_north_m - start_north_m, end_east_m - start_east_m
    length_m = hypot(line_north, line_east)
    if length_m < 1.0:
        aim_rad = atan2(end_east_m - east_m, end_north_m - north_m)
    else:
        along_n, along_e = line_north / length_m, line_east / length_m
        aside = ((east_m - start_east_m) * along_n - (north_m - start_north_m) * along_e) / l1_m
        aim_rad = atan2(along_e, along_n) - asin(_limited(aside, STEEPEST))
    eta_rad = _limited(_wrap_pi(aim_rad - course_rad), PI / 2.0)
    return atan(L1_GAIN * (ground_mps * ground_mps) / l1_m * sin(eta_rad) / GRAVITY_MPS2)
