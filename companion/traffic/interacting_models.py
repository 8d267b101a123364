"""Motion along the path, and across it: interacting multiple models (IMM) of straight flight and turn.

Both models run side by side, and each report shows which of them is right: Blom and Bar-Shalom, "The
interacting multiple model algorithm for systems with Markovian switching coefficients", IEEE Transactions on
Automatic Control 33 (1988); Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and
Navigation" (2001), 11.6.6 (the algorithm) and 11.7 (straight flight and turn). Straight flight is nearly
constant velocity (6.3.2 there). The turn estimates its rate (11.7.2), linearized about the estimated path.
"""

import math
from typing import Final

from companion.model import Vec2
from companion.traffic.covariance import Covariance, Moments, TurnCovariance
from companion.traffic.estimate_params import EstimateParams

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
