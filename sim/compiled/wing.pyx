# cython: language_level=3, cdivision=True
"""A fixed wing as a point mass, and the bank that follows a line.

All is in double precision, without reordering or fusing of operations: the same steps give the same bits.
"""

from libc.math cimport asin, atan, atan2, cos, fmod, hypot, sin, sqrt, tan

import numpy as np

from companion.units import STANDARD_GRAVITY_MPS2
from sim.airframe import Airframe, heading_for_course_rad

cdef double GRAVITY_MPS2 = STANDARD_GRAVITY_MPS2
cdef double PI = 3.141592653589793
cdef double TWO_PI = 2.0 * PI
# ArduPlane's L1 controller with its defaults: NAVL1_PERIOD 17 s and NAVL1_DAMPING 0.75.
L1_TIME_S = 0.75 * 17.0 / PI
cdef double L1_S = L1_TIME_S
cdef double L1_GAIN = 4.0 * 0.75 * 0.75
cdef double STEEPEST = 0.7071  # the sine of the angle at which a line is met, at most


cdef class FixedWing:
    """Position (north, east, down) and motion of one aircraft, and the commands that it follows.

    Commands stay until replaced: a bank or a course over ground; a climb rate or an altitude; an airspeed.
    `altitude_m` is height above the zero of the frame, so down is its negative. Limits are clamped, never
    refused. There is no clock: `step(dt_s)` is all that moves time, and the same steps give the same bits.
    """

    cdef public double north_m, east_m, altitude_m, wind_north_mps, wind_east_mps
    cdef public double airspeed_mps, heading_rad, bank_rad, climb_mps, airspeed_command_mps
    cdef object _airframe
    cdef double _bank_limit_rad, _bank_command_rad, _course_command_rad
    cdef double _climb_command_mps, _altitude_command_m
    cdef bint _holds_course, _holds_altitude
    # The airframe's, where a step needs them.
    cdef double _most_bank_rad, _roll_rate_limit_rps, _roll_lag_s, _bank_per_course_error
    cdef double _acceleration_limit_mps2, _airspeed_lag_s
    cdef double _climb_limit_mps, _sink_limit_mps, _climb_acceleration_limit_mps2
    cdef double _climb_lag_s, _altitude_lag_s

    def __init__(
        self, position_m=(0.0, 0.0, 0.0), double course_rad=0.0, double airspeed_mps=22.0,
        *, wind_mps=(0.0, 0.0), airframe=None,
    ):
        """Start level and steady on a course over ground; `wind_mps` is the air's velocity (north, east)."""
        self.airframe = Airframe() if airframe is None else airframe
        self.north_m, self.east_m, self.altitude_m = position_m[0], position_m[1], -position_m[2]
        self.wind_north_mps, self.wind_east_mps = wind_mps
        self.airspeed_mps = self.airspeed_command_mps = airspeed_mps
        self.heading_rad = heading_for_course_rad(course_rad, airspeed_mps, wind_mps)
        self.bank_rad = self.climb_mps = 0.0
        self._bank_limit_rad = self._airframe.bank_limit_rad
        self._bank_command_rad = self._climb_command_mps = 0.0
        self._holds_course, self._course_command_rad = True, course_rad
        self._holds_altitude, self._altitude_command_m = True, self.altitude_m

    @property
    def airframe(self):
        """What it can do; may be replaced at any time."""
        return self._airframe

    @airframe.setter
    def airframe(self, airframe):
        self._airframe, self._most_bank_rad = airframe, airframe.bank_limit_rad
        self._roll_rate_limit_rps, self._roll_lag_s = airframe.roll_rate_limit_rps, airframe.roll_lag_s
        self._bank_per_course_error = airframe.bank_per_course_error
        self._acceleration_limit_mps2 = airframe.acceleration_limit_mps2
        self._airspeed_lag_s = airframe.airspeed_lag_s
        self._climb_limit_mps, self._sink_limit_mps = airframe.climb_limit_mps, airframe.sink_limit_mps
        self._climb_acceleration_limit_mps2 = airframe.climb_acceleration_limit_mps2
        self._climb_lag_s, self._altitude_lag_s = airframe.climb_lag_s, airframe.altitude_lag_s

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
        cdef double north_mps = self._north_mps(), east_mps = self._east_mps()
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
        """Rate of change of heading in the coordinated turn, g tan(bank) / V [rad/s]."""
        return self._turn_rate_rps()

    def hold_bank(self, double bank_rad):
        """Roll to a bank angle, positive to the right."""
        self._hold_bank(bank_rad)

    def hold_course(self, double course_rad, bank_limit_rad=None):
        """Turn to a course over ground and keep it, crabbing into the wind."""
        cdef double limit_rad = self._most_bank_rad
        self._bank_limit_rad = limit_rad if bank_limit_rad is None else min(abs(bank_limit_rad), limit_rad)
        self._holds_course, self._course_command_rad = True, course_rad

    def hold_altitude(self, double altitude_m):
        """Climb or sink to an altitude and keep it."""
        self._holds_altitude, self._altitude_command_m = True, altitude_m

    def hold_climb(self, double climb_mps):
        """Keep a climb rate, positive up."""
        self._holds_altitude, self._climb_command_mps = False, climb_mps

    def hold_airspeed(self, double airspeed_mps):
        """Accelerate or slow down to an airspeed and keep it."""
        cdef double low_mps = self._airframe.airspeed_min_mps, high_mps = self._airframe.airspeed_max_mps
        self.airspeed_command_mps = min(max(airspeed_mps, low_mps), high_mps)

    def step(self, double dt_s):
        """Fly on for a short time (0.1 s at most for the lags to be smooth)."""
        self._step(dt_s)

    def fly(self, Py_ssize_t steps, double dt_s, line=None):
        """Fly on for so many steps; where it is after each of them, north-east-down [m], (steps, 3).

        That follows the commands, or the bank that `line`, from one place (north, east) to another, takes.
        """
        cdef Py_ssize_t i
        cdef double start_north_m = 0.0, start_east_m = 0.0, end_north_m = 0.0, end_east_m = 0.0
        cdef bint follows = line is not None
        if follows:
            (start_north_m, start_east_m), (end_north_m, end_east_m) = line
        positions_m = np.empty((steps, 3))
        cdef double[:, ::1] position_m = positions_m
        for i in range(steps):
            if follows:
                self._hold_bank(_line_bank_rad(
                    self.north_m, self.east_m, self._north_mps(), self._east_mps(),
                    start_north_m, start_east_m, end_north_m, end_east_m,
                ))
            self._step(dt_s)
            position_m[i, 0], position_m[i, 1], position_m[i, 2] = self.north_m, self.east_m, -self.altitude_m
        return positions_m

    cdef void _hold_bank(self, double bank_rad) noexcept:
        self._bank_command_rad = _limited(bank_rad, self._most_bank_rad)
        self._holds_course = False

    cdef void _step(self, double dt_s) noexcept:
        cdef double error_mps, turn_rad, midway_rad, over_ground_m
        self._roll(dt_s)
        error_mps = self.airspeed_command_mps - self.airspeed_mps
        self.airspeed_mps += _limited(error_mps / self._airspeed_lag_s, self._acceleration_limit_mps2) * dt_s
        self._climb(dt_s)
        # The heading halfway through the step carries the position.
        turn_rad = self._turn_rate_rps() * dt_s
        midway_rad = self.heading_rad + 0.5 * turn_rad
        self.heading_rad = _modulo(self.heading_rad + turn_rad, TWO_PI)
        over_ground_m = self._horizontal_mps() * dt_s
        self.north_m += over_ground_m * cos(midway_rad) + self.wind_north_mps * dt_s
        self.east_m += over_ground_m * sin(midway_rad) + self.wind_east_mps * dt_s

    cdef void _roll(self, double dt_s) noexcept:
        """Follow the bank command, or the bank that the course command asks for."""
        cdef double error_rad, wanted_rad = self._bank_command_rad
        if self._holds_course:
            error_rad = _wrap_pi(self._course_command_rad - atan2(self._east_mps(), self._north_mps()))
            wanted_rad = _limited(self._bank_per_course_error * error_rad, self._bank_limit_rad)
        self.bank_rad += _limited(
            (wanted_rad - self.bank_rad) / self._roll_lag_s, self._roll_rate_limit_rps
        ) * dt_s

    cdef void _climb(self, double dt_s) noexcept:
        """Follow the climb or altitude command, and move up or down with it."""
        cdef double before_mps = self.climb_mps, wanted_mps = self._climb_command_mps
        if self._holds_altitude:
            wanted_mps = (self._altitude_command_m - self.altitude_m) / self._altitude_lag_s
        if wanted_mps > self._climb_limit_mps:
            wanted_mps = self._climb_limit_mps
        elif wanted_mps < -self._sink_limit_mps:
            wanted_mps = -self._sink_limit_mps
        self.climb_mps = before_mps + _limited(
            (wanted_mps - before_mps) / self._climb_lag_s, self._climb_acceleration_limit_mps2
        ) * dt_s
        self.altitude_m += 0.5 * (before_mps + self.climb_mps) * dt_s

    cdef double _turn_rate_rps(self) noexcept:
        return GRAVITY_MPS2 * tan(self.bank_rad) / max(self.airspeed_mps, 1.0)

    cdef double _horizontal_mps(self) noexcept:
        """What of the airspeed is not climb."""
        return sqrt(max(self.airspeed_mps * self.airspeed_mps - self.climb_mps * self.climb_mps, 0.0))

    cdef double _north_mps(self) noexcept:
        return self._horizontal_mps() * cos(self.heading_rad) + self.wind_north_mps

    cdef double _east_mps(self) noexcept:
        return self._horizontal_mps() * sin(self.heading_rad) + self.wind_east_mps


def line_bank_rad(position_m, velocity_mps, start_m, end_m):
    """Bank that joins and follows the line from start to end (L1 guidance, Park et al. 2004)."""
    return _line_bank_rad(
        position_m[0], position_m[1], velocity_mps[0], velocity_mps[1],
        start_m[0], start_m[1], end_m[0], end_m[1],
    )


cdef double _line_bank_rad(
    double north_m, double east_m, double north_mps, double east_mps,
    double start_north_m, double start_east_m, double end_north_m, double end_east_m,
) noexcept:
    cdef double ground_mps = max(hypot(north_mps, east_mps), 1.0)
    cdef double l1_m = L1_S * ground_mps, course_rad = atan2(east_mps, north_mps)
    cdef double line_north = end_north_m - start_north_m, line_east = end_east_m - start_east_m
    cdef double length_m = hypot(line_north, line_east), aim_rad, eta_rad, along_n, along_e, aside
    if length_m < 1.0:
        aim_rad = atan2(end_east_m - east_m, end_north_m - north_m)
    else:
        along_n, along_e = line_north / length_m, line_east / length_m
        aside = ((east_m - start_east_m) * along_n - (north_m - start_north_m) * along_e) / l1_m
        aim_rad = atan2(along_e, along_n) - asin(_limited(aside, STEEPEST))
    eta_rad = _limited(_wrap_pi(aim_rad - course_rad), PI / 2.0)
    return atan(L1_GAIN * (ground_mps * ground_mps) / l1_m * sin(eta_rad) / GRAVITY_MPS2)


cdef inline double _limited(double value, double limit) noexcept:
    return limit if value > limit else -limit if value < -limit else value


cdef inline double _modulo(double value, double of) noexcept:
    """What is left of a value, in [0, of), as Python has it."""
    cdef double left = fmod(value, of)
    return left + of if left < 0.0 else left


cdef inline double _wrap_two_pi(double angle_rad) noexcept:
    """The same angle in [0, 2 pi)."""
    cdef double wrapped = _modulo(angle_rad, TWO_PI)
    return 0.0 if wrapped >= TWO_PI else wrapped  # a tiny negative angle rounds up to 2 pi itself


cdef inline double _wrap_pi(double angle_rad) noexcept:
    """The same angle in [-pi, pi)."""
    return _modulo(angle_rad + PI, TWO_PI) - PI
