"""PX4's path follower: the course that joins a line."""

import math

from companion.model import Vec2
from sim.dynamics import FixedWing

# In MISSION, as recorded from 1.18: 34, 21, 11 and 5 m beside its line, its course was 55, 46, 32 and 18
# degrees from it.
MISSION_TIME_S = 1.3
# In OFFBOARD the positions are those of some tenths of a second ago: turns measured on 1.16 do not overshoot.
OFFBOARD_TIME_S = 3.0
_STEEPEST_CUT_RAD = math.radians(70.0)


def course_to_line_rad(aircraft: FixedWing, place_m: Vec2, along_rad: float, time_s: float) -> float:
    """The course [rad] that joins the line through a place (north, east) along a course, in about a time."""
    along_n, along_e = math.cos(along_rad), math.sin(along_rad)
    off_n, off_e = aircraft.north_m - place_m[0], aircraft.east_m - place_m[1]
    across_m = off_e * along_n - off_n * along_e
    cut_rad = math.atan(across_m / max(time_s * aircraft.ground_speed_mps, 1.0))
    return along_rad - min(max(cut_rad, -_STEEPEST_CUT_RAD), _STEEPEST_CUT_RAD)
