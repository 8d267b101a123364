"""Controls that cannot be flown: the avoider decides among the rest."""

import math
from itertools import chain, combinations

import pytest

from companion.avoidance import ALL_CONTROLS, AvoidanceParams, Avoider, Control
from companion.model import Goal, Guidance, Ownship, Track

GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
SUBSETS = [frozenset(lost) for lost in chain.from_iterable(combinations(Control, n) for n in range(1, 4))]


def flown(avoider: Avoider, now_s: float, distance_m: float) -> Guidance:
    own = Ownship(now_s, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
    track = Track("A", now_s, (distance_m, 0.0, -300.0), (-40.0, 0.0, 0.0))
    guidance = avoider.decide(now_s, own, [track], GOAL).guidance
    assert guidance is not None
    return guidance


def used(guidance: Guidance) -> set[Control]:
    changed = {
        Control.HEADING: abs(math.remainder(guidance.course_rad, math.tau)) > 1e-6,
        Control.SPEED: guidance.airspeed_mps != 22.0,
        Control.HEIGHT: guidance.altitude_m != 300.0,
    }
    return {control for control, is_changed in changed.items() if is_changed}


@pytest.mark.parametrize("distance_m", [600.0, 1200.0, 3000.0])
@pytest.mark.parametrize("lost", SUBSETS, ids=lambda lost: "+".join(sorted(lost)))
def test_lost_controls_are_never_used(lost: frozenset[Control], distance_m: float) -> None:
    avoider = Avoider(AvoidanceParams())
    avoider.withhold(lost)
    for second in range(100):  # long enough for impatience
        assert used(flown(avoider, float(second), distance_m)) <= ALL_CONTROLS - lost


@pytest.mark.parametrize("lost", SUBSETS, ids=lambda lost: "+".join(sorted(lost)))
def test_a_control_that_is_lost_on_the_way_is_not_used_any_more(lost: frozenset[Control]) -> None:
    avoider = Avoider(AvoidanceParams())
    for second in range(3):
        flown(avoider, float(second), 1200.0)
    avoider.withhold(lost)
    for second in range(3, 30):
        assert used(flown(avoider, float(second), 1200.0)) <= ALL_CONTROLS - lost
    avoider.withhold(frozenset())
    fresh = Avoider(AvoidanceParams())
    avoider.reset()
    assert flown(avoider, 40.0, 1200.0) == flown(fresh, 40.0, 1200.0)


def test_new_parameters_do_not_bring_a_lost_control_back() -> None:
    avoider = Avoider(AvoidanceParams())
    avoider.withhold(frozenset({Control.HEADING}))
    avoider.retune(AvoidanceParams(inner_radius_m=200.0))
    assert Control.HEADING not in used(flown(avoider, 0.0, 1200.0))
