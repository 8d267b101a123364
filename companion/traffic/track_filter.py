"""Filters of one target: position with velocity and turn, altitude with climb, each with a gate for outliers.

An innovation is gated by its square in units of its variance (normalized innovation squared), which is
chi-square distributed: Bar-Shalom, Li and Kirubarajan (2001), 5.4.2; Blackman and Popoli (1999), 6.3.
"""

import cmath
import math
from typing import Any, Final, Generic, NamedTuple, Protocol, Self, TypeVar

from companion.geodesy import LocalFrame
from companion.model import Vec2
from companion.traffic.estimate_params import EstimateParams
from companion.traffic.motion_models import (
    AlongPath,
    Covariance,
    LateralModels,
    Moments,
    Noises,
    grown_sigmas,
)

# Chi-square gates of two axes and of one: one in a million true reports is outside. Errors of receivers are
# not normal that far out, but the wrong ones are further by far.
_GATE_2D: Final = -2.0 * math.log(1e-6)
_GATE_1D: Final = 23.93
# An unknown velocity, or climb: the fastest is so many standard deviations.
_ESTIMATE_SIGMAS: Final = 3.0
# Bounds of stated standard deviations. Even the best receiver is displaced by its delay, and what is worse
# than the upper bound is no position.
_POSITION_SIGMAS_M: Final = (3.0, 2000.0)
_VELOCITY_SIGMAS_MPS: Final = (0.3, 20.0)
_ALTITUDE_SIGMAS_M: Final = (2.0, 200.0)
# A stated climb has changed by this since, in each second: a climb begins gently.
_CLIMB_CHANGE_MPS2: Final = 1.0
# Standard deviation of an error that is uniform over the time stamp's.
_LATE_SIGMA: Final = 1.0 / math.sqrt(12.0)
# Below this speed no rate of turn is estimated: hovering aircraft swing about.
_MIN_TURN_SPEED_MPS: Final = 5.0
# After a longer gap it may have turned and stopped turning.
_MAX_TURN_GAP_S: Final = 5.0
# The earth's radius is computed again after this change of latitude, about a kilometre.
_SAME_RADIUS_DEG: Final = 0.01


class HorizontalFix(NamedTuple):
    """A reported position at `time_s`, with the velocity over ground (north, east) if reported.

    The sigmas are standard deviations of each axis, if stated. Each `sender` has a noise of its own.
    """

    time_s: float
    lat_deg: float
    lon_deg: float
    velocity_mps: Vec2 | None
    position_sigma_m: float | None = None
    velocity_sigma_mps: float | None = None
    sender: str = ""


class VerticalFix(NamedTuple):
    """A reported altitude at `time_s`, with climb (positive up) and standard deviation if reported.

    The climb was measured `late_s` before.
    """

    time_s: float
    altitude_m: float
    climb_mps: float | None
    altitude_sigma_m: float | None = None
    late_s: float = 0.0


class HorizontalFilter:
    """Latitude, longitude [deg] and velocity over ground (north, east) [m/s] at `time_s`.

    `turn_radps` is the rate of turn, positive to the right, exactly 0 in straight flight. Along the path the
    motion is nearly constant velocity; across it, interacting models of straight flight and turn.
    """

    __slots__ = (
        "_along",
        "_east_m_per_deg",
        "_lateral",
        "_north_m_per_deg",
        "_params",
        "_position_noises",
        "_radius_m_per_deg",
        "_scaled_lat_deg",
        "_speed_mps",
        "_velocity_noises",
        "east_mps",
        "lat_deg",
        "lon_deg",
        "north_mps",
        "time_s",
        "turn_radps",
    )

    def __init__(self, fix: HorizontalFix, params: EstimateParams) -> None:
        self._params = params
        self.time_s, self.lat_deg, self.lon_deg = fix.time_s, fix.lat_deg, fix.lon_deg
        self._scale()
        self.north_mps, self.east_mps = fix.velocity_mps or (0.0, 0.0)
        self._speed_mps = math.hypot(self.north_mps, self.east_mps)
        self.turn_radps = 0.0
        self._position_noises, self._velocity_noises = Noises(), Noises()
        known = fix.velocity_mps is not None
        velocity_sigma_mps = (
            self._velocity_sigma_mps(fix) if known else params.max_speed_mps / _ESTIMATE_SIGMAS
        )
        moments = self._position_sigma_m(fix) ** 2, 0.0, velocity_sigma_mps**2
        self._along = AlongPath(moments)
        self._lateral = LateralModels(moments, params)

    def _scale(self) -> None:
        """Lengths of a degree here: `LocalFrame` has them for each place, but this is faster."""
        self._scaled_lat_deg = self.lat_deg if abs(self.lat_deg) < 89.0 else math.inf  # each time at a pole
        north_m, east_m = LocalFrame(self.lat_deg, 0.0).metres_per_degree
        self._north_m_per_deg = north_m
        self._east_m_per_deg = east_m
        self._radius_m_per_deg = east_m / max(math.cos(math.radians(self.lat_deg)), 1e-9)

    def restart(self, fix: HorizontalFix) -> Self:
        """A new filter that starts from `fix`."""
        return type(self)(fix, self._params)

    @property
    def moments(self) -> Moments:
        """Covariance of position and velocity: the mean of both axes."""
        along, (pp, pv, vv) = self._along, self._lateral.moments
        return 0.5 * (along.pp + pp), 0.5 * (along.pv + pv), 0.5 * (along.vv + vv)

    def is_outlier(self, fix: HorizontalFix) -> bool:
        """Whether no aircraft could reach that position or velocity in the time since the last report."""
        return self.is_elsewhere(fix) or self._has_other_velocity(fix)

    def is_elsewhere(self, fix: HorizontalFix) -> bool:
        """Whether no aircraft could reach that position.

        Nothing is an outlier within reach of the hardest manoeuvre; what is beyond it must be noise.
        """
        p, dt_s = self._params, fix.time_s - self.time_s
        if dt_s < 0.0:
            dt_s = 0.0
        north_m, east_m = self._from_here_m(fix)
        late_m = p.timestamp_error_s * self._speed_mps
        beyond_m = math.hypot(north_m, east_m) - p.max_speed_mps * dt_s - late_m
        if beyond_m > 0.0 and self._is_beyond_noise(beyond_m, 0.0, fix):
            return True
        off_m = math.hypot(north_m - self.north_mps * dt_s, east_m - self.east_mps * dt_s)
        beyond_m = off_m - 0.5 * p.max_acceleration_mps2 * dt_s * dt_s - late_m
        return beyond_m > 0.0 and self._is_beyond_noise(beyond_m, dt_s, fix)

    def _is_beyond_noise(self, beyond_m: float, predicted_s: float, fix: HorizontalFix) -> bool:
        predicted_m, _ = grown_sigmas(self.moments, predicted_s, 0.0)
        sigma_m = self._position_sigma_m(fix) * max(self._position_noises.scale(fix.sender), 1.0)
        return beyond_m**2 > _GATE_2D * (predicted_m**2 + sigma_m**2)

    def _has_other_velocity(self, fix: HorizontalFix) -> bool:
        if fix.velocity_mps is None:
            return False
        north_mps, east_mps = fix.velocity_mps
        dt_s = max(fix.time_s - self.time_s, 0.0)
        off_mps = math.hypot(north_mps - self.north_mps, east_mps - self.east_mps)
        beyond_mps = off_mps - self._params.max_acceleration_mps2 * dt_s
        if beyond_mps <= 0.0:
            return False
        sigma_mps = self._velocity_sigma_mps(fix) * max(self._velocity_noises.scale(fix.sender), 1.0)
        return beyond_mps**2 > _GATE_2D * (self.moments[2] + sigma_mps**2)

    def flown_on(self, fix: HorizontalFix) -> HorizontalFix:
        """A report from before the estimate as one at its time; what may have changed since is its noise."""
        late_s = self.time_s - fix.time_s
        half_turn = cmath.rect(1.0, 0.5 * self.turn_radps * late_s)
        flown_m = complex(self.north_mps, self.east_mps) * late_s / half_turn
        velocity_mps = fix.velocity_mps
        if velocity_mps is not None:
            turned = complex(*velocity_mps) * half_turn * half_turn
            velocity_mps = turned.real, turned.imag
        changed = self._params.manoeuvre_mps**2 * late_s
        flown_m2 = late_s * late_s * (self.moments[2] + changed / 3.0)
        return HorizontalFix(
            self.time_s,
            fix.lat_deg + flown_m.real / self._north_m_per_deg,
            (fix.lon_deg + flown_m.imag / self._east_m_per_deg + 180.0) % 360.0 - 180.0,
            velocity_mps,
            math.sqrt(self._position_sigma_m(fix) ** 2 + flown_m2),
            math.sqrt(self._velocity_sigma_mps(fix) ** 2 + changed),
            fix.sender,
        )

    def update(self, fix: HorizontalFix) -> None:
        """Process a report that is not older than the estimate."""
        dt_s = fix.time_s - self.time_s
        if dt_s < 0.0:
            dt_s = 0.0
        lateral, gap = self._lateral, dt_s > _MAX_TURN_GAP_S
        if gap:
            lateral.restart(lateral.moments)
        moved_m = self._predict(dt_s)
        self._correct(fix, moved_m)
        if gap:
            lateral.restart(lateral.moments)
        self.time_s += dt_s
        self.turn_radps = lateral.turn_radps if self._speed_mps > _MIN_TURN_SPEED_MPS else 0.0

    def _predict(self, dt_s: float) -> Vec2:
        """Propagate the velocity and the covariance by `dt_s`; returns the path flown, north and east [m]."""
        self._along.predict(dt_s, self._params.manoeuvre_mps)
        half_rad = 0.5 * dt_s * self._lateral.begin(dt_s, self._speed_mps)
        cos, sin = math.cos(half_rad), math.sin(half_rad)
        north_mps, east_mps = self.north_mps, self.east_mps
        north_mps, east_mps = north_mps * cos - east_mps * sin, north_mps * sin + east_mps * cos
        self.north_mps, self.east_mps = north_mps * cos - east_mps * sin, north_mps * sin + east_mps * cos
        return north_mps * dt_s, east_mps * dt_s

    def _correct(self, fix: HorizontalFix, moved_m: Vec2) -> None:
        """Process the measurements, relative to the path flown and along its direction."""
        along, lateral, speed_mps = self._along, self._lateral, self._speed_mps
        north, east = (self.north_mps / speed_mps, self.east_mps / speed_mps) if speed_mps else (1.0, 0.0)
        north_m, east_m = self._from_here_m(fix)
        north_m -= moved_m[0]
        east_m -= moved_m[1]
        sigma_m = self._position_sigma_m(fix) * self._position_noises.scale(fix.sender)
        late_m = _LATE_SIGMA * self._params.timestamp_error_s * speed_mps
        along_sigma_m = math.sqrt(sigma_m * sigma_m + late_m * late_m)
        variance_m2 = along.measure_position(north_m * north + east_m * east, along_sigma_m)
        variance_m2 += lateral.update_position(east_m * north - north_m * east, sigma_m)
        self._position_noises.observe(fix.sender, north_m, east_m, 0.5 * variance_m2, sigma_m * sigma_m)
        if fix.velocity_mps is not None:
            north_mps, east_mps = fix.velocity_mps
            north_mps -= self.north_mps
            east_mps -= self.east_mps
            sigma_mps = self._velocity_sigma_mps(fix) * self._velocity_noises.scale(fix.sender)
            variance = along.measure_velocity(north_mps * north + east_mps * east, sigma_mps)
            variance += lateral.update_velocity(east_mps * north - north_mps * east, sigma_mps)
            self._velocity_noises.observe(
                fix.sender, north_mps, east_mps, 0.5 * variance, sigma_mps * sigma_mps
            )
        (along_m, along_mps), (across_m, across_mps) = along.end(), lateral.end()
        self._move(
            moved_m[0] + along_m * north - across_m * east, moved_m[1] + along_m * east + across_m * north
        )
        self.north_mps += along_mps * north - across_mps * east
        self.east_mps += along_mps * east + across_mps * north
        self._speed_mps = math.hypot(self.north_mps, self.east_mps)

    def _from_here_m(self, fix: HorizontalFix) -> Vec2:
        """North and east of a reported position from the estimated one."""
        dlon_deg = (fix.lon_deg - self.lon_deg + 180.0) % 360.0 - 180.0
        return (fix.lat_deg - self.lat_deg) * self._north_m_per_deg, dlon_deg * self._east_m_per_deg

    def _move(self, north_m: float, east_m: float) -> None:
        self.lat_deg += north_m / self._north_m_per_deg
        self.lon_deg = (self.lon_deg + east_m / self._east_m_per_deg + 180.0) % 360.0 - 180.0
        moved_deg = self.lat_deg - self._scaled_lat_deg
        if -_SAME_RADIUS_DEG < moved_deg < _SAME_RADIUS_DEG:
            self._east_m_per_deg = self._radius_m_per_deg * math.cos(math.radians(self.lat_deg))
        else:
            self._scale()

    def _position_sigma_m(self, fix: HorizontalFix) -> float:
        stated_m = fix.position_sigma_m
        return self._params.position_sigma_m if stated_m is None else _bounded(stated_m, _POSITION_SIGMAS_M)

    def _velocity_sigma_mps(self, fix: HorizontalFix) -> float:
        stated_mps = fix.velocity_sigma_mps
        return (
            self._params.velocity_sigma_mps
            if stated_mps is None
            else _bounded(stated_mps, _VELOCITY_SIGMAS_MPS)
        )


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
        self._covariance = Covariance(self._altitude_sigma_m(fix), climb_sigma_mps)

    def restart(self, fix: VerticalFix) -> Self:
        """A new filter that starts from `fix`."""
        return type(self)(fix, self._params)

    @property
    def moments(self) -> Moments:
        """Covariance of altitude and climb."""
        here = self._covariance
        return here.pp, here.pv, here.vv

    def is_outlier(self, fix: VerticalFix) -> bool:
        """Whether no aircraft could reach that altitude or climb in the time since the last report."""
        p, dt_s = self._params, fix.time_s - self.time_s
        if dt_s < 0.0:
            dt_s = 0.0
        beyond_m = abs(fix.altitude_m - self.altitude_m - self.climb_mps * dt_s)
        beyond_m -= 0.5 * p.max_vertical_acceleration_mps2 * dt_s * dt_s
        beyond_m -= p.timestamp_error_s * abs(self.climb_mps)
        if beyond_m > 0.0 and self._is_beyond_noise(beyond_m, dt_s, fix):
            return True
        if fix.climb_mps is None:
            return False
        beyond_mps = abs(fix.climb_mps - self.climb_mps) - p.max_vertical_acceleration_mps2 * dt_s
        return beyond_mps > 0.0 and beyond_mps**2 > _GATE_1D * (self._covariance.vv + p.climb_sigma_mps**2)

    def _is_beyond_noise(self, beyond_m: float, dt_s: float, fix: VerticalFix) -> bool:
        predicted_m, _ = grown_sigmas(self.moments, dt_s, 0.0)
        return beyond_m**2 > _GATE_1D * (predicted_m**2 + self._altitude_sigma_m(fix) ** 2)

    def update(self, fix: VerticalFix) -> None:
        """Process a report that is not older than the estimate."""
        p, dt_s = self._params, fix.time_s - self.time_s
        if dt_s < 0.0:
            dt_s = 0.0
        self.time_s += dt_s
        self.altitude_m += self.climb_mps * dt_s

        self._covariance.predict(dt_s, p.climb_manoeuvre_mps)
        k_p, k_v = self._covariance.update_position(self._altitude_sigma_m(fix))
        innovation_m = fix.altitude_m - self.altitude_m
        self.altitude_m += k_p * innovation_m
        self.climb_mps += k_v * innovation_m

        if fix.climb_mps is not None:
            self._correct_climb(fix.climb_mps, fix.late_s)

    def observe_climb(self, fix: VerticalFix) -> None:
        """Use the climb of a report in another reference; the altitude, and its time, are not reported."""
        if fix.climb_mps is not None:
            self._correct_climb(fix.climb_mps, fix.late_s + abs(fix.time_s - self.time_s))

    def _correct_climb(self, climb_mps: float, late_s: float) -> None:
        sigma_mps = math.hypot(self._params.climb_sigma_mps, _CLIMB_CHANGE_MPS2 * late_s)
        k_p, k_v = self._covariance.update_velocity(sigma_mps)
        innovation_mps = climb_mps - self.climb_mps
        self.altitude_m += k_p * innovation_mps
        self.climb_mps += k_v * innovation_mps

    def _altitude_sigma_m(self, fix: VerticalFix) -> float:
        stated_m = fix.altitude_sigma_m
        return self._params.altitude_sigma_m if stated_m is None else _bounded(stated_m, _ALTITUDE_SIGMAS_M)


def _bounded(sigma: float, bounds: Vec2) -> float:
    return min(max(sigma, bounds[0]), bounds[1])


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
