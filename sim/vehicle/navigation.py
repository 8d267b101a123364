"""Lateral guidance of the fake autopilots: bank angles for circles and legs. Local north-east frame, SI."""

import math
from dataclasses import dataclass

from companion.geodesy import wrap_pi
from companion.model import Vec2
from companion.units import STANDARD_GRAVITY_MPS2
from sim.compiled.airframe_step import L1_TIME_S, line_bank_rad
from sim.dynamics import FixedWing

_LOITER_APPROACH = 2.0  # gain with which a loiter closes on its circle
_BANK_PER_COURSE_ERROR = 0.8


def loiter_bank_rad(
    position_m: Vec2,
    velocity_mps: Vec2,
    centre_m: Vec2,
    radius_m: float,
    *,
    clockwise: bool = True,
    turn_share: float = 1.0,
) -> float:
    """Bank angle [rad] that joins a circle from any position and then follows it.

    `turn_share` is the airframe's: one that slips banks more on the same circle.
    """
    side = 1.0 if clockwise else -1.0
    north_m, east_m = position_m[0] - centre_m[0], position_m[1] - centre_m[1]
    off_m = math.hypot(north_m, east_m) - radius_m
    closing_rad = math.atan(_LOITER_APPROACH * off_m / radius_m)
    course_rad = math.atan2(east_m, north_m) + side * (math.pi / 2.0 + closing_rad)
    error_rad = wrap_pi(course_rad - math.atan2(velocity_mps[1], velocity_mps[0]))
    ground_mps2 = velocity_mps[0] ** 2 + velocity_mps[1] ** 2
    on_circle = max(1.0 - abs(off_m) / radius_m, 0.0)
    steady_rad = math.atan(ground_mps2 / (STANDARD_GRAVITY_MPS2 * turn_share * radius_m)) * on_circle
    return side * steady_rad + _BANK_PER_COURSE_ERROR * error_rad


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight leg of a mission, and the end of the next leg.

    Heights are above mean sea level; without a `start_altitude_m` the leg has no slope, and its end's height
    is flown at once.
    """

    start_m: Vec2
    end_m: Vec2
    next_m: Vec2
    end_altitude_m: float
    start_altitude_m: float | None = None

    def altitude_m(self, position_m: Vec2, reached_before_m: float = 0.0) -> float:
        """Height of the leg beside a place, linear along it; that of the end from `reached_before_m` on."""
        length_m = math.dist(self.start_m, self.end_m) - reached_before_m
        if self.start_altitude_m is None or length_m <= 0.0:
            return self.end_altitude_m
        share = (self._to_go_m(position_m) - reached_before_m) / length_m
        return self.end_altitude_m + min(max(share, 0.0), 1.0) * (self.start_altitude_m - self.end_altitude_m)

    def _to_go_m(self, position_m: Vec2) -> float:
        """Distance to the end along the leg, negative beyond it."""
        leg_n, leg_e = self.end_m[0] - self.start_m[0], self.end_m[1] - self.start_m[1]
        north_m, east_m = self.end_m[0] - position_m[0], self.end_m[1] - position_m[1]
        return (north_m * leg_n + east_m * leg_e) / max(math.hypot(leg_n, leg_e), 1e-6)

    def bank_rad(self, position_m: Vec2, velocity_mps: Vec2) -> float:
        """Bank angle [rad] that joins and follows the leg."""
        return line_bank_rad(position_m, velocity_mps, self.start_m, self.end_m)

    @property
    def course_rad(self) -> float:
        """The course along the leg [rad]."""
        return _bearing_rad(self.start_m, self.end_m)

    def is_passed(self, position_m: Vec2) -> bool:
        """True beyond the finish line: the perpendicular to the leg through its end."""
        return self._to_go_m(position_m) <= 0.0

    def turn_distance_m(self, ground_speed_mps: float, radius_m: float) -> float:
        """Distance before the end at which to turn to the next leg [m], as in ArduPlane; 0 without a turn."""
        if self.next_m == self.end_m:
            return 0.0
        turn_rad = abs(wrap_pi(_bearing_rad(self.end_m, self.next_m) - self.course_rad))
        return min(radius_m, L1_TIME_S * ground_speed_mps) * min(turn_rad / (math.pi / 2.0), 1.0)


def circle(aircraft: FixedWing, centre_m: Vec2, radius_m: float) -> None:
    """Command the bank that circles a place; a negative radius turns left."""
    position_m = (aircraft.north_m, aircraft.east_m)
    bank_rad = loiter_bank_rad(
        position_m,
        aircraft.velocity_mps[:2],
        centre_m,
        max(abs(radius_m), 1.0),
        clockwise=radius_m > 0.0,
        turn_share=aircraft.airframe.turn_share,
    )
    aircraft.hold_bank(bank_rad)


def _bearing_rad(start_m: Vec2, end_m: Vec2) -> float:
    return math.atan2(end_m[1] - start_m[1], end_m[0] - start_m[0])
