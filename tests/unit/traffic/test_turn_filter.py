"""Rate of turn from reported courses: found soon in a turn, zero in noisy straight flight."""

import math

import numpy as np
import pytest

from companion.traffic.track_filter import EstimateParams, TurnFilter

STANDARD_RADPS = math.radians(3.0)


def velocity(speed_mps: float, course_rad: float) -> tuple[float, float]:
    return speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)


def report_turn(
    estimate: TurnFilter, seconds: int, *, speed_mps: float, rate_radps: float, sigma_mps: float
) -> None:
    rng = np.random.default_rng(seconds)
    for second in range(seconds):
        north_mps, east_mps = velocity(speed_mps, rate_radps * second)
        off_mps = rng.normal(0.0, sigma_mps, 2) if sigma_mps else (0.0, 0.0)
        estimate.receive(float(second), (north_mps + off_mps[0], east_mps + off_mps[1]))


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("speed_mps", [40.0, 60.0, 120.0])
def test_a_standard_rate_turn_is_found_within_seconds(speed_mps: float, side: float) -> None:
    estimate = TurnFilter(EstimateParams())
    report_turn(estimate, 12, speed_mps=speed_mps, rate_radps=side * STANDARD_RADPS, sigma_mps=0.0)
    assert estimate.rate_radps == pytest.approx(side * STANDARD_RADPS, rel=0.1)


def test_a_turn_through_north_is_found_too() -> None:
    estimate = TurnFilter(EstimateParams())
    for second in range(15):
        estimate.receive(float(second), velocity(60.0, math.radians(340.0) + second * STANDARD_RADPS))
    assert estimate.rate_radps == pytest.approx(STANDARD_RADPS, rel=0.1)


def test_noise_does_not_count_as_a_turn() -> None:
    """Half an hour of straight flight with the noise that the filter assumes."""
    params, rng = EstimateParams(), np.random.default_rng(5)
    estimate, rates_radps = TurnFilter(params), []
    for second in range(1800):
        north_mps, east_mps = np.array([60.0, 0.0]) + rng.normal(0.0, params.velocity_sigma_mps, 2)
        estimate.receive(float(second), (north_mps, east_mps))
        rates_radps.append(abs(estimate.rate_radps))
    assert np.mean(np.array(rates_radps) < math.radians(0.5)) > 0.9
    assert max(rates_radps) < STANDARD_RADPS


def test_the_rate_is_zero_after_a_turn_ends() -> None:
    estimate = TurnFilter(EstimateParams())
    for second in range(40):
        estimate.receive(float(second), velocity(60.0, STANDARD_RADPS * min(second, 20)))
    assert estimate.rate_radps == 0.0


def test_a_hovering_target_has_no_rate_of_turn() -> None:
    estimate = TurnFilter(EstimateParams())
    report_turn(estimate, 20, speed_mps=2.0, rate_radps=math.radians(15.0), sigma_mps=0.0)
    assert estimate.rate_radps == 0.0


def test_the_filter_starts_again_after_a_gap() -> None:
    estimate = TurnFilter(EstimateParams())
    report_turn(estimate, 12, speed_mps=60.0, rate_radps=STANDARD_RADPS, sigma_mps=0.0)
    estimate.receive(30.0, velocity(60.0, 2.0))
    assert estimate.rate_radps == 0.0


def test_reports_without_a_velocity_are_ignored() -> None:
    estimate = TurnFilter(EstimateParams())
    report_turn(estimate, 12, speed_mps=60.0, rate_radps=STANDARD_RADPS, sigma_mps=0.0)
    before_radps = estimate.rate_radps
    estimate.receive(12.0, None)
    assert estimate.rate_radps == before_radps


@pytest.mark.parametrize("sigma_mps", [0.3, 1.5, 4.0])
def test_a_noisy_sender_does_not_seem_to_turn(sigma_mps: float) -> None:
    rng = np.random.default_rng(7)
    estimate, rates_radps = TurnFilter(EstimateParams()), []
    for second in range(400):
        north_mps, east_mps = np.array([60.0, 0.0]) + rng.normal(0.0, sigma_mps, 2)
        estimate.receive(float(second), (north_mps, east_mps))
        rates_radps.append(abs(estimate.rate_radps))
    assert np.mean(np.array(rates_radps[100:]) < math.radians(1.0)) > 0.9
