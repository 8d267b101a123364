"""Constants of physics and of the separation standards, unit conversions, and angles."""

import math

STANDARD_GRAVITY_MPS2 = 9.80665
FOOT_M = 0.3048
KNOT_MPS = 1852.0 / 3600.0
# Near mid-air collision: 500 ft and 100 ft.
NMAC_HORIZONTAL_M, NMAC_VERTICAL_M = 152.4, 30.48
# Well clear for small UAS (ASTM F3442): 2000 ft and 250 ft.
WELL_CLEAR_HORIZONTAL_M, WELL_CLEAR_VERTICAL_M = 609.6, 76.2


def wrap_pi(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def wrap_two_pi(angle_rad: float) -> float:
    """The same angle in [0, 2 pi)."""
    wrapped = angle_rad % (2.0 * math.pi)
    return 0.0 if wrapped >= 2.0 * math.pi else wrapped  # a tiny negative angle rounds up to 2 pi itself


def course_deg(angle_rad: float) -> float:
    """A course in degrees clockwise from true north, in [0, 360), for people and messages."""
    degrees = math.degrees(wrap_two_pi(angle_rad))
    return 0.0 if degrees >= 360.0 else degrees
