"""The filter is about as accurate as it says, on straight and turning flights: NEES and NIS are near 1."""

import numpy as np
import pytest

from sim.evidence.statistics import chi2_interval, percentile
from tests.support.tracking_measures import measure
from tests.tools.tracking import REPORTING, flights_of

_FLIGHTS = 16


@pytest.mark.parametrize("reporting", ["adsb-out", "poor", "poor, stated", "GPS, stated", "five a second"])
@pytest.mark.parametrize("kind", ["straight", "3"])
def test_errors_are_those_that_the_covariance_states(kind: str, reporting: str) -> None:
    """Twice the 95 % interval: noise that is not stated has to be found first."""
    errors = measure(flights_of(kind, _FLIGHTS), REPORTING[reporting])
    for squares, freedom in ((errors.nees, 4), (errors.nis, 2)):
        low, high = chi2_interval(freedom, _FLIGHTS)
        assert 1.0 - 2.0 * (1.0 - low) < np.mean(squares) < 1.0 + 2.0 * (high - 1.0)
    assert errors.rejected <= len(errors.nees) // 200


def test_exact_reports_are_better_than_stated() -> None:
    errors = measure(flights_of("3", _FLIGHTS), REPORTING["exact"])
    assert np.mean(errors.nees) < 0.1


def test_a_straight_flyer_hardly_ever_turns() -> None:
    for reporting in REPORTING:
        errors = measure(flights_of("straight", _FLIGHTS), REPORTING[reporting])
        assert np.mean(np.array(errors.false_radps) == 0.0) > 0.97


@pytest.mark.parametrize(("reporting", "within_s"), [("exact", 2.5), ("adsb-out", 3.5), ("poor", 8.0)])
def test_a_standard_turn_is_found_in_seconds(reporting: str, within_s: float) -> None:
    errors = measure(flights_of("3", _FLIGHTS), REPORTING[reporting])
    assert percentile(errors.begins_s, 0.5) < within_s
    assert percentile(errors.ends_s, 0.5) < within_s


def test_the_interval_is_that_of_chi_square() -> None:
    assert chi2_interval(4, 25) == pytest.approx((74.22 / 100.0, 129.56 / 100.0), rel=1e-3)
