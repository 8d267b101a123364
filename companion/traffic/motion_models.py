"""Models of motion along and across the path, their covariances, and the noise of reports, in plain numbers.

Source of the equations: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and
Navigation" (2001), chapter 5 (Kalman filter), 6.2.2 (process noise) and 11.6.6 (mixing).

Across the path, straight flight and turn run side by side as interacting multiple models (IMM), and each
report shows which of them is right: Blom and Bar-Shalom, "The interacting multiple model algorithm for
systems with Markovian switching coefficients", IEEE Transactions on Automatic Control 33 (1988); 11.6.6 (the
algorithm) and 11.7 (straight flight and turn) there. Straight flight is nearly constant velocity (6.3.2). The
turn estimates its rate (11.7.2), linearized about the estimated path.
"""

import math
from typing import Final

from companion.model import Vec2, Vec3
from companion.traffic.estimate_params import EstimateParams

# Variance of a position [m2], its covariance with the velocity [m2/s], and variance of the velocity [m2/s2].
Moments = Vec3
# The noise is estimated from the innovations, averaged over about this many reports (Mehra, "Approaches to
# adaptive filtering", IEEE Transactions on Automatic Control 17, 1972), and limited to these multiples of its
# sigma: senders state it rarely, as a class, or too well. Only the change from one innovation to the next is
# noise: what persists is a turn, or a velocity that the positions contradict, and must be followed.
_AVERAGED_REPORTS: Final = 20
_FIRST_AVERAGED: Final = 3
_MIN_SCALE2, _MAX_SCALE2 = 0.25**2, 4.0**2
_MOST_SENDERS: Final = 8
# A larger squared innovation, in units of its variance, is not noise: a turn began, or the report is wrong.
_MAX_INNOVATION2: Final = 10.0
# Mean time until straight flight ends, and until a turn ends [s]: a Markov chain in continuous time, so that
# the interval of the reports does not matter.
_STRAIGHT_S, _TURN_S = 100.0, 30.0
_CHANGES_PER_S: Final = 1.0 / _STRAIGHT_S + 1.0 / _TURN_S
_TURN_SHARE: Final = _TURN_S / (_STRAIGHT_S + _TURN_S)
# Neither model is excluded for good.
_LEAST_PROBABILITY: Final = 1e-4
_MAX_LOG_RATIO: Final = 50.0
# Aircraft in forward flight turn no faster; one that pivots on the spot stays where it is.
_MAX_RADPS: Final = math.radians(20.0)
# An aircraft turns if it turns to that side with this probability.
_LIKELY: Final = 0.6
_SQRT_2: Final = math.sqrt(2.0)


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

    __slots__ = ("_averaged", "_scale2", "scale")

    def __init__(self) -> None:
        self.scale = self._scale2 = 1.0
        self._averaged = _FIRST_AVERAGED

    def observe(self, change2: float, variance: float, noise: float) -> None:
        """Process a squared innovation with its variance, of which `noise` is that of the report.

        The rest is the uncertainty of the prediction: where it dominates, small innovations say little.
        """
        excess = change2 / variance - 1.0
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


class Noises:
    """The noise of each sender's reports. What the innovations of all have in common is not noise."""

    __slots__ = ("_by_sender", "_east", "_kept_share", "_north", "_variance_share")

    def __init__(self) -> None:
        self._by_sender: dict[str, NoiseScale] = {}
        self._north = self._east = 0.0
        self._kept_share, self._variance_share = 0.0, 0.25

    def scale(self, sender: str) -> float:
        """The noise of a sender, relative to what it states."""
        known = self._by_sender.get(sender)
        return 1.0 if known is None else known.scale

    def observe(self, sender: str, north: float, east: float, variance: float, noise: float) -> None:
        """Process an innovation with its variance on each axis, of which `noise` is that of the report."""
        known = self._by_sender.get(sender)
        if known is None:
            if len(self._by_sender) >= _MOST_SENDERS:
                self._by_sender.clear()
            known = self._by_sender[sender] = NoiseScale()
            senders = len(self._by_sender)
            self._kept_share = 1.0 - 1.0 / senders
            # Of one sender, each axis of a change has twice the variance of an innovation.
            self._variance_share = (2 * senders - 1) / (4 * senders)
        north_change, east_change = north - self._north, east - self._east
        self._north = north - self._kept_share * north_change
        self._east = east - self._kept_share * east_change
        change2 = self._variance_share * (north_change * north_change + east_change * east_change)
        known.observe(change2, variance, noise)


class LateralModels:
    """Position [m] and velocity [m/s] across the path, positive to the right, and the rate of turn [rad/s].

    A step is `begin`, the updates, and `end`. Positions and velocities are relative to the path that the
    owner carries along, which turns at the rate that `begin` returns, and which `end` corrects.
    """

    __slots__ = (
        "_log_ratio",
        "_params",
        "_predicted_turning",
        "_rate_radps",
        "_straight_m",
        "_straight_mps",
        "_turn_m",
        "_turn_mps",
        "_variance_ratio",
        "straight",
        "turn",
        "turning",
    )

    def __init__(self, moments: Moments, params: EstimateParams) -> None:
        self._params = params
        self._log_ratio, self._variance_ratio = 0.0, 1.0
        self.straight = Covariance(0.0, 0.0)
        self.restart(moments)

    def restart(self, moments: Moments) -> None:
        """Forget whether it turns."""
        self._straight_m = self._straight_mps = self._turn_m = self._turn_mps = 0.0
        self._rate_radps = 0.0
        self._predicted_turning = self.turning = _TURN_SHARE  # probability of the turn
        self.straight.pp, self.straight.pv, self.straight.vv = moments
        self.turn = TurnCovariance(moments, self._params.turn_sigma_radps)

    @property
    def turn_radps(self) -> float:
        """The rate of turn; exactly 0 unless the aircraft probably turns to that side."""
        turning, rate_radps = self.turning, self._rate_radps
        if turning < _LIKELY:
            return 0.0
        to_that_side = 1.0 + math.erf(abs(rate_radps) / (_SQRT_2 * math.sqrt(self.turn.ww)))
        return turning * rate_radps if 0.5 * turning * to_that_side > _LIKELY else 0.0

    @property
    def moments(self) -> Moments:
        """The combined covariance of position and velocity."""
        straight, turn, share = self.straight, self.turn, self.turning
        apart_m, apart_mps = self._turn_m - self._straight_m, self._turn_mps - self._straight_mps
        spread = share * (1.0 - share)
        return (
            straight.pp + share * (turn.pp - straight.pp) + spread * apart_m * apart_m,
            straight.pv + share * (turn.pv - straight.pv) + spread * apart_m * apart_mps,
            straight.vv + share * (turn.vv - straight.vv) + spread * apart_mps * apart_mps,
        )

    def begin(self, dt_s: float, speed_mps: float) -> float:
        """Mix the models and predict them; returns the rate at which the path turns until the report."""
        changed, params = -math.expm1(-_CHANGES_PER_S * dt_s), self._params
        turning, straight, turn = self.turning, self.straight, self.turn
        enters = changed * _TURN_SHARE * (1.0 - turning)
        leaves = changed * (1.0 - _TURN_SHARE) * turning
        self._predicted_turning = turning = turning + enters - leaves
        from_straight, from_turn = enters / turning, leaves / (1.0 - turning)
        before = straight.pp, straight.pv, straight.vv
        apart_m, apart_mps = self._turn_m - self._straight_m, self._turn_mps - self._straight_mps
        straight.mix(from_turn, (turn.pp, turn.pv, turn.vv), apart_m, apart_mps)
        turn_sigma_radps = params.turn_sigma_radps
        turn.mix(
            from_straight, before, apart_m, apart_mps, self._rate_radps, turn_sigma_radps * turn_sigma_radps
        )
        straight.predict(dt_s, params.crosswise_mps)
        turn.predict(dt_s, speed_mps, params.crosswise_mps, params.turn_manoeuvre_radps)

        self._rate_radps = rate_radps = self._rate_radps * (1.0 - from_straight)
        path_radps = turning * rate_radps
        straight_mps = self._straight_mps + from_turn * apart_mps
        turn_mps = self._turn_mps - from_straight * apart_mps
        turned_m, half_s = speed_mps * dt_s, 0.5 * dt_s
        self._straight_mps = straight_mps - turned_m * path_radps
        self._turn_mps = turn_mps + turned_m * (rate_radps - path_radps)
        self._straight_m += from_turn * apart_m + half_s * (straight_mps + self._straight_mps)
        self._turn_m += half_s * (turn_mps + self._turn_mps) - from_straight * apart_m
        self._log_ratio, self._variance_ratio = 0.0, 1.0
        return path_radps

    def update_position(self, measured_m: float, sigma_m: float) -> float:
        """Process a position; returns the variance of its innovation in straight flight."""
        straight, turn, noise_m2 = self.straight, self.turn, sigma_m * sigma_m
        straight_m2, turn_m2 = straight.pp + noise_m2, turn.pp + noise_m2
        off_straight_m, off_turn_m = measured_m - self._straight_m, measured_m - self._turn_m
        k_p, k_v = straight.update_position(sigma_m)
        self._straight_m += k_p * off_straight_m
        self._straight_mps += k_v * off_straight_m
        k_p, k_v, k_w = turn.update_position(sigma_m)
        self._turn_m += k_p * off_turn_m
        self._turn_mps += k_v * off_turn_m
        self._rate_radps += k_w * off_turn_m
        self._log_ratio += off_straight_m * off_straight_m / straight_m2 - off_turn_m * off_turn_m / turn_m2
        self._variance_ratio *= straight_m2 / turn_m2
        return straight_m2

    def update_velocity(self, measured_mps: float, sigma_mps: float) -> float:
        """The same for a velocity."""
        straight, turn, noise = self.straight, self.turn, sigma_mps * sigma_mps
        straight_var, turn_var = straight.vv + noise, turn.vv + noise
        off_straight_mps, off_turn_mps = measured_mps - self._straight_mps, measured_mps - self._turn_mps
        k_p, k_v = straight.update_velocity(sigma_mps)
        self._straight_m += k_p * off_straight_mps
        self._straight_mps += k_v * off_straight_mps
        k_p, k_v, k_w = turn.update_velocity(sigma_mps)
        self._turn_m += k_p * off_turn_mps
        self._turn_mps += k_v * off_turn_mps
        self._rate_radps += k_w * off_turn_mps
        self._log_ratio += off_straight_mps * off_straight_mps / straight_var
        self._log_ratio -= off_turn_mps * off_turn_mps / turn_var
        self._variance_ratio *= straight_var / turn_var
        return straight_var

    def end(self) -> Vec2:
        """Weigh the models; returns the corrections of position and velocity across the path."""
        log_ratio = 0.5 * self._log_ratio
        if not -_MAX_LOG_RATIO < log_ratio < _MAX_LOG_RATIO:
            log_ratio = math.copysign(_MAX_LOG_RATIO, log_ratio)
        share = self._predicted_turning * math.sqrt(self._variance_ratio) * math.exp(log_ratio)
        turning = share / (1.0 - self._predicted_turning + share)
        if not _LEAST_PROBABILITY < turning < 1.0 - _LEAST_PROBABILITY:
            turning = _LEAST_PROBABILITY if turning < 0.5 else 1.0 - _LEAST_PROBABILITY
        self.turning = turning
        apart_m, apart_mps = self._turn_m - self._straight_m, self._turn_mps - self._straight_mps
        moved_m, moved_mps = self._straight_m + turning * apart_m, self._straight_mps + turning * apart_mps
        self._straight_m, self._straight_mps = -turning * apart_m, -turning * apart_mps
        self._turn_m, self._turn_mps = (1.0 - turning) * apart_m, (1.0 - turning) * apart_mps
        if not -_MAX_RADPS < self._rate_radps < _MAX_RADPS:
            self._rate_radps = math.copysign(_MAX_RADPS, self._rate_radps)
        return moved_m, moved_mps


class AlongPath(Covariance):
    """Position [m] and velocity [m/s] along the path, relative to one that the owner carries along.

    A step is `predict`, the updates, and `end`.
    """

    __slots__ = ("_moved_m", "_moved_mps")

    def __init__(self, moments: Moments) -> None:
        self.pp, self.pv, self.vv = moments
        self._moved_m = self._moved_mps = 0.0

    def measure_position(self, measured_m: float, sigma_m: float) -> float:
        """Process a position; returns the variance of its innovation."""
        off_m, variance_m2 = measured_m - self._moved_m, self.pp + sigma_m * sigma_m
        k_p, k_v = self.update_position(sigma_m)
        self._moved_m += k_p * off_m
        self._moved_mps += k_v * off_m
        return variance_m2

    def measure_velocity(self, measured_mps: float, sigma_mps: float) -> float:
        """The same for a velocity."""
        off_mps, variance = measured_mps - self._moved_mps, self.vv + sigma_mps * sigma_mps
        k_p, k_v = self.update_velocity(sigma_mps)
        self._moved_m += k_p * off_mps
        self._moved_mps += k_v * off_mps
        return variance

    def end(self) -> Vec2:
        """The corrections of position and velocity, from which the next step starts."""
        moved = self._moved_m, self._moved_mps
        self._moved_m = self._moved_mps = 0.0
        return moved
