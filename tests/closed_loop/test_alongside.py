"""An intruder flies alongside at our course and speed: the avoidance must end nevertheless."""

import math

import pytest

from companion.avoidance import AvoidanceParams
from companion.model import Layer, Vec3
from tests.support.encounter import ALTITUDE_M, Outcome, fly

OWN_MPS = 22.0


def alongside(ahead_m: float, aside_m: float, **params: float) -> Outcome:
    """210 s with an intruder at a constant offset, ahead of us and to the right."""

    def at(time_s: float) -> tuple[Vec3, Vec3]:
        return (ahead_m + OWN_MPS * time_s, aside_m, -ALTITUDE_M), (OWN_MPS, 0.0, 0.0)

    return fly([at], params=AvoidanceParams(**params), seconds=210.0)  # type: ignore[arg-type]


def released_s(outcome: Outcome) -> int:
    """Time of the final release [s]."""
    avoiding = [i for i, decision in enumerate(outcome.decisions) if decision.layer is not Layer.CLEAR]
    return avoiding[-1] + 1


@pytest.mark.parametrize(
    ("ahead_m", "aside_m"),
    [
        (0.0, 0.1),
        (0.0, 230.0),
        (0.0, -150.0),
        (300.0, 0.1),
        (150.0, -150.0),
        (-200.0, 0.1),
        (-200.0, 250.0),
    ],
)
def test_an_intruder_alongside_does_not_block_the_mission(ahead_m: float, aside_m: float) -> None:
    outcome = alongside(ahead_m, aside_m)
    assert released_s(outcome) <= 180
    assert outcome.engagements == 1


@pytest.mark.parametrize("aside_m", [250.0, -250.0])
def test_what_becomes_a_conflict_again_soon_is_avoided_without_new_patience(aside_m: float) -> None:
    """The way back leads beside it once more: the second avoidance is short."""
    outcome = alongside(0.0, aside_m)
    assert outcome.engagements == 2
    assert released_s(outcome) <= 150


def test_the_patience_parameter_ends_the_avoidance() -> None:
    assert released_s(alongside(0.0, 0.1, patience_s=600.0)) == 210, "to the end of the flight"


@pytest.mark.parametrize("drift_mps", [0.7, 1.5, 3.0, -1.5])
def test_a_slowly_drifting_intruder_is_avoided_despite_a_late_closest_approach(
    drift_mps: float,
) -> None:
    """It enters the volume after 50 s; the closest approach comes minutes later."""
    aside_m = math.copysign(610.0 + 50.0 * abs(drift_mps), drift_mps)

    def at(time_s: float) -> tuple[Vec3, Vec3]:
        return (OWN_MPS * time_s, aside_m - drift_mps * time_s, -ALTITUDE_M), (OWN_MPS, -drift_mps, 0.0)

    assert fly([at], avoid=False, seconds=210.0).well_clear < 1.0
    assert fly([at], seconds=210.0).well_clear >= 1.0
