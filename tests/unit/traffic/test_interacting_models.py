"""The interacting models agree with the algorithm of the textbook, written with matrices."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.model import Vec2
from companion.traffic.estimate_params import EstimateParams
from companion.traffic.motion_models import _STRAIGHT_S, _TURN_S, LateralModels

Array = NDArray[np.float64]
PARAMS = EstimateParams()
START = (225.0, 0.0, 2.25)


class Textbook:
    """One cycle of the IMM (Bar-Shalom, Li and Kirubarajan 2001, 11.6.6) with states of three numbers.

    Straight flight has no rate of turn; the turn starts from a rate of 0 with its usual uncertainty.
    """

    def __init__(self) -> None:
        self.share = np.array([_STRAIGHT_S, _TURN_S]) / (_STRAIGHT_S + _TURN_S)
        self.x = [np.zeros(3), np.zeros(3)]
        rate2 = PARAMS.turn_sigma_radps**2
        self.p = [np.diag([START[0], START[2], rate2]), np.diag([START[0], START[2], rate2])]

    def cycle(self, dt_s: float, speed_mps: float, measured: Vec2) -> None:
        changes = 1.0 - math.exp(-dt_s * (1.0 / _STRAIGHT_S + 1.0 / _TURN_S))
        rest = np.array([_STRAIGHT_S, _TURN_S]) / (_STRAIGHT_S + _TURN_S)
        transition = (1.0 - changes) * np.eye(2) + changes * np.tile(rest, (2, 1))
        predicted = transition.T @ self.share
        mixed_x, mixed_p = [], []
        for j in range(2):
            weights = transition[:, j] * self.share / predicted[j]
            x = sum(w * one for w, one in zip(weights, self.x, strict=True))
            spread = [p + np.outer(one - x, one - x) for p, one in zip(self.p, self.x, strict=True)]
            mixed_x.append(x)
            mixed_p.append(sum(w * one for w, one in zip(weights, spread, strict=True)))
        likelihood = [self._filter(j, mixed_x[j], mixed_p[j], dt_s, speed_mps, measured) for j in range(2)]
        self.share = predicted * likelihood / np.dot(predicted, likelihood)

    def _filter(
        self,
        j: int,
        x: np.ndarray,
        p: np.ndarray,
        dt_s: float,
        speed_mps: float,
        measured: Vec2,
    ) -> float:
        turned_mps = speed_mps * dt_s * (j == 1)
        f = np.array([[1.0, dt_s, turned_mps * dt_s / 2.0], [0.0, 1.0, turned_mps], [0.0, 0.0, 1.0]])
        q2, likelihood = PARAMS.crosswise_mps**2, 1.0
        noise = np.diag([q2 * dt_s**3 / 3.0, q2 * dt_s, PARAMS.turn_manoeuvre_radps**2 * dt_s])
        noise[0, 1] = noise[1, 0] = q2 * dt_s**2 / 2.0
        x, p = f @ x, f @ p @ f.T + noise
        for h, z, sigma in zip(np.eye(3), measured, (15.0, 1.5), strict=False):
            s, off = h @ p @ h + sigma**2, z - h @ x
            k = p @ h / s
            x, p = x + k * off, p - np.outer(k, h @ p)
            likelihood *= math.exp(-off * off / s / 2.0) / math.sqrt(s)
        if j == 0:  # no rate, and no knowledge of one
            x[2], p[2, :], p[:, 2] = 0.0, 0.0, 0.0
            p[2, 2] = PARAMS.turn_sigma_radps**2
        self.x[j], self.p[j] = x, p
        return likelihood


def test_the_models_agree_with_the_textbook() -> None:
    """Measurements are relative to a straight line; the models are relative to a path that turns."""
    rng, textbook, models = np.random.default_rng(4), Textbook(), LateralModels(START, PARAMS)
    here_m = here_mps = 0.0
    for step in range(40):
        dt_s, speed_mps, truth_mps = 1.0 + 0.5 * (step % 3), 60.0, 0.3 * max(step - 10, 0)
        measured = here_m + rng.normal(0.0, 15.0), truth_mps + rng.normal(0.0, 1.5)
        textbook.cycle(dt_s, speed_mps, measured)
        turned_mps = models.begin(dt_s, speed_mps) * dt_s * speed_mps
        here_m += dt_s * (here_mps + 0.5 * turned_mps)
        here_mps += turned_mps
        models.update_position(measured[0] - here_m, 15.0)
        models.update_velocity(measured[1] - here_mps, 1.5)
        moved_m, moved_mps = models.end()
        here_m, here_mps = here_m + moved_m, here_mps + moved_mps
        x = sum(share * one for share, one in zip(textbook.share, textbook.x, strict=True))
        assert models.turning == pytest.approx(textbook.share[1], rel=1e-6)
        assert (here_m, here_mps) == pytest.approx((x[0], x[1]), rel=1e-6, abs=1e-6)
        spread = [p + np.outer(one - x, one - x) for p, one in zip(textbook.p, textbook.x, strict=True)]
        p = sum(share * one for share, one in zip(textbook.share, spread, strict=True))
        assert models.moments == pytest.approx((p[0, 0], p[0, 1], p[1, 1]), rel=1e-6)


def test_no_model_is_excluded_for_good() -> None:
    models = LateralModels(START, PARAMS)
    for _ in range(100):
        models.begin(1.0, 60.0)
        models.update_velocity(1000.0, 1.5)
        models.end()
        assert 0.0 < models.turning < 1.0
        assert math.isfinite(models.turn_radps)
        assert abs(models.turn_radps) <= math.radians(20.0)


def test_the_interval_of_the_reports_does_not_matter_without_evidence() -> None:
    often, rarely = LateralModels(START, PARAMS), LateralModels(START, PARAMS)
    often.turning = rarely.turning = 0.9
    for _ in range(10):
        often.begin(0.2, 60.0)
        often.end()
    rarely.begin(2.0, 60.0)
    rarely.end()
    assert often.turning == pytest.approx(rarely.turning, rel=1e-9)
