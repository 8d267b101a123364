"""A place beside a leg of a mission: how far off, how the leg is joined, and its height there."""

import math
from typing import NamedTuple

from companion.model import Vec3

# The largest angle at which a leg is joined, and how far ahead of us, in time, the way back meets it.
STEEPEST_RAD = math.radians(40.0)
_JOINS_AHEAD_S = 6.0
# Nearer than this we count as on the leg: no autopilot tracks its line better in gusts and after turns.
ON_LINE_M = 30.0
# To turn onto a course and off it again, at the usual speeds and bank angles.
_TURNS_S = 8.0
# A slope is flown with a lag; its height is commanded this far ahead.
_SLOPE_AHEAD_S = 4.0


class BesideLeg(NamedTuple):
    """A place beside a leg; `aside_m` is positive to its right, `to_go_m` negative beyond its end."""

    aside_m: float
    to_go_m: float
    length_m: float
    course_rad: float
    altitude_m: float  # of the leg here: linear between its ends

    def altitude_ahead_m(self, speed_mps: float, start_m: Vec3, end_m: Vec3) -> float:
        """Height to command at this place, so that the slope is flown in spite of the lag."""
        return leg_altitude_m(start_m, end_m, self.to_go_m - _SLOPE_AHEAD_S * speed_mps, self.length_m)

    def join_rad(self, speed_mps: float) -> float:
        """Course that leads onto the leg: the nearer, the more along it."""
        ahead_m = max(_JOINS_AHEAD_S * speed_mps, 1.0)
        steep = math.sin(STEEPEST_RAD)
        return self.course_rad - math.asin(min(max(self.aside_m / ahead_m, -steep), steep))

    def is_too_short(self, speed_mps: float) -> bool:
        """Whether the rest of the leg is too short to join it: then its end is flown to directly."""
        if self.to_go_m <= 0.0:
            return True
        if abs(self.aside_m) <= ON_LINE_M:
            return False
        return self.to_go_m < abs(self.aside_m) / math.tan(STEEPEST_RAD) + _TURNS_S * speed_mps


def beside_leg(start_m: Vec3, end_m: Vec3, position_m: Vec3) -> BesideLeg | None:
    """A north-east-down position relative to a leg; `None` if start and end are the same place."""
    leg_n, leg_e = end_m[0] - start_m[0], end_m[1] - start_m[1]
    length_m = math.hypot(leg_n, leg_e)
    if length_m < 1.0:
        return None
    leg_n, leg_e = leg_n / length_m, leg_e / length_m
    north_m, east_m = end_m[0] - position_m[0], end_m[1] - position_m[1]
    to_go_m = north_m * leg_n + east_m * leg_e
    return BesideLeg(
        aside_m=north_m * leg_e - east_m * leg_n,
        to_go_m=to_go_m,
        length_m=length_m,
        course_rad=math.atan2(leg_e, leg_n),
        altitude_m=leg_altitude_m(start_m, end_m, to_go_m, length_m),
    )


def leg_altitude_m(start_m: Vec3, end_m: Vec3, to_go_m: float, length_m: float) -> float:
    """Height of a leg at a distance from its end; before its start that of the start."""
    share = min(max(to_go_m / length_m, 0.0), 1.0)
    return -end_m[2] + share * (end_m[2] - start_m[2])
