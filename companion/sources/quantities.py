"""Quantities as receivers of aviation send them, in feet and knots: plausible ranges, and SI units."""

import math
from typing import Final, NamedTuple

from companion.units import FOOT_M, KNOT_MPS

FEET_PER_MINUTE_MPS: Final = FOOT_M / 60.0


class Range(NamedTuple):
    """The values that a quantity can have, both ends included."""

    low: float
    high: float

    def has(self, value: float) -> bool:
        """Whether a value is in the range; false for NaN."""
        return self.low <= value <= self.high


LATITUDE_DEG: Final = Range(-90.0, 90.0)
LONGITUDE_DEG: Final = Range(-180.0, 180.0)
# Transponders encode -1,000 to 126,700 ft.
ALTITUDE_FT: Final = Range(-3_000.0, 130_000.0)
# The fastest velocity that ADS-B encodes is 4,086 kt in each axis, the fastest climb 32,640 ft/min.
SPEED_KT: Final = Range(0.0, 5_800.0)
CLIMB_FPM: Final = Range(-33_000.0, 33_000.0)
COURSE_DEG: Final = Range(0.0, 360.0)


def metres(altitude_ft: float | None) -> float | None:
    """Feet in metres."""
    return None if altitude_ft is None else altitude_ft * FOOT_M


def speed_mps(speed_kt: float | None) -> float | None:
    """Knots in m/s."""
    return None if speed_kt is None else speed_kt * KNOT_MPS


def climb_mps(climb_fpm: float | None) -> float | None:
    """Feet per minute in m/s."""
    return None if climb_fpm is None else climb_fpm * FEET_PER_MINUTE_MPS


def course_rad(course_deg: float | None) -> float | None:
    """Degrees in radians, in [0, 2 pi)."""
    return None if course_deg is None else math.radians(course_deg % 360.0)
