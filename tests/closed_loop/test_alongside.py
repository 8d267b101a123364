"""Somebody flies beside us, on our course and at our speed: nothing passes by itself, and yet it must end."""

import math

import pytest

from companion.avoidance import AvoidanceParams
from companion.model import Layer, Vec3
from tests.support.encounter import ALTITUDE_M, Outcome, fly

OWN_MPS = 22.0


def alongside(ahead_m: float, aside_m: float, **params: float) -> Outcome:
    """Three and a half minutes with it, so much ahead of us and to the right."""

    def at(time_s: float) -> tuple[Vec3, Vec3]:
        return (ahead_m + OWN_MPS * time_s, aside_m, -ALTITUDE_M), (OWN_MPS, 0.0, 0.0)

    return fly([at], params=AvoidanceParams(**params), seconds=210.0)  # type: ignore[arg-type]


def released_s(outcome: Outcome) -> int:
    """When the mission is flown for good."""
    avoiding = [i for i, decision in enumerate(outcome.decisions) if decision.layer is not Layer.CLEAR]
    return avoiding[-1] + 1


@pytest.mark.parametrize(
    ("ahead_m", "aside_m"),
    [(0.0, 0.1), (0.0, 250.0), (0.0, -150.0), (300.0, 0.1), (150.0, -150.0), (-200.0, 0.1), (-200.0, 250.0)],
)
def test_whoever_flies_beside_us_does_not_keep_us_off_the_mission_for_ever(
    ahead_m: float, aside_m: float
) -> None:
    outcome = alongside(ahead_m, aside_m)
    assert released_s(outcome) <= 180
    assert outcome.engagements == 1


def test_it_is_impatience_that_ends_it() -> None:
    assert released_s(alongside(0.0, 0.1, patience_s=600.0)) == 210, "to the end of the flight"


@pytest.mark.parametrize("drift_mps", [0.7, 1.5, 3.0, -1.5])
def test_whoever_drifts_into_us_is_avoided_before_that_however_far_the_closest_approach_is_off(
    drift_mps: float,
) -> None:
    """He enters the volume after 50 s, the closest approach comes minutes later."""
    aside_m = math.copysign(610.0 + 50.0 * abs(drift_mps), drift_mps)

    def at(time_s: float) -> tuple[Vec3, Vec3]:
        return (OWN_MPS * time_s, aside_m - drift_mps * time_s, -ALTITUDE_M), (OWN_MPS, -drift_mps, 0.0)

    assert fly([at], avoid=False, seconds=210.0).well_clear < 1.0
    assert fly([at], seconds=210.0).well_clear >= 1.0
