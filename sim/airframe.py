"""The limits and lags of an aircraft, those of the recorded autopilots, and the crab angle in wind."""

import math
from dataclasses import dataclass

from companion.geodesy import wrap_two_pi
from companion.model import Vec2


@dataclass(frozen=True, slots=True)
class Airframe:
    """Limits and lags of an aircraft under its autopilot.

    The defaults are ArduPlane's simulated plane. Where no other source is named, they were fitted to the
    odd engagements of the recorded flights of ArduPlane 4.8-dev; `tests/closed_loop/test_fit_recordings.py`
    compares the even ones.
    """

    bank_limit_rad: float = math.radians(45.0)
    roll_rate_limit_rps: float = math.radians(150.0)
    roll_lag_s: float = 0.2
    # Turn rate as a share of a coordinated turn's: the simulated plane slips.
    turn_share: float = 0.72
    # Bank angle per course error: the P gain of ArduPlane's guided heading, 5000 centidegrees per radian.
    bank_per_course_error: float = math.radians(50.0)
    airspeed_min_mps: float = 10.0
    airspeed_max_mps: float = 30.0
    acceleration_limit_mps2: float = 0.8
    airspeed_lag_s: float = 3.0
    # A climb rate at which no power is left for acceleration.
    climb_without_acceleration_mps: float = math.inf
    # Airspeed gained per climb rate, and lost per sink rate [m/s per m/s].
    airspeed_gain_climbing: float = 0.0
    airspeed_loss_sinking: float = 0.0
    climb_limit_mps: float = 4.8
    sink_limit_mps: float = 4.8
    climb_acceleration_limit_mps2: float = 3.0
    climb_lag_s: float = 0.75
    # The height demanded moves at the climb limit. The climb rate is its rate times the feed-forward, plus
    # the difference of height over the lag (TECS).
    altitude_lag_s: float = 2.6
    altitude_feed_forward: float = 0.0
    # How much faster than the limits it climbs or sinks to catch up; a demand further away waits.
    catch_up: float = 1.0
    # Climb rate given up per airspeed that is missing while climbing [m/s per m/s].
    climb_loss_slow: float = 0.0


ARDUPLANE = Airframe()
# Fitted to the odd engagements of the recorded flight of PX4 1.18-alpha. With the fake's dead time in
# OFFBOARD, turns of 30, 90 and 180 degrees at 14 m/s come within 5 degrees as measured on 1.16: in 1.9, 3.4
# and 4.7 s.
PX4 = Airframe(
    bank_limit_rad=math.radians(50.0),
    roll_rate_limit_rps=math.radians(75.0),
    roll_lag_s=0.25,
    turn_share=1.0,
    bank_per_course_error=math.radians(75.0),
    airspeed_max_mps=20.0,
    acceleration_limit_mps2=0.12,
    airspeed_lag_s=20.0,
    climb_without_acceleration_mps=2.0,
    airspeed_gain_climbing=0.17,
    airspeed_loss_sinking=0.9,
    climb_limit_mps=3.0,
    sink_limit_mps=2.0,
    climb_lag_s=0.3,
    altitude_lag_s=6.0,
    altitude_feed_forward=0.8,
    catch_up=1.4,
    climb_loss_slow=0.3,
)
AIRFRAMES = {"ardupilot": ARDUPLANE, "px4": PX4}


def heading_for_course_rad(course_rad: float, airspeed_mps: float, wind_mps: Vec2) -> float:
    """The heading [rad] that makes a course good in the wind, crab angle at most 90 degrees."""
    across_mps = wind_mps[1] * math.cos(course_rad) - wind_mps[0] * math.sin(course_rad)
    if airspeed_mps <= 0.0:
        return wrap_two_pi(course_rad)
    crab = min(max(across_mps / airspeed_mps, -1.0), 1.0)
    return wrap_two_pi(course_rad - math.asin(crab))
