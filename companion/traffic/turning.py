"""How fast a target turns, from the courses it reports.

A constant-turn Kalman filter beside the one that places the target: its state is the course and the rate at
which it changes. Turns begin and end at once, and most of the time there is none: so the rate is told only
where it stands out from what noise makes of straight flight.
"""

import math

from companion.model import Vec2
from companion.traffic.track_filter import EstimateParams, Spread

# Slower than this a course says little of where one goes next: what hovers swings about.
_SLOWEST_MPS = 5.0
# Nothing that flies straight ahead turns faster; who pivots on the spot gets nowhere.
_FASTEST_RADPS = math.radians(20.0)
_LONGEST_GAP_S = 5.0
# How noisy courses are differs from sender to sender, and few tell. It is learnt from how far they are from
# what was expected, in so many reports, and believed within these shares of what is usual.
_LEARNS_IN = 20.0
_NOISE_SHARES = (0.5, 4.0)
_ONE_REPORT = 10.0  # so many times what was expected says no more: a turn has begun, or a report is wrong


class TurnEstimate:
    """Rate of turn [rad/s, positive to the right] from velocities over ground (north, east) [m/s]."""

    __slots__ = ("_course_rad", "_noise2", "_params", "_rate_radps", "_spread", "_time_s")

    def __init__(self, params: EstimateParams) -> None:
        self._params = params
        self._time_s = -math.inf
        self._course_rad = 0.0
        self._rate_radps = 0.0
        self._spread = Spread(0.0, 0.0)
        self._noise2 = 1.0  # the variance of the noise, in shares of the usual

    @property
    def rate_radps(self) -> float:
        """The rate where it is significant, all of it from two standard deviations on; else 0."""
        sigma_radps = math.sqrt(self._spread.vv)
        if abs(self._rate_radps) <= sigma_radps:
            return 0.0
        believed = min(abs(self._rate_radps) / sigma_radps - 1.0, 1.0)
        return min(max(believed * self._rate_radps, -_FASTEST_RADPS), _FASTEST_RADPS)

    def receive(self, time_s: float, velocity_mps: Vec2 | None) -> None:
        """Take in the velocity of a report that is not older than the last; `None`: it gave none."""
        if velocity_mps is None:
            return
        speed_mps = math.hypot(*velocity_mps)
        if speed_mps < _SLOWEST_MPS:
            self._time_s = -math.inf
            self._rate_radps = 0.0
            return
        course_rad = math.atan2(velocity_mps[1], velocity_mps[0])
        least, most = _NOISE_SHARES
        share = min(max(math.sqrt(self._noise2), least), most)
        sigma_rad = share * self._params.velocity_sigma_mps / speed_mps
        dt_s = time_s - self._time_s
        self._time_s = time_s
        if dt_s > _LONGEST_GAP_S:
            self._course_rad, self._rate_radps = course_rad, 0.0
            self._spread = Spread(sigma_rad, self._params.turn_sigma_radps)
            return
        self._spread.grow(dt_s, self._params.turn_manoeuvre_radps)
        expected_rad = self._course_rad + self._rate_radps * dt_s
        off_rad = math.remainder(course_rad - expected_rad, math.tau)
        # Of the surprise, the part that noise has in what is expected of it.
        surprise = off_rad**2 / (self._spread.pp + sigma_rad**2)
        self._noise2 += (share**2 * min(surprise, _ONE_REPORT) - self._noise2) / _LEARNS_IN
        k_p, k_v = self._spread.fix_position(sigma_rad)
        self._course_rad = expected_rad + k_p * off_rad
        self._rate_radps += k_v * off_rad
