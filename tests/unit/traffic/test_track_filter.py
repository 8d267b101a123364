"""Filters: the covariance, the smoothing of noise, and the error in a turn."""

import math
import random

import numpy as np
import pytest

from companion.model import (
    Vec3,
)
from companion.traffic import Tracker
from companion.traffic.track_filter import Covariance
from tests.unit.traffic.straight_flight import (
    FRAME,
    only,
    report_at,
    straight,
)

STANDARD_RATE_RADPS = math.radians(3.0)


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


def noisy_run(velocity_sigma_mps: float, climb_sigma_mps: float) -> dict[str, float]:
    """RMS errors of the estimate and of the reports, in straight flight."""
    rng = random.Random(7)
    tracker = Tracker()
    squares = dict.fromkeys(("position", "height", "velocity", "climb", "raw velocity", "raw climb"), 0.0)
    count = 0
    for second in range(400):
        truth_m = straight((0.0, 0.0, -500.0), (30.0, -20.0, -1.0), second)
        noise_m = rng.gauss(0, 15), rng.gauss(0, 15), rng.gauss(0, 8)
        velocity_mps = (
            30.0 + rng.gauss(0, velocity_sigma_mps),
            -20.0 + rng.gauss(0, velocity_sigma_mps),
            -1.0 + rng.gauss(0, climb_sigma_mps),
        )
        tracker.receive(report_at(straight(truth_m, noise_m, 1), second, velocity_mps), second)
        if second < 20:
            continue
        track = only(tracker.tracks(second, FRAME))
        count += 1
        squares["position"] += math.dist(track.position_m[:2], truth_m[:2]) ** 2
        squares["height"] += (track.position_m[2] - truth_m[2]) ** 2
        squares["velocity"] += math.dist(track.velocity_mps[:2], (30.0, -20.0)) ** 2
        squares["climb"] += (track.velocity_mps[2] + 1.0) ** 2
        squares["raw velocity"] += math.dist(velocity_mps[:2], (30.0, -20.0)) ** 2
        squares["raw climb"] += (velocity_mps[2] + 1.0) ** 2
    assert not tracker.dropped
    return {name: math.sqrt(square / count) for name, square in squares.items()}


def test_noise_is_smoothed_and_velocities_are_better_than_reported() -> None:
    rms = noisy_run(velocity_sigma_mps=1.5, climb_sigma_mps=0.8)
    assert rms["velocity"] < 0.85 * rms["raw velocity"]
    assert rms["climb"] < 0.75 * rms["raw climb"]
    assert rms["position"] < 9.0  # 21 as reported
    assert rms["height"] < 4.0  # 8 as reported


def test_noisy_positions_hardly_change_a_velocity_that_is_reported_exactly() -> None:
    rms = noisy_run(velocity_sigma_mps=0.0, climb_sigma_mps=0.0)
    assert rms["velocity"] < 0.35
    assert rms["climb"] < 0.1


def turning(time_s: float, speed_mps: float) -> tuple[Vec3, Vec3]:
    """Position and velocity in a level standard-rate turn."""
    radius_m, course_rad = speed_mps / STANDARD_RATE_RADPS, STANDARD_RATE_RADPS * time_s
    north_m, east_m = radius_m * math.sin(course_rad), radius_m * (1.0 - math.cos(course_rad))
    return (north_m, east_m, -400.0), (
        speed_mps * math.cos(course_rad),
        speed_mps * math.sin(course_rad),
        0.0,
    )


@pytest.mark.parametrize(("velocity_known", "bound_m"), [(True, 4.0), (False, 35.0)])
def test_a_turning_intruder_stays_near_its_track(velocity_known: bool, bound_m: float) -> None:
    """60 m/s, 3 deg/s, one report a second; compared ten times a second."""
    tracker = Tracker()
    worst_m = 0.0
    for step in range(1200):
        now_s = step / 10.0
        position_m, velocity_mps = turning(now_s, 60.0)
        if step % 10 == 0:
            assert tracker.receive(
                report_at(position_m, now_s, velocity_mps if velocity_known else None), now_s
            )
        if step >= 50:
            worst_m = max(worst_m, math.dist(only(tracker.tracks(now_s, FRAME)).position_m, position_m))
    assert bound_m / 2 < worst_m < bound_m
