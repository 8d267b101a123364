"""An avoidance begins when acting later would no longer keep clear, and no earlier."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.params import Layers, OuterMethod
from companion.model import Decision, Goal, Layer, Ownship, Track

PARAMS = AvoidanceParams()
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)


def decided(
    params: AvoidanceParams, track: Track, from_s: float, until_s: float
) -> list[tuple[float, Decision]]:
    """The decisions of each second while we fly north on our mission, until an avoidance begins."""
    avoider, decisions = Avoider(params), []
    for second in range(int(from_s), int(until_s)):
        own = Ownship(second, (22.0 * second, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
        north_m, east_m, down_m = track.position_m
        here = replace(
            track,
            time_s=float(second),
            position_m=(
                north_m + track.velocity_mps[0] * second,
                east_m + track.velocity_mps[1] * second,
                down_m + track.velocity_mps[2] * second,
            ),
        )
        decisions.append((float(second), avoider.decide(float(second), own, [here], GOAL)))
        if decisions[-1][1].layer is not Layer.CLEAR:
            break
    return decisions


def head_on(meeting_s: float = 70.0, aside_m: float = 0.0, closing_mps: float = 82.0) -> Track:
    """An intruder that meets us in this time."""
    return Track("A", 0.0, (closing_mps * meeting_s, aside_m, -300.0), (22.0 - closing_mps, 0.0, 0.0))


def begin_s(params: AvoidanceParams, track: Track) -> float:
    """When the avoidance begins."""
    time_s, decision = decided(params, track, 0.0, 100.0)[-1]
    assert decision.layer is not Layer.CLEAR
    return time_s


def test_a_conflict_that_needs_no_answer_yet_is_awaited() -> None:
    decisions = decided(PARAMS, head_on(), 0.0, 70.0)
    awaited = [(at_s, one) for at_s, one in decisions if one.awaited]
    assert awaited
    for _, decision in awaited:
        assert decision.layer is Layer.CLEAR
        assert decision.guidance is None
        assert not decision.threats
        assert decision.awaited[0].track_id == "A"
        assert decision.because == "no need to avoid A yet"
    begins_s, begun = decisions[-1]
    assert not begun.awaited
    # A climb by the volume and its margin takes 38 s.
    assert 15.0 <= begins_s <= 32.0


def test_more_reserve_begins_earlier() -> None:
    begins_s = [begin_s(replace(PARAMS, reserve_s=reserve_s), head_on()) for reserve_s in (0, 3, 6, 10, 60)]
    assert begins_s == sorted(begins_s, reverse=True)
    assert begins_s[0] > begins_s[-1]


@pytest.mark.parametrize(
    "params",
    [
        replace(PARAMS, layers=Layers.OUTER),
        replace(PARAMS, outer_method=OuterMethod.CONE),
        replace(PARAMS, reserve_s=60.0),
    ],
)
def test_the_variants_of_the_paper_act_at_once(params: AvoidanceParams) -> None:
    assert all(not decision.awaited for _, decision in decided(params, head_on(), 0.0, 70.0))


def test_members_are_answered_at_once() -> None:
    member = replace(head_on(), is_member=True, protected_horizontal_m=100.0, protected_vertical_m=50.0)
    assert not any(decision.awaited for _, decision in decided(PARAMS, member, 0.0, 70.0))


def test_what_is_near_at_first_sight_is_answered_at_once() -> None:
    assert begin_s(PARAMS, head_on(meeting_s=15.0)) == 0.0


@given(aside_m=st.floats(-500.0, 500.0), closing_mps=st.floats(30.0, 150.0), meeting_s=st.floats(60.0, 80.0))
def test_who_waits_still_keeps_clear(aside_m: float, closing_mps: float, meeting_s: float) -> None:
    """Flown ahead, the row that is begun keeps the bare volume."""
    decisions = decided(PARAMS, head_on(meeting_s, aside_m, closing_mps), 0.0, 100.0)
    begins_s, begun = decisions[-1]
    if begun.layer is Layer.CLEAR or not any(decision.awaited for _, decision in decisions):
        return
    guidance = begun.guidance
    assert guidance is not None
    assert begun.layer is Layer.OUTER  # the inner layer is for what has become too near
    climb_m = abs(guidance.altitude_m - 300.0)
    turn_rad = abs(math.remainder(guidance.course_rad, math.tau))
    assert climb_m >= 76.2 or turn_rad > 0.0
    assert meeting_s - begins_s >= 10.0
