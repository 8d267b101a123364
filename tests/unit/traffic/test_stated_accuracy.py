"""Accuracies that a sender states: weights of reports, and gates."""

import math

import pytest

from companion.traffic.estimate_params import EstimateParams
from companion.traffic.motion_models import grown_sigmas
from companion.traffic.track_filter import (
    HorizontalFilter,
    HorizontalFix,
    OutlierGate,
    VerticalFilter,
    VerticalFix,
)
from tests.support.tracking_flights import FRAME

PARAMS = EstimateParams()


def fix(
    time_s: float, north_m: float, sigma_m: float | None, sigma_mps: float | None = None
) -> HorizontalFix:
    place = FRAME.to_geo(north_m, 0.0, 0.0)
    return HorizontalFix(time_s, place.lat_deg, place.lon_deg, (20.0, 0.0), sigma_m, sigma_mps)


def followed(sigma_m: float | None, sigma_mps: float | None = None) -> HorizontalFilter:
    here = HorizontalFilter(fix(0.0, 0.0, sigma_m, sigma_mps), PARAMS)
    for second in range(1, 10):
        here.update(fix(second, 20.0 * second, sigma_m, sigma_mps))
    return here


def north_m(here: HorizontalFilter) -> float:
    return FRAME.to_north_east_m(here.lat_deg, here.lon_deg)[0]


def test_accurate_traffic_is_gated_more_tightly_and_inaccurate_traffic_is_not_thrown_away() -> None:
    """The reach of the hardest manoeuvre and of a late time stamp, 35 m here, is always allowed."""
    assert not followed(3.0).is_outlier(fix(10.0, 230.0, 3.0))
    assert followed(3.0).is_outlier(fix(10.0, 280.0, 3.0))
    assert not followed(None).is_outlier(fix(10.0, 280.0, None))
    assert followed(None).is_outlier(fix(10.0, 400.0, None))
    assert not followed(80.0).is_outlier(fix(10.0, 400.0, 80.0))
    assert followed(80.0).is_outlier(fix(10.0, 1000.0, 80.0))


def test_a_velocity_is_gated_by_what_is_stated() -> None:
    faster = fix(10.0, 200.0, 3.0)._replace(velocity_mps=(56.0, 0.0))
    assert followed(3.0, 0.3).is_outlier(faster._replace(velocity_sigma_mps=0.3))
    assert not followed(3.0, 4.0).is_outlier(faster._replace(velocity_sigma_mps=4.0))


def test_inaccurate_reports_move_the_estimate_less() -> None:
    moved_m = []
    for sigma_m in (3.0, None, 80.0):
        here = followed(sigma_m)
        aside = FRAME.to_geo(200.0, 20.0, 0.0)
        here.update(HorizontalFix(10.0, aside.lat_deg, aside.lon_deg, None, sigma_m))
        moved_m.append(FRAME.to_north_east_m(here.lat_deg, here.lon_deg)[1])
    assert moved_m == sorted(moved_m, reverse=True)
    assert moved_m[0] > 2.0 * moved_m[2]


@pytest.mark.parametrize("sigma_m", [1e-9, 1e9, math.inf])
def test_stated_accuracies_are_bounded(sigma_m: float) -> None:
    here = followed(sigma_m, sigma_m)
    assert north_m(here) == pytest.approx(180.0, abs=0.1)
    assert here.is_outlier(fix(10.0, 1e5, sigma_m))
    vertical = VerticalFilter(VerticalFix(0.0, 300.0, 0.0, sigma_m), PARAMS)
    vertical.update(VerticalFix(1.0, 301.0, 0.0, sigma_m))
    assert 300.0 < vertical.altitude_m < 301.0


def test_the_accuracy_follows_from_what_was_heard_and_degrades_without_reports() -> None:
    def after(age_s: float, sigma_m: float) -> float:
        return grown_sigmas(followed(sigma_m).moments, age_s, PARAMS.manoeuvre_mps)[0]

    assert 1.0 < after(0.0, 3.0) < 3.0
    assert 15.0 < after(0.0, 80.0) < 80.0
    assert after(0.0, 3.0) < after(5.0, 3.0) < after(20.0, 3.0)
    assert after(20.0, 3.0) > 50.0


def test_altitudes_are_gated_by_what_is_stated() -> None:
    def gate(sigma_m: float | None) -> OutlierGate[VerticalFilter, VerticalFix]:
        gate: OutlierGate[VerticalFilter, VerticalFix]
        gate = OutlierGate(VerticalFilter(VerticalFix(0.0, 300.0, 0.0, sigma_m), PARAMS))
        for second in range(1, 10):
            assert gate.receive(VerticalFix(second, 300.0, 0.0, sigma_m))
        return gate

    assert not gate(2.0).receive(VerticalFix(10.0, 330.0, 0.0, 2.0))
    assert gate(None).receive(VerticalFix(10.0, 330.0, 0.0, None))
    assert not gate(None).receive(VerticalFix(10.0, 400.0, 0.0, None))
    assert gate(40.0).receive(VerticalFix(10.0, 400.0, 0.0, 40.0))
