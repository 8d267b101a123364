"""Covariances of the filters of one target, their Kalman gains, and the noise of reports, in plain numbers.

Source of the equations: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and
Navigation" (2001), chapter 5 (Kalman filter), 6.2.2 (process noise) and 11.6.6 (mixing).
"""

import math
from typing import Final

from companion.model import Vec2, Vec3

# Variance of a position [m2], its covariance with the velocity [m2/s], and variance of the velocity [m2/s2].
Moments = Vec3

# The noise is estimated from the innovations, averaged over about this many reports (Mehra, "Approaches to
# adaptive filtering", IEEE Transactions on Automatic Control 17, 1972), and limited to these multiples of its
# sigma: senders state it rarely, as a class, or too well. Only the change from one innovation to the next is
# noise: what persists is a turn, or a velocity that the positions contradict, and must be followed.
_AVERAGED_REPORTS: Final = 20
_FIRST_AVERAGED: Final = 3
_MIN_SCALE2, _MAX_SCALE2 = 0.25**2, 4.0**2
# A larger squared innovation, in units of its variance, is not noise: a turn began, or the report is wrong.
_MAX_INNOVATION2: Final = 10.0


class Covariance:
    """Covariance of position [m] and velocity [m/s] along one axis. Updates return the Kalman gains."""

    __slots__ = ("pp", "pv", "vv")

    def __init__(self, position_sigma_m: float, velocity_sigma_mps: float) -> None:
        self.pp = position_sigma_m * position_sigma_m
        self.pv = 0.0
        self.vv = velocity_sigma_mps * velocity_sigma_mps

    def predict(self, dt_s: float, manoeuvre_mps: float) -> None:
        """Propagate by `dt_s` with process noise."""
        pv, vv, q_dt = self.pv, self.vv, manoeuvre_mps * manoeuvre_mps * dt_s
        self.pp += dt_s * (2.0 * pv + dt_s * (vv + q_dt / 3.0))
        self.pv = pv + dt_s * (vv + 0.5 * q_dt)
        self.vv = vv + q_dt

    def mix(self, share: float, other: Moments, apart_m: float, apart_mps: float) -> None:
        """Become the covariance of a mixture with `share` of another estimate, which is apart by this."""
        spread, (pp, pv, vv) = 1.0 - share, other
        self.pp += share * (pp - self.pp + spread * apart_m * apart_m)
        self.pv += share * (pv - self.pv + spread * apart_m * apart_mps)
        self.vv += share * (vv - self.vv + spread * apart_mps * apart_mps)

    def update_position(self, sigma_m: float) -> Vec2:
        """Gains of position and velocity for a measured position."""
        pp, pv = self.pp, self.pv
        innovation_m2 = pp + sigma_m * sigma_m
        k_p, k_v = pp / innovation_m2, pv / innovation_m2
        rest = 1.0 - k_p
        self.vv -= k_v * pv
        self.pv = pv * rest
        self.pp = pp * rest
        return k_p, k_v

    def update_velocity(self, sigma_mps: float) -> Vec2:
        """Gains of position and velocity for a measured velocity."""
        pv, vv = self.pv, self.vv
        innovation_m2ps2 = vv + sigma_mps * sigma_mps
        k_p, k_v = pv / innovation_m2ps2, vv / innovation_m2ps2
        rest = 1.0 - k_v
        self.pp -= k_p * pv
        self.pv = pv * rest
        self.vv = vv * rest
        return k_p, k_v


class TurnCovariance:
    """Covariance of position [m] and velocity [m/s] across the path, and of the rate of turn [rad/s]."""

    __slots__ = ("pp", "pv", "pw", "vv", "vw", "ww")

    def __init__(self, moments: Moments, turn_sigma_radps: float) -> None:
        self.pp, self.pv, self.vv = moments
        self.pw = self.vw = 0.0
        self.ww = turn_sigma_radps * turn_sigma_radps

    def predict(
        self, dt_s: float, speed_mps: float, crosswise_mps: float, turn_manoeuvre_radps: float
    ) -> None:
        """Propagate by `dt_s` with process noise: at `speed_mps` a rate of turn changes the velocity."""
        pv, pw, vv, vw, ww = self.pv, self.pw, self.vv, self.vw, self.ww
        half_m, q_dt = 0.5 * speed_mps * dt_s, crosswise_mps * crosswise_mps * dt_s
        halfway_vw = vw + half_m * ww
        turned_vv = vv + half_m * (vw + halfway_vw)  # of the mean velocity in this time
        self.pp += dt_s * (2.0 * (pv + half_m * pw) + dt_s * (turned_vv + q_dt / 3.0))
        self.pw = pw_ahead = pw + dt_s * halfway_vw
        self.pv = pv + dt_s * (vv + 0.5 * q_dt + half_m * vw) + 2.0 * half_m * pw_ahead
        self.vv = vv + q_dt + 4.0 * half_m * halfway_vw
        self.vw = halfway_vw + half_m * ww
        self.ww = ww + turn_manoeuvre_radps * turn_manoeuvre_radps * dt_s

    def mix(
        self, share: float, other: Moments, apart_m: float, apart_mps: float, radps: float, radps2: float
    ) -> None:
        """Mix with an estimate without a turn: its rate is 0 with a variance of `radps2`, ours is `radps`."""
        spread, (pp, pv, vv) = 1.0 - share, other
        apart_radps = spread * radps
        self.pp += share * (pp - self.pp + spread * apart_m * apart_m)
        self.pv += share * (pv - self.pv + spread * apart_m * apart_mps)
        self.vv += share * (vv - self.vv + spread * apart_mps * apart_mps)
        self.pw += share * (apart_m * apart_radps - self.pw)
        self.vw += share * (apart_mps * apart_radps - self.vw)
        self.ww += share * (radps2 - self.ww + apart_radps * radps)

    def update_position(self, sigma_m: float) -> Vec3:
        """Gains of position, velocity and rate for a measured position."""
        pp, pv, pw = self.pp, self.pv, self.pw
        innovation_m2 = pp + sigma_m * sigma_m
        k_p, k_v, k_w = pp / innovation_m2, pv / innovation_m2, pw / innovation_m2
        rest = 1.0 - k_p
        self.vv -= k_v * pv
        self.vw -= k_v * pw
        self.ww -= k_w * pw
        self.pp, self.pv, self.pw = pp * rest, pv * rest, pw * rest
        return k_p, k_v, k_w

    def update_velocity(self, sigma_mps: float) -> Vec3:
        """Gains of position, velocity and rate for a measured velocity."""
        pv, vv, vw = self.pv, self.vv, self.vw
        innovation_m2ps2 = vv + sigma_mps * sigma_mps
        k_p, k_v, k_w = pv / innovation_m2ps2, vv / innovation_m2ps2, vw / innovation_m2ps2
        rest = 1.0 - k_v
        self.pp -= k_p * pv
        self.pw -= k_p * vw
        self.ww -= k_w * vw
        self.pv, self.vv, self.vw = pv * rest, vv * rest, vw * rest
        return k_p, k_v, k_w


def grown_sigmas(moments: Moments, elapsed_s: float, manoeuvre_mps: float) -> Vec2:
    """Standard deviations of position [m] and velocity [m/s] after `elapsed_s` without a report."""
    pp, pv, vv = moments
    q_dt = manoeuvre_mps * manoeuvre_mps * elapsed_s
    grown_m2 = pp + elapsed_s * (2.0 * pv + elapsed_s * (vv + q_dt / 3.0))
    return math.sqrt(grown_m2), math.sqrt(vv + q_dt)


class NoiseScale:
    """Standard deviation of the reports of one sender, relative to what it states or to the usual one."""

    __slots__ = ("_averaged", "_east", "_north", "_scale2", "scale")

    def __init__(self) -> None:
        self.scale = self._scale2 = 1.0
        self._averaged = _FIRST_AVERAGED
        self._north = self._east = 0.0

    def observe(self, north: float, east: float, variance: float, noise: float) -> None:
        """Process an innovation with its variance on each axis, of which `noise` is that of the report.

        The rest is the uncertainty of the prediction: where it dominates, small innovations say little.
        """
        north_change, east_change = north - self._north, east - self._east
        self._north, self._east = north, east
        # Each axis of a change has twice the variance of an innovation.
        excess = 0.25 * (north_change * north_change + east_change * east_change) / variance - 1.0
        if excess < 0.0:
            scale2 = self._scale2 * (1.0 + excess * noise / (variance * self._averaged))
            self._scale2 = scale2 if scale2 > _MIN_SCALE2 else _MIN_SCALE2
        else:
            if excess > _MAX_INNOVATION2:
                excess = _MAX_INNOVATION2
            scale2 = self._scale2 * (1.0 + excess / self._averaged)
            self._scale2 = scale2 if scale2 < _MAX_SCALE2 else _MAX_SCALE2
        self.scale = math.sqrt(self._scale2)
        if self._averaged < _AVERAGED_REPORTS:
            self._averaged += 1
