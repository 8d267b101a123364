"""Covariances agree with the matrices of the textbook."""

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.traffic.motion_models import Covariance, TurnCovariance, grown_sigmas


def test_the_covariance_agrees_with_the_textbook() -> None:
    covariance = Covariance(30.0, 12.0)
    p = np.diag([30.0**2, 12.0**2])
    for dt_s, q, position_sigma_m, velocity_sigma_mps in [(1.0, 2.0, 15.0, 1.5), (0.4, 0.5, 8.0, 0.8)] * 3:
        covariance.predict(dt_s, q)
        f = np.array([[1.0, dt_s], [0.0, 1.0]])
        noise = q**2 * np.array([[dt_s**3 / 3, dt_s**2 / 2], [dt_s**2 / 2, dt_s]])
        p = f @ p @ f.T + noise
        for gains, h, sigma in (
            (covariance.update_position(position_sigma_m), np.array([1.0, 0.0]), position_sigma_m),
            (covariance.update_velocity(velocity_sigma_mps), np.array([0.0, 1.0]), velocity_sigma_mps),
        ):
            k = p @ h / (h @ p @ h + sigma**2)
            p = (np.eye(2) - np.outer(k, h)) @ p
            assert gains == pytest.approx(k, rel=1e-9)
        assert (covariance.pp, covariance.pv, covariance.vv) == pytest.approx(
            (p[0, 0], p[0, 1], p[1, 1]), rel=1e-9
        )


def test_the_covariance_of_a_turn_agrees_with_the_textbook() -> None:
    covariance, p = TurnCovariance((900.0, 10.0, 144.0), 0.05), np.diag([900.0, 144.0, 0.05**2])
    p[0, 1] = p[1, 0] = 10.0
    for dt_s, speed_mps in [(1.0, 60.0), (0.4, 30.0)] * 3:
        covariance.predict(dt_s, speed_mps, 0.5, 0.02)
        f = np.array([[1.0, dt_s, speed_mps * dt_s**2 / 2], [0.0, 1.0, speed_mps * dt_s], [0.0, 0.0, 1.0]])
        noise = np.diag([0.5**2 * dt_s**3 / 3, 0.5**2 * dt_s, 0.02**2 * dt_s])
        noise[0, 1] = noise[1, 0] = 0.5**2 * dt_s**2 / 2
        p = f @ p @ f.T + noise
        assert matrix(covariance) == pytest.approx(p, rel=1e-9)
        for gains, h, sigma in (
            (covariance.update_position(15.0), np.array([1.0, 0.0, 0.0]), 15.0),
            (covariance.update_velocity(1.5), np.array([0.0, 1.0, 0.0]), 1.5),
        ):
            k = p @ h / (h @ p @ h + sigma**2)
            p = (np.eye(3) - np.outer(k, h)) @ p
            assert gains == pytest.approx(k, rel=1e-9)
        assert matrix(covariance) == pytest.approx(p, rel=1e-9)


def matrix(of: TurnCovariance) -> NDArray[np.float64]:
    return np.array([[of.pp, of.pv, of.pw], [of.pv, of.vv, of.vw], [of.pw, of.vw, of.ww]])


def test_the_sigmas_grow_without_reports() -> None:
    covariance = Covariance(9.0, 1.5)
    moments = covariance.pp, covariance.pv, covariance.vv
    assert grown_sigmas(moments, 0.0, 2.0) == (9.0, 1.5)
    covariance.predict(7.0, 2.0)
    assert grown_sigmas(moments, 7.0, 2.0) == pytest.approx((covariance.pp**0.5, covariance.vv**0.5))
