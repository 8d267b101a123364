"""What wheels do: rolling for take-off and after landing. As recorded from ArduPlane's simulated plane."""

import math

from sim.dynamics import FixedWing

ROLL_ACCELERATION_MPS2 = 6.5
LIFT_OFF_MPS = 18.0
_BRAKING_MPS2 = 3.0


def roll(aircraft: FixedWing, ground_speed_mps: float, *, accelerate: bool, dt_s: float) -> float:
    """Roll straight on for a moment, faster or braking; the new ground speed."""
    rate_mps2 = ROLL_ACCELERATION_MPS2 if accelerate else -_BRAKING_MPS2
    speed_mps = max(ground_speed_mps + rate_mps2 * dt_s, 0.0)
    ahead_n, ahead_e = math.cos(aircraft.heading_rad), math.sin(aircraft.heading_rad)
    way_m = 0.5 * (ground_speed_mps + speed_mps) * dt_s
    aircraft.north_m += way_m * ahead_n
    aircraft.east_m += way_m * ahead_e
    tailwind_mps = aircraft.wind_north_mps * ahead_n + aircraft.wind_east_mps * ahead_e
    aircraft.airspeed_mps = max(speed_mps - tailwind_mps, 0.0)
    return speed_mps


def touch_down(aircraft: FixedWing, altitude_m: float) -> None:
    """Put the aircraft level on the ground, pointing where it goes."""
    aircraft.heading_rad = aircraft.course_rad
    aircraft.altitude_m = altitude_m
    aircraft.climb_mps = 0.0
    aircraft.bank_rad = 0.0
