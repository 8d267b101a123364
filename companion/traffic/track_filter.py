"""Constant-velocity Kalman filters: where one aircraft is and how it moves, from noisy reports.

Two filters, horizontal (north and east share one covariance, their noise being the same) and vertical, kept
apart because heights come and go independently of positions. Both are geodetic: a state is a latitude, a
longitude and an altitude with a velocity, so it does not depend on where the local frame lies.

    x = (position, velocity)    x' = F(dt) x + w,    F = [1 dt; 0 1]
    Q = q [dt^3/3 dt^2/2; dt^2/2 dt]                  (continuous white-noise acceleration)

Bar-Shalom, Li, Kirubarajan, "Estimation with Applications to Tracking and Navigation", §6.2.2.
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple, Self

from annotated_types import Ge, Gt

from companion.geodesy import LocalFrame
from companion.model import Vec2

# What no report of an honest sender differs by, in standard deviations of the report or of the estimate.
_REPORT_SIGMAS = 6.0
_ESTIMATE_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class EstimateParams:
    """How noisy reports are, how aircraft move, and what is not believed at once."""

    # Standard deviations of a report, each axis.
    position_sigma_m: Annotated[float, Gt(0)] = 15.0
    velocity_sigma_mps: Annotated[float, Gt(0)] = 1.5
    altitude_sigma_m: Annotated[float, Gt(0)] = 8.0
    climb_sigma_mps: Annotated[float, Gt(0)] = 0.8
    # By how much a velocity wanders in one second (root of q). More follows turns faster, less smooths more.
    manoeuvre_mps: Annotated[float, Gt(0)] = 2.0
    climb_manoeuvre_mps: Annotated[float, Gt(0)] = 0.5
    # Turns: what a first course leaves open, and by how much the rate wanders in one second. Standard rate
    # turns of 3 degrees a second begin and end at once, so a second must be able to change much of that.
    turn_sigma_radps: Annotated[float, Gt(0)] = math.radians(3.0)
    turn_manoeuvre_radps: Annotated[float, Gt(0)] = math.radians(1.0)
    # Fastest traffic: what a first position without velocity leaves open, and what a report may claim.
    max_speed_mps: Annotated[float, Gt(0)] = 400.0
    max_climb_mps: Annotated[float, Gt(0)] = 60.0
    # Hardest manoeuvre: 3 g covers aerobatics, 1 g any change of climb.
    max_acceleration_mps2: Annotated[float, Gt(0)] = 30.0
    max_vertical_acceleration_mps2: Annotated[float, Gt(0)] = 10.0
    # ADSB_VEHICLE.tslc counts whole seconds, so a report may be displaced along its path by one second.
    timestamp_error_s: Annotated[float, Ge(0)] = 1.0


class HorizontalFix(NamedTuple):
    """A reported place at `time_s`, with its velocity over ground (north, east) where the sender knew it."""

    time_s: float
    lat_deg: float
    lon_deg: float
    velocity_mps: Vec2 | None


class VerticalFix(NamedTuple):
    """A reported height at `time_s`, with its climb (positive up) where the sender knew it."""

    time_s: float
    altitude_m: float
    climb_mps: float | None


class Spread:
    """Covariance of position [m] and velocity [m/s] along one axis. Corrections return their gains."""

    __slots__ = ("pp", "pv", "vv")

    def __init__(self, position_sigma_m: float, velocity_sigma_mps: float) -> None:
        self.pp = position_sigma_m**2
        self.pv = 0.0
        self.vv = velocity_sigma_mps**2

    def grow(self, dt_s: float, manoeuvre_mps: float) -> None:
        """Let `dt_s` pass without a report."""
        q = manoeuvre_mps**2
        self.pp += dt_s * (2.0 * self.pv + dt_s * self.vv) + q * dt_s**3 / 3.0
        self.pv += dt_s * self.vv + q * dt_s**2 / 2.0
        self.vv += q * dt_s

    def fix_position(self, sigma_m: float) -> tuple[float, float]:
        """Gains of position and velocity for one position."""
        innovation_m2 = self.pp + sigma_m**2
        k_p, k_v = self.pp / innovation_m2, self.pv / innovation_m2
        self.vv -= k_v * self.pv
        self.pv *= 1.0 - k_p
        self.pp *= 1.0 - k_p
        return k_p, k_v

    def fix_velocity(self, sigma_mps: float) -> tuple[float, float]:
        """Gains of position and velocity for one velocity."""
        innovation_m2ps2 = self.vv + sigma_mps**2
        k_p, k_v = self.pv / innovation_m2ps2, self.vv / innovation_m2ps2
        self.pp -= k_p * self.pv
        self.pv *= 1.0 - k_v
        self.vv *= 1.0 - k_v
        return k_p, k_v


class HorizontalEstimate:
    """Latitude, longitude [deg] and velocity over ground (north, east) [m/s] at `time_s`."""

    __slots__ = ("_frame", "_params", "_spread", "east_mps", "lat_deg", "lon_deg", "north_mps", "time_s")

    def __init__(self, fix: HorizontalFix, params: EstimateParams) -> None:
        self._params = params
        self._frame = LocalFrame(fix.lat_deg, fix.lon_deg)  # around the present place
        self.time_s = fix.time_s
        self.lat_deg = fix.lat_deg
        self.lon_deg = fix.lon_deg
        self.north_mps, self.east_mps = fix.velocity_mps or (0.0, 0.0)
        known = fix.velocity_mps is not None
        velocity_sigma_mps = params.velocity_sigma_mps if known else params.max_speed_mps / _ESTIMATE_SIGMAS
        self._spread = Spread(params.position_sigma_m, velocity_sigma_mps)

    def restart(self, fix: HorizontalFix) -> Self:
        """A fresh estimate that knows nothing but `fix`."""
        return type(self)(fix, self._params)

    def is_absurd(self, fix: HorizontalFix) -> bool:
        """Whether no aircraft gets from here to there (or to that velocity) in the time between."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        north_m, east_m = self._frame.to_north_east_m(fix.lat_deg, fix.lon_deg)
        velocity_slack_mps = _ESTIMATE_SIGMAS * math.sqrt(self._spread.vv)
        slack_m = _REPORT_SIGMAS * p.position_sigma_m + p.timestamp_error_s * math.hypot(
            self.north_mps, self.east_mps
        )
        if math.hypot(north_m, east_m) > p.max_speed_mps * dt_s + slack_m:
            return True
        allowed_m = velocity_slack_mps * dt_s + p.max_acceleration_mps2 * dt_s**2 / 2.0 + slack_m
        if math.hypot(north_m - self.north_mps * dt_s, east_m - self.east_mps * dt_s) > allowed_m:
            return True
        if fix.velocity_mps is None:
            return False
        allowed_mps = (
            _REPORT_SIGMAS * p.velocity_sigma_mps + velocity_slack_mps + p.max_acceleration_mps2 * dt_s
        )
        north_mps, east_mps = fix.velocity_mps
        return math.hypot(north_mps - self.north_mps, east_mps - self.east_mps) > allowed_mps

    def correct(self, fix: HorizontalFix) -> None:
        """Take in a report that is not older than this estimate."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        reported_north_m, reported_east_m = self._frame.to_north_east_m(fix.lat_deg, fix.lon_deg)
        north_m, east_m = self.north_mps * dt_s, self.east_mps * dt_s

        self._spread.grow(dt_s, p.manoeuvre_mps)
        k_p, k_v = self._spread.fix_position(p.position_sigma_m)
        off_north_m, off_east_m = reported_north_m - north_m, reported_east_m - east_m
        north_m += k_p * off_north_m
        east_m += k_p * off_east_m
        self.north_mps += k_v * off_north_m
        self.east_mps += k_v * off_east_m

        if fix.velocity_mps is not None:
            k_p, k_v = self._spread.fix_velocity(p.velocity_sigma_mps)
            off_north_mps = fix.velocity_mps[0] - self.north_mps
            off_east_mps = fix.velocity_mps[1] - self.east_mps
            north_m += k_p * off_north_mps
            east_m += k_p * off_east_mps
            self.north_mps += k_v * off_north_mps
            self.east_mps += k_v * off_east_mps

        self.lat_deg, self.lon_deg, _ = self._frame.to_geo(north_m, east_m, 0.0)
        self._frame = LocalFrame(self.lat_deg, self.lon_deg)
        self.time_s = max(fix.time_s, self.time_s)


class VerticalEstimate:
    """Altitude [m] and climb [m/s, positive up] at `time_s`."""

    __slots__ = ("_params", "_spread", "altitude_m", "climb_mps", "time_s")

    def __init__(self, fix: VerticalFix, params: EstimateParams) -> None:
        self._params = params
        self.time_s = fix.time_s
        self.altitude_m = fix.altitude_m
        self.climb_mps = fix.climb_mps or 0.0
        known = fix.climb_mps is not None
        climb_sigma_mps = params.climb_sigma_mps if known else params.max_climb_mps / _ESTIMATE_SIGMAS
        self._spread = Spread(params.altitude_sigma_m, climb_sigma_mps)

    def restart(self, fix: VerticalFix) -> Self:
        """A fresh estimate that knows nothing but `fix`."""
        return type(self)(fix, self._params)

    def is_absurd(self, fix: VerticalFix) -> bool:
        """Whether no aircraft gets from here to that height (or climb) in the time between."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        climb_slack_mps = _ESTIMATE_SIGMAS * math.sqrt(self._spread.vv)
        allowed_m = (
            _REPORT_SIGMAS * p.altitude_sigma_m
            + climb_slack_mps * dt_s
            + p.max_vertical_acceleration_mps2 * dt_s**2 / 2.0
            + p.timestamp_error_s * abs(self.climb_mps)
        )
        if abs(fix.altitude_m - self.altitude_m - self.climb_mps * dt_s) > allowed_m:
            return True
        if fix.climb_mps is None:
            return False
        allowed_mps = (
            _REPORT_SIGMAS * p.climb_sigma_mps + climb_slack_mps + p.max_vertical_acceleration_mps2 * dt_s
        )
        return abs(fix.climb_mps - self.climb_mps) > allowed_mps

    def correct(self, fix: VerticalFix) -> None:
        """Take in a report that is not older than this estimate."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        self.altitude_m += self.climb_mps * dt_s

        self._spread.grow(dt_s, p.climb_manoeuvre_mps)
        k_p, k_v = self._spread.fix_position(p.altitude_sigma_m)
        off_m = fix.altitude_m - self.altitude_m
        self.altitude_m += k_p * off_m
        self.climb_mps += k_v * off_m

        if fix.climb_mps is not None:
            k_p, k_v = self._spread.fix_velocity(p.climb_sigma_mps)
            off_mps = fix.climb_mps - self.climb_mps
            self.altitude_m += k_p * off_mps
            self.climb_mps += k_v * off_mps
        self.time_s = max(fix.time_s, self.time_s)
