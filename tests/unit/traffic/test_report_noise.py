"""The noise of a sender is found from the changes of the innovations, within bounds."""

import numpy as np
import pytest

from companion.traffic.motion_models import NoiseScale


@pytest.mark.parametrize("sigma", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("bias", [0.0, 10.0])
def test_the_scale_is_that_of_the_noise_and_not_of_what_persists(sigma: float, bias: float) -> None:
    rng, noise, scales = np.random.default_rng(2), NoiseScale(), []
    for _ in range(800):
        north, east = (bias + sigma * rng.normal(0.0, 1.0, 2)).tolist()
        variance = noise.scale**2
        noise.observe(north, east, variance, variance)
        scales.append(noise.scale)
    assert np.mean(scales[60:]) == pytest.approx(sigma, rel=0.1)


def test_the_scale_is_limited() -> None:
    quiet, loud = NoiseScale(), NoiseScale()
    for number in range(200):
        quiet.observe(0.0, 0.0, 1.0, 1.0)
        loud.observe(1e6 * (-1) ** number, 0.0, 1.0, 1.0)
    assert (quiet.scale, loud.scale) == (0.25, 4.0)


def test_one_wrong_report_counts_little() -> None:
    """It changes the innovation twice."""
    noise = NoiseScale()
    for number in range(50):
        noise.observe(1.4 * (-1) ** number, 0.0, 1.0, 1.0)
    before = noise.scale
    noise.observe(1e9, 0.0, 1.0, 1.0)
    noise.observe(0.0, 0.0, 1.0, 1.0)
    assert noise.scale < 1.6 * before


def test_small_innovations_of_an_uncertain_prediction_say_little() -> None:
    uncertain, certain = NoiseScale(), NoiseScale()
    uncertain.observe(0.1, 0.1, 1.0, 0.1)
    certain.observe(0.1, 0.1, 1.0, 1.0)
    assert certain.scale < 0.9 < uncertain.scale < 1.0
