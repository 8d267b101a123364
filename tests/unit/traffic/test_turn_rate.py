"""Rate of turn: found soon in a turn, exactly zero in noisy straight flight."""

import cmath
import math
from collections.abc import Callable

import numpy as np
import pytest

from companion.traffic.estimate_params import EstimateParams
from companion.traffic.track_filter import HorizontalFilter, HorizontalFix
from tests.support.tracking_flights import FRAME

STANDARD_RADPS = math.radians(3.0)
PARAMS = EstimateParams()


def fly(
    seconds: int,
    rate_radps: Callable[[float], float],
    *,
    speed_mps: float = 60.0,
    course_rad: float = 0.0,
    position_sigma_m: float = 0.0,
    velocity_sigma_mps: float = 0.0,
    with_velocity: bool = True,
    seed: int = 5,
) -> tuple[HorizontalFilter, list[float]]:
    """The filter after a report each second, and the rate after each."""
    rng = np.random.default_rng(seed)
    position_m, here, rates = 0j, None, []
    for second in range(seconds):
        off = rng.normal(0.0, 1.0, 4)
        velocity_mps = cmath.rect(speed_mps, course_rad) + velocity_sigma_mps * complex(off[2], off[3])
        at_m = position_m + position_sigma_m * complex(off[0], off[1])
        fix = fix_at(second, at_m, velocity_mps if with_velocity else None)
        if here is None:
            here = HorizontalFilter(fix, PARAMS)
        else:
            here.update(fix)
        rates.append(here.turn_radps)
        turned_rad = rate_radps(second)
        position_m += cmath.rect(speed_mps, course_rad + 0.5 * turned_rad)
        course_rad += turned_rad
    assert here is not None
    return here, rates


def fix_at(time_s: float, position_m: complex, velocity_mps: complex | None) -> HorizontalFix:
    place = FRAME.to_geo(position_m.real, position_m.imag, 0.0)
    stated = None if velocity_mps is None else (velocity_mps.real, velocity_mps.imag)
    return HorizontalFix(float(time_s), place.lat_deg, place.lon_deg, stated)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("speed_mps", [40.0, 60.0, 120.0])
def test_a_standard_rate_turn_is_found_within_seconds(speed_mps: float, side: float) -> None:
    here, _ = fly(12, lambda _: side * STANDARD_RADPS, speed_mps=speed_mps)
    assert here.turn_radps == pytest.approx(side * STANDARD_RADPS, rel=0.1)


def test_a_turn_through_north_is_found_too() -> None:
    here, _ = fly(15, lambda _: STANDARD_RADPS, course_rad=math.radians(340.0))
    assert here.turn_radps == pytest.approx(STANDARD_RADPS, rel=0.1)


def test_a_turn_is_found_from_positions_alone() -> None:
    here, rates = fly(40, lambda second: STANDARD_RADPS * (second >= 20), with_velocity=False)
    assert here.turn_radps == pytest.approx(STANDARD_RADPS, rel=0.2)
    assert rates[20] == 0.0
    assert max(rates[26:]) > 0.5 * STANDARD_RADPS


@pytest.mark.parametrize("position_sigma_m", [5.0, 15.0, 50.0])
@pytest.mark.parametrize("velocity_sigma_mps", [0.3, 1.5, 4.0])
def test_a_noisy_sender_in_straight_flight_does_not_turn(
    velocity_sigma_mps: float, position_sigma_m: float
) -> None:
    """Half an hour with less and with more noise than is usual."""
    _, rates = fly(
        1800, lambda _: 0.0, position_sigma_m=position_sigma_m, velocity_sigma_mps=velocity_sigma_mps
    )
    assert np.mean(np.array(rates[60:]) == 0.0) > 0.99
    assert max(np.abs(rates)) < STANDARD_RADPS


def test_the_rate_is_zero_after_a_turn_ends() -> None:
    _, rates = fly(40, lambda second: STANDARD_RADPS * (10 <= second < 30))
    assert rates[10] == 0.0
    assert rates[14] > 0.5 * STANDARD_RADPS
    assert rates[29] == pytest.approx(STANDARD_RADPS, rel=0.05)
    assert rates[33:] == [0.0] * 7


def test_a_hovering_target_has_no_rate_of_turn() -> None:
    here, _ = fly(20, lambda _: math.radians(15.0), speed_mps=2.0)
    assert here.turn_radps == 0.0


def test_the_filter_starts_again_after_a_gap() -> None:
    """It may have turned and stopped turning in that time: the next reports show whether it turns now."""
    here, _ = fly(12, lambda _: STANDARD_RADPS)
    from_m = complex(*FRAME.to_north_east_m(here.lat_deg, here.lon_deg)) + 18.0 * cmath.rect(55.0, 1.2)
    rates = []
    for second in range(12):
        velocity_mps = cmath.rect(60.0, 2.0)
        here.update(fix_at(30.0 + second, from_m + second * velocity_mps, velocity_mps))
        rates.append(here.turn_radps)
    assert rates[0] == 0.0
    assert rates[-5:] == [0.0] * 5


def test_a_report_without_a_velocity_does_not_end_a_turn() -> None:
    here, rates = fly(12, lambda _: STANDARD_RADPS)
    position_m = sum(cmath.rect(60.0, STANDARD_RADPS * (second + 0.5)) for second in range(12))
    here.update(fix_at(12.0, complex(position_m), None))
    assert here.turn_radps == pytest.approx(rates[-1], rel=0.05)
