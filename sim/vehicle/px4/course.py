"""GUIDED_COURSE of PX4 1.18: a course, a height and a speed, held until others are commanded.

The delays are those flown in its simulation at 15 m/s: 90 degrees begin 1.5 s after the command and take 5 s,
180 degrees 7.5 s; a climb of 40 m begins after 4 s and takes 20 s; the speed changes by 1 m/s in 8 s.
"""

import math
from collections import deque
from dataclasses import dataclass, field, replace

from sim.dynamics import Airframe, FixedWing

# With the lags of roll and climb, turns begin after 1.5 s and climbs after 4 s.
_COURSE_DELAY_S = 1.1
_HEIGHT_DELAY_S = 3.0
_CLIMB_SHARE, _SINK_SHARE = 0.8, 0.9  # of the rates by parameter
_ACCELERATION_MPS2 = 0.125
_ROLL_LAG_S, _ALTITUDE_LAG_S = 0.4, 3.0
_BANK_PER_COURSE_ERROR = math.radians(60.0)


@dataclass(slots=True)
class GuidedCourse:
    """The commands, and when the aircraft begins to fly them. Heights are above mean sea level."""

    course_rad: float
    altitude_m: float
    _due: deque[tuple[float, str, float]] = field(default_factory=deque)
    _flown: dict[str, float] = field(default_factory=dict)

    def change_course(self, course_rad: float, now_s: float) -> None:
        """Turn to a course over ground."""
        self.course_rad = course_rad
        self._due.append((now_s + _COURSE_DELAY_S, "course", course_rad))

    def change_altitude(self, altitude_m: float, now_s: float) -> None:
        """Climb or sink to a height."""
        self.altitude_m = altitude_m
        self._due.append((now_s + _HEIGHT_DELAY_S, "altitude", altitude_m))

    def change_speed(self, airspeed_mps: float) -> None:
        """Fly another airspeed, within the limits."""
        self._flown["airspeed"] = airspeed_mps

    def fly(self, aircraft: FixedWing, now_s: float) -> None:
        """Command the aircraft for the next step."""
        waiting: deque[tuple[float, str, float]] = deque()
        for due_s, what, value in self._due:
            if due_s <= now_s:
                self._flown[what] = value
            else:
                waiting.append((due_s, what, value))
        self._due = waiting
        aircraft.hold_course(self._flown.setdefault("course", self.course_rad))
        aircraft.hold_altitude(self._flown.setdefault("altitude", self.altitude_m))
        if "airspeed" in self._flown:
            aircraft.hold_airspeed(self._flown["airspeed"])


def guided_airframe(airframe: Airframe) -> Airframe:
    """The aircraft as it responds in this mode."""
    return replace(
        airframe,
        roll_lag_s=_ROLL_LAG_S,
        bank_per_course_error=_BANK_PER_COURSE_ERROR,
        climb_limit_mps=_CLIMB_SHARE * airframe.climb_limit_mps,
        sink_limit_mps=_SINK_SHARE * airframe.sink_limit_mps,
        altitude_lag_s=_ALTITUDE_LAG_S,
        acceleration_limit_mps2=_ACCELERATION_MPS2,
    )
