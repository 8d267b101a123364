"""The noise of a sender is found from the changes of the innovations, within bounds."""

import numpy as np
import pytest

from companion.traffic.motion_models import Noises


@pytest.mark.parametrize("sigma", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("bias", [0.0, 10.0])
def test_the_scale_is_that_of_the_noise_and_not_of_what_persists(sigma: float, bias: float) -> None:
    rng, noise, scales = np.random.default_rng(2), Noises(), []
    for _ in range(800):
        north, east = (bias + sigma * rng.normal(0.0, 1.0, 2)).tolist()
        variance = noise.scale("") ** 2
        noise.observe("", north, east, variance, variance)
        scales.append(noise.scale(""))
    assert np.mean(scales[60:]) == pytest.approx(sigma, rel=0.1)


def test_the_scale_is_limited() -> None:
    quiet, loud = Noises(), Noises()
    for number in range(200):
        quiet.observe("", 0.0, 0.0, 1.0, 1.0)
        loud.observe("", 1e6 * (-1) ** number, 0.0, 1.0, 1.0)
    assert (quiet.scale(""), loud.scale("")) == (0.25, 4.0)


def test_one_wrong_report_counts_little() -> None:
    """It changes the innovation twice."""
    noise = Noises()
    for number in range(50):
        noise.observe("", 1.4 * (-1) ** number, 0.0, 1.0, 1.0)
    before = noise.scale("")
    noise.observe("", 1e9, 0.0, 1.0, 1.0)
    noise.observe("", 0.0, 0.0, 1.0, 1.0)
    assert noise.scale("") < 1.6 * before


def test_small_innovations_of_an_uncertain_prediction_say_little() -> None:
    uncertain, certain = Noises(), Noises()
    uncertain.observe("", 0.1, 0.1, 1.0, 0.1)
    certain.observe("", 0.1, 0.1, 1.0, 1.0)
    assert certain.scale("") < 0.9 < uncertain.scale("") < 1.0


def test_each_sender_has_a_noise_of_its_own() -> None:
    rng, noise = np.random.default_rng(5), Noises()
    for _ in range(200):
        for sender, sigma in (("good", 0.5), ("bad", 2.0)):
            north, east = rng.normal(0.0, sigma, 2).tolist()
            noise.observe(sender, north, east, noise.scale(sender) ** 2, noise.scale(sender) ** 2)
    assert noise.scale("bad") > 1.5 * noise.scale("good")


def test_the_senders_that_are_remembered_are_bounded() -> None:
    noise = Noises()
    for number in range(100):
        noise.observe(str(number), 9.0, 9.0, 1.0, 1.0)
    assert noise.scale("0") == 1.0 != noise.scale("99")
