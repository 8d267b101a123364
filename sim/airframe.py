"""The limits and lags of an aircraft, and its crab angle in wind."""

import math
from dataclasses import dataclass

from companion.model import Vec2
from companion.units import wrap_two_pi


@dataclass(frozen=True, slots=True)
class Airframe:
    """Limits and lags of an aircraft. The defaults follow measurements of ArduPlane's simulated plane."""

    bank_limit_rad: float = math.radians(45.0)
    roll_rate_limit_rps: float = math.radians(75.0)
    roll_lag_s: float = 0.5
    # Bank angle per course error. With 41 degrees per radian and a bank limit of atan(5 / g), the turn from
    # 91 to 14 degrees on the way to 10 takes 9.5 s, as measured.
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


def heading_for_course_rad(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> float:
    """The heading [rad] that makes a course good in the wind, crab angle at most 90 degrees."""
    across_mps = wind_mps[1] * math.cos(course_rad) - wind_mps[0] * math.sin(course_rad)
    if airspeed_mps <= 0.0:
        return wrap_two_pi(course_rad)
    crab = min(max(across_mps / airspeed_mps, -1.0), 1.0)
    return wrap_two_pi(course_rad - math.asin(crab))
