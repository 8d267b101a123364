"""Constants and conversions between the units of wires and files and those of the house (SI, radians)."""

import math

STANDARD_GRAVITY_MPS2 = 9.80665
FOOT_M = 0.3048
KNOT_MPS = 1852.0 / 3600.0


def wrap_pi(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def wrap_two_pi(angle_rad: float) -> float:
    """The same angle in [0, 2 pi)."""
    wrapped = angle_rad % (2.0 * math.pi)
    return 0.0 if wrapped >= 2.0 * math.pi else wrapped  # a tiny negative angle rounds up to 2 pi itself


def course_deg(angle_rad: float) -> float:
    """A course for people and wires: degrees clockwise from true north in [0, 360)."""
    degrees = math.degrees(wrap_two_pi(angle_rad))
    return 0.0 if degrees >= 360.0 else degrees
