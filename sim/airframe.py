"""What an aircraft can do, and how it points into the wind."""

import math
from dataclasses import dataclass

from companion.model import Vec2
from companion.units import wrap_two_pi


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


def heading_for_course_rad(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> float:
    """The heading that makes a course good in a wind; straight upwind of it where the wind is too strong."""
    across_mps = wind_mps[1] * math.cos(course_rad) - wind_mps[0] * math.sin(course_rad)
    if airspeed_mps <= 0.0:
        return wrap_two_pi(course_rad)
    crab = min(max(across_mps / airspeed_mps, -1.0), 1.0)
    return wrap_two_pi(course_rad - math.asin(crab))
