"""Consistency of the tracks against the truth."""

import numpy as np
import pytest

from sim.encounters import generate
from sim.evidence.consistency import SUMS, consistency_of, follow
from sim.evidence.statistics import chi2_interval


def test_exact_reports_give_errors_far_below_the_claimed_ones() -> None:
    found = consistency_of([follow(generate("level", 3, n), "perfect", n, 3) for n in range(3)])
    assert found["encounters"] == 3
    assert found["position_m"] < 1.0  # type: ignore[operator]
    assert found["position_nees"] < 0.05  # type: ignore[operator]
    assert found["interval"] == [round(edge, 3) for edge in chi2_interval(2, 3)]


def test_an_unreported_latency_counts_only_against_the_present_truth() -> None:
    preset = "adsb-out,latency_s=3,loss=0"
    line = follow(generate("level", 3, 1, hits=True), preset, 1, 3)
    assert line["position_nees"] > 5.0 * line["shifted_position_nees"]
    assert follow(generate("level", 3, 1), preset, 1, 3) == follow(generate("level", 3, 1), preset, 1, 3)


def test_the_mean_is_over_encounters_and_those_never_heard_do_not_count() -> None:
    base = dict.fromkeys(SUMS, 0.0)
    lines = [
        base | {"count": 10.0, "position_nees": 10.0, "height_m2": 40.0},
        base | {"count": 30.0, "position_nees": 90.0},
        base,
    ]
    found = consistency_of(lines)
    assert (found["encounters"], found["decisions"], found["position_nees"]) == (2, 40, 2.0)
    assert found["height_m"] == 1.0
    assert consistency_of([base]) == {"encounters": 0}


def test_an_aircraft_out_of_range_is_not_followed() -> None:
    line = follow(generate("level", 3, 1), "adsb-out,first_heard_m=1", 1, 3)
    assert line["count"] == 0.0
    assert np.isfinite([line[name] for name in SUMS]).all()


def test_the_interval_of_the_mean_narrows_around_one() -> None:
    """Chi-square quantiles: 50 degrees 32.36 to 71.42, 200 degrees 162.7 to 241.1."""
    assert chi2_interval(2, 25) == pytest.approx((32.36 / 50.0, 71.42 / 50.0), rel=2e-3)
    assert chi2_interval(2, 100) == pytest.approx((162.7 / 200.0, 241.1 / 200.0), rel=2e-3)
