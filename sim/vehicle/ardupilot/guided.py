"""ArduPlane's targets in GUIDED: which commands it accepts, refuses or silently ignores."""

import math
from dataclasses import dataclass

from companion.geodesy import GeoPoint, LocalFrame, wrap_pi
from companion.units import STANDARD_GRAVITY_MPS2
from sim.dynamics import FixedWing
from sim.vehicle.commands import Result
from sim.vehicle.mission import ABSOLUTE_FRAMES, GLOBAL_FRAMES
from sim.vehicle.navigation import circle

_COURSE_OVER_GROUND, _HEADING, _HEADING_DEFAULT = 0.0, 1.0, 2.0
_AIRSPEED = 0.0
_SMALLEST_ACCELERATION_MPS2 = 0.05


@dataclass(slots=True)
class GuidedTargets:
    """The present targets: a circle until a course is commanded. Heights are above mean sea level."""

    centre: GeoPoint
    radius_m: float  # negative turns left
    course_rad: float | None = None
    by_heading: bool = False
    bank_limit_rad: float = 0.0
    airspeed_mps: float | None = None
    altitude_m: float = 0.0
    altitude_rate_mps: float = math.inf

    def change_heading(self, kind: float, degrees: float, acceleration_mps2: float) -> Result:
        """MAV_CMD_GUIDED_CHANGE_HEADING (43002)."""
        if kind == _HEADING_DEFAULT:
            self.course_rad = None
            return Result.ACCEPTED
        if kind not in (_COURSE_OVER_GROUND, _HEADING):
            return Result.DENIED
        if not 0.0 <= degrees < 360.0 or not math.isfinite(acceleration_mps2):
            return Result.DENIED
        self.course_rad = math.radians(degrees)
        self.by_heading = kind == _HEADING
        acceleration_mps2 = max(acceleration_mps2, _SMALLEST_ACCELERATION_MPS2)
        self.bank_limit_rad = math.atan(acceleration_mps2 / STANDARD_GRAVITY_MPS2)
        return Result.ACCEPTED

    def change_speed(self, kind: float, speed_mps: float, lowest_mps: float, highest_mps: float) -> Result:
        """MAV_CMD_GUIDED_CHANGE_SPEED (43000): only airspeeds within the parameters' limits."""
        if kind != _AIRSPEED:
            return Result.DENIED
        if not lowest_mps <= speed_mps <= highest_mps:
            return Result.FAILED
        self.airspeed_mps = speed_mps
        return Result.ACCEPTED

    def change_altitude(self, frame: int, z_m: float, rate_mps: float, home_altitude_m: float) -> Result:
        """MAV_CMD_GUIDED_CHANGE_ALTITUDE (43001); a rate of 0 means the maximum."""
        if not math.isfinite(z_m) or z_m in (0.0, -1.0) or frame not in GLOBAL_FRAMES:
            return Result.DENIED
        self.altitude_m = z_m + (0.0 if frame in ABSOLUTE_FRAMES else home_altitude_m)
        self.altitude_rate_mps = rate_mps if math.isfinite(rate_mps) and rate_mps > 0.0 else math.inf
        return Result.ACCEPTED

    def go_to(self, centre: GeoPoint, radius_m: float) -> None:
        """MAV_CMD_DO_REPOSITION (192): circle there; ends a commanded course."""
        self.centre = centre
        self.radius_m = radius_m
        self.course_rad = None
        self.set_altitude(centre.altitude_m)

    def set_altitude(self, altitude_m: float) -> None:
        """Set a height without a rate, as position targets do."""
        self.altitude_m = altitude_m
        self.altitude_rate_mps = math.inf

    def fly(self, aircraft: FixedWing, frame: LocalFrame) -> None:
        """Command the aircraft for the next step."""
        if self.airspeed_mps is not None:
            aircraft.hold_airspeed(self.airspeed_mps)
        aircraft.hold_altitude(self.altitude_m, self.altitude_rate_mps)
        if self.course_rad is None:
            circle(aircraft, frame.to_ned_m(self.centre)[:2], self.radius_m)
            return
        crab_rad = wrap_pi(aircraft.course_rad - aircraft.heading_rad) if self.by_heading else 0.0
        aircraft.hold_course(self.course_rad + crab_rad, self.bank_limit_rad)
