"""Refused values: another row is flown for a while, and there is always some guidance."""

import math

import pytest

from companion.avoidance import AvoidanceParams, Avoider, Control
from companion.avoidance.constraints import REFUSED_FOR_S, Refusals
from companion.avoidance.group.formation import FormationParams
from companion.avoidance.trajectory import Commands
from companion.model import Decision, Goal, Guidance, Layer, Member, Ownship, Track

GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
VALUES = {
    Control.HEADING: lambda guidance: guidance.course_rad,
    Control.SPEED: lambda guidance: guidance.airspeed_mps,
    Control.HEIGHT: lambda guidance: guidance.altitude_m,
}
APART = {Control.HEADING: math.radians(2.0), Control.SPEED: 0.5, Control.HEIGHT: 5.0}


def decide(avoider: Avoider, now_s: float = 0.0) -> Decision:
    """Head-on, 1200 m away at any time: the inner layer with its whole table decides."""
    own = Ownship(now_s, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
    track = Track("A", now_s, (1200.0, 0.0, -300.0), (-40.0, 0.0, 0.0))
    return avoider.decide(now_s, own, [track], GOAL)


def flown(avoider: Avoider, now_s: float = 0.0) -> Guidance:
    guidance = decide(avoider, now_s).guidance
    assert guidance is not None
    return guidance


def differs(control: Control, one: Guidance, other: Guidance) -> bool:
    off = VALUES[control](one) - VALUES[control](other)
    off = math.remainder(off, math.tau) if control is Control.HEADING else off
    return abs(off) > APART[control]


@pytest.mark.parametrize("control", Control)
def test_no_row_with_the_refused_value_is_flown(control: Control) -> None:
    avoider = Avoider(AvoidanceParams())
    first = flown(avoider)
    avoider.refuse(control, VALUES[control](first), 0.1)
    for tenth in range(2, 40, 5):
        assert differs(control, flown(avoider, tenth / 10), first)


@pytest.mark.parametrize("control", Control)
def test_a_refused_value_is_flown_again_after_a_while(control: Control) -> None:
    avoider, fresh = Avoider(AvoidanceParams()), Avoider(AvoidanceParams())
    first = flown(avoider)
    avoider.refuse(control, VALUES[control](first), 0.0)
    assert differs(control, flown(avoider, 0.9 * REFUSED_FOR_S), first)
    avoider.reset()
    assert flown(avoider, REFUSED_FOR_S + 0.1) == flown(fresh, REFUSED_FOR_S + 0.1)


def test_a_reset_does_not_forget_refusals() -> None:
    avoider = Avoider(AvoidanceParams())
    first = flown(avoider)
    avoider.refuse(Control.HEADING, first.course_rad, 0.0)
    avoider.reset()
    assert differs(Control.HEADING, flown(avoider, 1.0), first)


def test_if_all_courses_are_refused_the_mission_course_is_flown() -> None:
    avoider = Avoider(AvoidanceParams())
    for _ in range(400):
        guidance = flown(avoider)
        if guidance.course_rad == GOAL.course_rad and not avoider._refusals.allow(guidance):
            break
        avoider.refuse(Control.HEADING, guidance.course_rad, 0.0)
    else:
        pytest.fail("some row was never refused")
    assert decide(avoider).layer is Layer.INNER


def test_if_the_mission_speed_is_refused_another_is_flown() -> None:
    """All rows of the outer layer have this speed, but the table of the inner layer has others."""
    avoider = Avoider(AvoidanceParams())
    avoider.refuse(Control.SPEED, 22.0, 0.0)
    own = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
    far = Track("A", 0.0, (4500.0, 0.0, -300.0), (-60.0, 0.0, 0.0))
    guidance = avoider.decide(0.0, own, [far], GOAL).guidance
    assert guidance is not None
    assert abs(guidance.airspeed_mps - 22.0) > APART[Control.SPEED]


def test_with_a_single_control_the_others_keep_the_values_of_the_mission() -> None:
    avoider = Avoider(AvoidanceParams(controls=frozenset({Control.HEADING})))
    avoider.refuse(Control.HEIGHT, 300.0, 0.0)
    avoider.refuse(Control.SPEED, 22.0, 0.0)
    guidance = flown(avoider)
    assert (guidance.airspeed_mps, guidance.altitude_m) == (22.0, 300.0)
    assert abs(math.remainder(guidance.course_rad, math.tau)) > math.radians(10.0)


def test_a_refused_joint_guidance_is_not_flown() -> None:
    member = Member(Goal(course_rad=math.pi, airspeed_mps=22.0, altitude_m=300.0), 16.0, 28.0, 0.25)
    other = Track(
        "B", 0.0, (390.0, 0.0, -300.0), (-22.0, 0.0, 0.0), protected_horizontal_m=50.0,
        protected_vertical_m=30.0, member=member,
    )  # fmt: skip
    own = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
    avoider = Avoider(AvoidanceParams(formation=FormationParams(own_id="A")))
    joint = avoider.decide(0.0, own, [other], GOAL)
    assert joint.because.startswith("group: ")
    assert joint.guidance is not None
    avoider.refuse(Control.HEADING, joint.guidance.course_rad, 0.0)
    alone = avoider.decide(0.0, own, [other], GOAL)
    assert not alone.because.startswith("group: ")


def test_courses_are_compared_across_north() -> None:
    refusals = Refusals().adding(Control.HEADING, math.radians(359.5), 5.0)
    assert not refusals.allow(Guidance(math.radians(0.5), 22.0, 300.0))
    assert refusals.allow(Guidance(math.radians(3.0), 22.0, 300.0))
    assert not refusals.allow(Guidance(math.radians(-0.5), 22.0, 300.0))


@pytest.mark.parametrize(("now_s", "counts"), [(5.0, True), (34.9, True), (35.0, False), (4.9, False)])
def test_a_refusal_expires_and_does_not_count_before_its_time(now_s: float, counts: bool) -> None:
    assert bool(Refusals().adding(Control.SPEED, 18.0, 5.0).at(now_s).refused) is counts


def test_if_all_rows_are_refused_only_their_refused_values_change() -> None:
    rows = Commands.of([Guidance(1.0, 20.0, 310.0), Guidance(1.0, 28.0, 400.0)])
    refusals = Refusals().adding(Control.HEADING, 1.0, 0.0).adding(Control.HEIGHT, 400.0, 0.0)
    left = refusals.remove_from(rows, Guidance(0.5, 22.0, 300.0))
    assert [left.row(i) for i in range(2)] == [Guidance(0.5, 20.0, 310.0), Guidance(0.5, 28.0, 300.0)]
