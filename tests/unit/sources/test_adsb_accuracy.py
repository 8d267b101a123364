"""Accuracy and integrity as DO-260B encodes them, over its versions."""

import pytest

from companion.sources.adsb_accuracy import StatedAccuracy
from companion.units import KNOT_MPS

MILE_M = 3600.0 * KNOT_MPS


@pytest.mark.parametrize(
    ("version", "type_code", "nic_a", "nic_b", "nic_c", "nic"),
    [
        (2, 9, 0, 0, 0, 11),
        (2, 10, 0, 0, 0, 10),
        (2, 11, 1, 1, 0, 9),
        (2, 11, 0, 0, 0, 8),
        (2, 11, 1, 0, 0, 8),
        (2, 12, 0, 0, 0, 7),
        (2, 13, 1, 1, 0, 6),
        (2, 16, 1, 1, 0, 3),
        (2, 16, 0, 1, 0, 2),
        (2, 17, 0, 0, 0, 1),
        (2, 18, 0, 0, 0, None),
        (2, 20, 0, 0, 0, 11),
        (2, 22, 0, 0, 0, None),
        (2, 7, 1, 0, 0, 9),
        (2, 7, 0, 0, 0, 8),
        (2, 8, 1, 0, 1, 7),
        (2, 8, 1, 0, 0, 6),
        (2, 8, 0, 0, 1, 6),
        (2, 8, 0, 1, 0, None),
        (1, 11, 1, 0, 0, 9),
        (1, 11, 0, 1, 0, 8),
        (1, 16, 1, 0, 0, 3),
        (0, 11, 1, 1, 0, 8),
        (0, 16, 1, 1, 0, 2),
        (7, 11, 1, 1, 0, 9),
        (2, 0, 0, 0, 0, None),
    ],
)
def test_nic(version: int, type_code: int, nic_a: int, nic_b: int, nic_c: int, nic: int | None) -> None:
    stated = StatedAccuracy(version, type_code, nic_a, nic_b, nic_c)
    assert stated.nic == nic


def test_accuracy_without_a_status_is_that_of_the_type() -> None:
    stated = StatedAccuracy()
    assert (stated.position_sigma_m(0.0), stated.containment_m(), stated.integrity(0.0)) == (None, None, None)
    stated.take_type(13, 0)
    assert stated.position_sigma_m(0.0) == pytest.approx(0.3 * MILE_M / 2.448)
    stated.take_status(0.0, 9, 3)
    assert stated.position_sigma_m(30.0) == pytest.approx(30.0 / 2.448)
    assert stated.altitude_sigma_m(30.0) == pytest.approx(45.0 / 1.960)
    assert stated.integrity(30.0) == 3
    assert stated.position_sigma_m(31.0) == pytest.approx(0.3 * MILE_M / 2.448)
    assert stated.integrity(31.0) is None


def test_a_lost_accuracy_is_unknown_whatever_the_type_says() -> None:
    stated = StatedAccuracy(version=2, type_code=11)
    stated.take_status(0.0, 0, 0)
    assert stated.position_sigma_m(1.0) is None


def test_the_accuracy_of_a_velocity_is_as_old_as_it() -> None:
    stated = StatedAccuracy()
    stated.take_velocity(0.0, 2)
    assert stated.velocity_sigma_mps(30.0) == pytest.approx(3.0 / 2.448)
    assert stated.velocity_sigma_mps(31.0) is None
