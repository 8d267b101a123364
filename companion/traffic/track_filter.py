"""Filters of one target: position with velocity, altitude, turn rate, each with a gate for outliers."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Generic, NamedTuple, Protocol, Self, TypeVar

from annotated_types import Ge, Gt

from companion.geodesy import LocalFrame
from companion.model import Vec2

# Largest credible deviation, in standard deviations of the report and of the estimate.
_REPORT_SIGMAS = 6.0
_ESTIMATE_SIGMAS = 3.0

# Below this speed no rate of turn is estimated: hovering aircraft swing about.
_MIN_TURN_SPEED_MPS = 5.0
# Aircraft in forward flight turn no faster; one that pivots on the spot stays where it is.
_MAX_TURN_RATE_RADPS = math.radians(20.0)
_MAX_TURN_GAP_S = 5.0
# The noise of courses differs between senders and is rarely stated. Its variance is estimated from the
# innovations, averaged over this many reports, and limited to these multiples of the usual sigma.
_NOISE_AVERAGING_REPORTS = 20.0
_MIN_NOISE_SCALE, _MAX_NOISE_SCALE = 0.5, 4.0
# A larger squared innovation, in units of its variance, is not noise: a turn began, or the report is wrong.
_MAX_INNOVATION2 = 10.0


@dataclass(frozen=True, slots=True)
class EstimateParams:
    """Noise of reports, motion of aircraft, and limits beyond which a report is an outlier."""

    # Standard deviations of a report, each axis.
    position_sigma_m: Annotated[float, Gt(0)] = 15.0
    velocity_sigma_mps: Annotated[float, Gt(0)] = 1.5
    altitude_sigma_m: Annotated[float, Gt(0)] = 8.0
    climb_sigma_mps: Annotated[float, Gt(0)] = 0.8
    # Random change of a velocity in one second (root of q). Larger values follow turns faster, smaller ones
    # smooth more.
    manoeuvre_mps: Annotated[float, Gt(0)] = 2.0
    climb_manoeuvre_mps: Annotated[float, Gt(0)] = 0.5
    # Rate of turn: uncertainty after the first course, and random change in one second. Standard rate turns
    # of 3 degrees a second begin and end at once, so one second must permit much of that change.
    turn_sigma_radps: Annotated[float, Gt(0)] = math.radians(3.0)
    turn_manoeuvre_radps: Annotated[float, Gt(0)] = math.radians(1.0)
    # Fastest traffic: bounds an unknown velocity after the first position, and what a report may state.
    max_speed_mps: Annotated[float, Gt(0)] = 400.0
    max_climb_mps: Annotated[float, Gt(0)] = 60.0
    # Hardest manoeuvre: 3 g covers aerobatics, 1 g any change of climb.
    max_acceleration_mps2: Annotated[float, Gt(0)] = 30.0
    max_vertical_acceleration_mps2: Annotated[float, Gt(0)] = 10.0
    # ADSB_VEHICLE.tslc counts whole seconds, so a report may be displaced along its path by one second.
    timestamp_error_s: Annotated[float, Ge(0)] = 1.0


class HorizontalFix(NamedTuple):
    """A reported position at `time_s`, with the velocity over ground (north, east) if reported."""

    time_s: float
    lat_deg: float
    lon_deg: float
    velocity_mps: Vec2 | None


class VerticalFix(NamedTuple):
    """A reported altitude at `time_s`, with the climb (positive up) if reported."""

    time_s: float
    altitude_m: float
    climb_mps: float | None


class Covariance:
    """Covariance of position [m] and velocity [m/s] along one axis. Updates return the Kalman gains."""

    __slots__ = ("pp", "pv", "vv")

    def __init__(self, position_sigma_m: float, velocity_sigma_mps: float) -> None:
        self.pp = position_sigma_m**2
        self.pv = 0.0
        self.vv = velocity_sigma_mps**2

    def predict(self, dt_s: float, manoeuvre_mps: float) -> None:
        """Propagate by `dt_s` with process noise."""
        q = manoeuvre_mps**2
        self.pp += dt_s * (2.0 * self.pv + dt_s * self.vv) + q * dt_s**3 / 3.0
        self.pv += dt_s * self.vv + q * dt_s**2 / 2.0
        self.vv += q * dt_s

    def update_position(self, sigma_m: float) -> tuple[float, float]:
        """Gains of position and velocity for a measured position."""
        innovation_m2 = self.pp + sigma_m**2
        k_p, k_v = self.pp / innovation_m2, self.pv / innovation_m2
        self.vv -= k_v * self.pv
        self.pv *= 1.0 - k_p
        self.pp *= 1.0 - k_p
        return k_p, k_v

    def update_velocity(self, sigma_mps: float) -> tuple[float, float]:
        """Gains of position and velocity for a measured velocity."""
        innovation_m2ps2 = self.vv + sigma_mps**2
        k_p, k_v = self.pv / innovation_m2ps2, self.vv / innovation_m2ps2
        self.pp -= k_p * self.pv
        self.pv *= 1.0 - k_v
        self.vv *= 1.0 - k_v
        return k_p, k_v


class HorizontalFilter:
    """Latitude, longitude [deg] and velocity over ground (north, east) [m/s] at `time_s`."""

    __slots__ = ("_covariance", "_frame", "_params", "east_mps", "lat_deg", "lon_deg", "north_mps", "time_s")

    def __init__(self, fix: HorizontalFix, params: EstimateParams) -> None:
        self._params = params
        self._frame = LocalFrame(fix.lat_deg, fix.lon_deg)  # its origin is the estimated position
        self.time_s = fix.time_s
        self.lat_deg = fix.lat_deg
        self.lon_deg = fix.lon_deg
        self.north_mps, self.east_mps = fix.velocity_mps or (0.0, 0.0)
        known = fix.velocity_mps is not None
        velocity_sigma_mps = params.velocity_sigma_mps if known else params.max_speed_mps / _ESTIMATE_SIGMAS
        self._covariance = Covariance(params.position_sigma_m, velocity_sigma_mps)

    def restart(self, fix: HorizontalFix) -> Self:
        """A new filter that starts from `fix`."""
        return type(self)(fix, self._params)

    def is_outlier(self, fix: HorizontalFix) -> bool:
        """Whether no aircraft could reach that position or velocity in the time since the last report."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        north_m, east_m = self._frame.to_north_east_m(fix.lat_deg, fix.lon_deg)
        velocity_slack_mps = _ESTIMATE_SIGMAS * math.sqrt(self._covariance.vv)
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

    def update(self, fix: HorizontalFix) -> None:
        """Process a report that is not older than the estimate."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        reported_north_m, reported_east_m = self._frame.to_north_east_m(fix.lat_deg, fix.lon_deg)
        north_m, east_m = self.north_mps * dt_s, self.east_mps * dt_s

        self._covariance.predict(dt_s, p.manoeuvre_mps)
        k_p, k_v = self._covariance.update_position(p.position_sigma_m)
        innovation_north_m, innovation_east_m = reported_north_m - north_m, reported_east_m - east_m
        north_m += k_p * innovation_north_m
        east_m += k_p * innovation_east_m
        self.north_mps += k_v * innovation_north_m
        self.east_mps += k_v * innovation_east_m

        if fix.velocity_mps is not None:
            k_p, k_v = self._covariance.update_velocity(p.velocity_sigma_mps)
            innovation_north_mps = fix.velocity_mps[0] - self.north_mps
            innovation_east_mps = fix.velocity_mps[1] - self.east_mps
            north_m += k_p * innovation_north_mps
            east_m += k_p * innovation_east_mps
            self.north_mps += k_v * innovation_north_mps
            self.east_mps += k_v * innovation_east_mps

        self.lat_deg, self.lon_deg, _ = self._frame.to_geo(north_m, east_m, 0.0)
        self._frame = LocalFrame(self.lat_deg, self.lon_deg)
        self.time_s = max(fix.time_s, self.time_s)


class VerticalFilter:
    """Altitude [m] and climb [m/s, positive up] at `time_s`."""

    __slots__ = ("_covariance", "_params", "altitude_m", "climb_mps", "time_s")

    def __init__(self, fix: VerticalFix, params: EstimateParams) -> None:
        self._params = params
        self.time_s = fix.time_s
        self.altitude_m = fix.altitude_m
        self.climb_mps = fix.climb_mps or 0.0
        known = fix.climb_mps is not None
        climb_sigma_mps = params.climb_sigma_mps if known else params.max_climb_mps / _ESTIMATE_SIGMAS
        self._covariance = Covariance(params.altitude_sigma_m, climb_sigma_mps)

    def restart(self, fix: VerticalFix) -> Self:
        """A new filter that starts from `fix`."""
        return type(self)(fix, self._params)

    def is_outlier(self, fix: VerticalFix) -> bool:
        """Whether no aircraft could reach that altitude or climb in the time since the last report."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        climb_slack_mps = _ESTIMATE_SIGMAS * math.sqrt(self._covariance.vv)
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

    def update(self, fix: VerticalFix) -> None:
        """Process a report that is not older than the estimate."""
        p = self._params
        dt_s = max(fix.time_s - self.time_s, 0.0)
        self.altitude_m += self.climb_mps * dt_s

        self._covariance.predict(dt_s, p.climb_manoeuvre_mps)
        k_p, k_v = self._covariance.update_position(p.altitude_sigma_m)
        innovation_m = fix.altitude_m - self.altitude_m
        self.altitude_m += k_p * innovation_m
        self.climb_mps += k_v * innovation_m

        if fix.climb_mps is not None:
            k_p, k_v = self._covariance.update_velocity(p.climb_sigma_mps)
            innovation_mps = fix.climb_mps - self.climb_mps
            self.altitude_m += k_p * innovation_mps
            self.climb_mps += k_v * innovation_mps
        self.time_s = max(fix.time_s, self.time_s)


_Fix = TypeVar("_Fix")
_FixIn = TypeVar("_FixIn", contravariant=True)


class _Filter(Protocol[_FixIn]):
    """The part of a filter that `OutlierGate` uses."""

    def restart(self, fix: _FixIn) -> Self: ...
    def is_outlier(self, fix: _FixIn) -> bool: ...
    def update(self, fix: _FixIn) -> None: ...


_FilterT = TypeVar("_FilterT", bound=_Filter[Any])


class OutlierGate(Generic[_FilterT, _Fix]):
    """Protects a filter: an outlier is rejected unless the next report confirms it."""

    __slots__ = ("_suspect", "estimate")

    def __init__(self, estimate: _FilterT) -> None:
        self.estimate = estimate
        self._suspect: _FilterT | None = None  # starts from the outlier

    def receive(self, fix: _Fix) -> bool:
        """Process a report; False if it is rejected as an outlier."""
        if self.estimate.is_outlier(fix):
            if self._suspect is None or self._suspect.is_outlier(fix):
                self._suspect = self.estimate.restart(fix)
                return False
            self.estimate = self._suspect
        self._suspect = None
        self.estimate.update(fix)
        return True


class TurnFilter:
    """Rate of turn [rad/s, positive to the right] from velocities over ground (north, east) [m/s]."""

    __slots__ = ("_course_rad", "_covariance", "_noise_scale2", "_params", "_rate_radps", "_time_s")

    def __init__(self, params: EstimateParams) -> None:
        self._params = params
        self._time_s = -math.inf
        self._course_rad = 0.0
        self._rate_radps = 0.0
        self._covariance = Covariance(0.0, 0.0)
        self._noise_scale2 = 1.0  # variance of the noise relative to the usual variance

    @property
    def rate_radps(self) -> float:
        """The rate if it is significant: 0 up to one standard deviation, all of it from two on."""
        sigma_radps = math.sqrt(self._covariance.vv)
        if abs(self._rate_radps) <= sigma_radps:
            return 0.0
        weight = min(abs(self._rate_radps) / sigma_radps - 1.0, 1.0)
        return min(max(weight * self._rate_radps, -_MAX_TURN_RATE_RADPS), _MAX_TURN_RATE_RADPS)

    def receive(self, time_s: float, velocity_mps: Vec2 | None) -> None:
        """Process the velocity of a report that is not older than the last; `None`: no velocity reported."""
        if velocity_mps is None:
            return
        speed_mps = math.hypot(*velocity_mps)
        if speed_mps < _MIN_TURN_SPEED_MPS:
            self._time_s = -math.inf
            self._rate_radps = 0.0
            return
        course_rad = math.atan2(velocity_mps[1], velocity_mps[0])
        noise_scale = min(max(math.sqrt(self._noise_scale2), _MIN_NOISE_SCALE), _MAX_NOISE_SCALE)
        sigma_rad = noise_scale * self._params.velocity_sigma_mps / speed_mps
        dt_s = time_s - self._time_s
        self._time_s = time_s
        if dt_s > _MAX_TURN_GAP_S:
            self._course_rad, self._rate_radps = course_rad, 0.0
            self._covariance = Covariance(sigma_rad, self._params.turn_sigma_radps)
            return
        self._update(course_rad, sigma_rad, noise_scale, dt_s)

    def _update(self, course_rad: float, sigma_rad: float, noise_scale: float, dt_s: float) -> None:
        self._covariance.predict(dt_s, self._params.turn_manoeuvre_radps)
        predicted_rad = self._course_rad + self._rate_radps * dt_s
        innovation_rad = math.remainder(course_rad - predicted_rad, math.tau)
        innovation2 = innovation_rad**2 / (self._covariance.pp + sigma_rad**2)
        measured_scale2 = noise_scale**2 * min(innovation2, _MAX_INNOVATION2)
        self._noise_scale2 += (measured_scale2 - self._noise_scale2) / _NOISE_AVERAGING_REPORTS
        k_p, k_v = self._covariance.update_position(sigma_rad)
        self._course_rad = predicted_rad + k_p * innovation_rad
        self._rate_radps += k_v * innovation_rad
