"""Tracks with uncertain heights need more room above and below; nothing else changes."""

import math
from dataclasses import replace

import pytest

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.assess import protected_tracks
from companion.avoidance.avoider import relevant_track
from companion.model import Goal, Layer, Ownship, Track, TrafficKind

PARAMS = AvoidanceParams(reserve_s=60.0)  # no conflict waits
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
OVER = Track("A", 0.0, (3000.0, 0.0, -420.0), (-60.0, 0.0, 0.0))  # 120 m above


@pytest.mark.parametrize("kind", [TrafficKind.AIRCRAFT, TrafficKind.OBSTACLE])
@pytest.mark.parametrize("protected_m", [None, 40.0])
def test_the_uncertainty_is_added_to_the_protected_height(
    kind: TrafficKind, protected_m: float | None
) -> None:
    sure = replace(OVER, kind=kind, protected_vertical_m=protected_m)
    unsure = replace(sure, vertical_uncertainty_m=60.0)
    known, unknown = (protected_tracks(0.0, [track], PARAMS) for track in (sure, unsure))
    more_m = unknown.protected_vertical_m - known.protected_vertical_m
    assert more_m == pytest.approx(60.0 * (1.0 + PARAMS.vertical_margin))
    assert unknown.protected_horizontal_m == known.protected_horizontal_m


def test_an_aircraft_that_passes_overhead_needs_more_room() -> None:
    assert Avoider(PARAMS).decide(0.0, OWN, [OVER], GOAL).layer is Layer.CLEAR
    unsure = replace(OVER, vertical_uncertainty_m=80.0)
    decision = Avoider(PARAMS).decide(0.0, OWN, [unsure], GOAL)
    assert decision.layer is not Layer.CLEAR
    assert decision.guidance is not None


def test_reported_distances_do_not_contain_the_uncertainty() -> None:
    near = replace(OVER, position_m=(3000.0, 0.0, -330.0))
    sure = Avoider(PARAMS).decide(0.0, OWN, [near], GOAL).threats[0]
    unsure = Avoider(PARAMS).decide(0.0, OWN, [replace(near, vertical_uncertainty_m=80.0)], GOAL).threats[0]
    assert unsure == sure
    assert sure.miss_vertical_m == pytest.approx(30.0)


def test_passing_over_or_under_keeps_the_bare_volume_even_if_the_whole_error_is_against_us() -> None:
    level = replace(OVER, position_m=(4500.0, 0.0, -300.0), vertical_uncertainty_m=50.0)
    guidance = Avoider(PARAMS).decide(0.0, OWN, [level], GOAL).guidance
    assert guidance is not None
    if guidance.course_rad == 0.0:
        assert abs(guidance.altitude_m - 300.0) >= PARAMS.well_clear_vertical_m + 50.0


@pytest.mark.parametrize("uncertain_m", [math.inf, 1e5])
def test_an_unknown_height_can_only_be_passed_sideways(uncertain_m: float) -> None:
    decision = Avoider(PARAMS).decide(0.0, OWN, [replace(OVER, vertical_uncertainty_m=uncertain_m)], GOAL)
    assert decision.guidance is not None
    assert abs(math.remainder(decision.guidance.course_rad, math.tau)) > math.radians(5.0)


def test_an_invalid_uncertainty_does_not_count() -> None:
    for invalid_m in (math.nan, -500.0):
        believed = relevant_track(replace(OVER, vertical_uncertainty_m=invalid_m), 0.0)
        assert believed == OVER
