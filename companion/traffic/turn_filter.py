"""Rate of turn of a target, from the courses that it reports.

A Kalman filter beside the position filter; its state is the course and the rate of turn. Turns begin and end
abruptly, and most of the time there is none. The rate therefore counts only where it exceeds the noise of
straight flight.
"""

import math

from companion.model import Vec2
from companion.traffic.track_filter import Covariance, EstimateParams

# Below this speed the course says little: hovering aircraft swing about.
_MIN_SPEED_MPS = 5.0
# Aircraft in forward flight turn no faster; one that pivots on the spot stays where it is.
_MAX_RATE_RADPS = math.radians(20.0)
_MAX_GAP_S = 5.0
# The noise of courses differs between senders and is rarely stated. Its variance is estimated from the
# innovations, averaged over this many reports, and limited to these multiples of the usual sigma.
_NOISE_AVERAGING_REPORTS = 20.0
_MIN_NOISE_SCALE, _MAX_NOISE_SCALE = 0.5, 4.0
# A larger squared innovation, in units of its variance, is not noise: a turn began, or the report is wrong.
_MAX_INNOVATION2 = 10.0


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
        return min(max(weight * self._rate_radps, -_MAX_RATE_RADPS), _MAX_RATE_RADPS)

    def receive(self, time_s: float, velocity_mps: Vec2 | None) -> None:
        """Process the velocity of a report that is not older than the last; `None`: no velocity reported."""
        if velocity_mps is None:
            return
        speed_mps = math.hypot(*velocity_mps)
        if speed_mps < _MIN_SPEED_MPS:
            self._time_s = -math.inf
            self._rate_radps = 0.0
            return
        course_rad = math.atan2(velocity_mps[1], velocity_mps[0])
        noise_scale = min(max(math.sqrt(self._noise_scale2), _MIN_NOISE_SCALE), _MAX_NOISE_SCALE)
        sigma_rad = noise_scale * self._params.velocity_sigma_mps / speed_mps
        dt_s = time_s - self._time_s
        self._time_s = time_s
        if dt_s > _MAX_GAP_S:
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
