"""Groups in the avoider: when a joint response is flown, which reports are rejected, and how it ends."""

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from companion.avoidance import AvoidanceParams, Avoider, Envelope
from companion.avoidance.group.formation import FormationParams, MemberState, is_valid
from companion.avoidance.group.joint_table import joint_response
from companion.avoidance.trajectory import Commands, OwnState, fly_ahead
from companion.model import Decision, Goal, Layer, Member, Ownship, Track, Vec3

GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
MEMBER = Member(GOAL, 16.0, 28.0, 0.25)
SOUTHBOUND = replace(MEMBER, goal=replace(GOAL, course_rad=math.pi))
FORMATION = FormationParams(own_id="A")


def own(velocity: Vec3 = (22.0, 0.0, 0.0), time_s: float = 0.0) -> Ownship:
    return Ownship(time_s, (0.0, 0.0, -300.0), velocity, 22.0, 0.0, (0.0, 0.0))


def member(
    name: str,
    place: tuple[float, float],
    velocity: Vec3 = (-22.0, 0.0, 0.0),
    report: Member | None = SOUTHBOUND,
) -> Track:
    return Track(
        name,
        0.0,
        (*place, -300.0),
        velocity,
        protected_horizontal_m=50.0,
        protected_vertical_m=30.0,
        member=report,
    )


def avoider(**changes: object) -> Avoider:
    formation = replace(FORMATION, **changes)  # type: ignore[arg-type]
    return Avoider(AvoidanceParams(formation=formation))


def decide(tracks: Sequence[Track], **changes: object) -> Decision:
    return avoider(**changes).decide(0.0, own(), tracks, GOAL)


def by_group(decision: Decision) -> bool:
    return decision.because.startswith("group: ")


def test_members_on_a_collision_course_respond_jointly() -> None:
    decision = decide([member("B", (390.0, 0.0))])
    assert by_group(decision)
    assert decision.guidance is not None
    assert [threat.track_id for threat in decision.threats] == ["B"]


def test_members_that_keep_their_distance_are_not_in_conflict() -> None:
    """Members of a formation fly near each other on purpose."""
    beside = member("B", (0.0, 390.0), (22.0, 0.0, 0.0), MEMBER)
    parting = member("B", (-390.0, 0.0))
    for track in (beside, parting):
        assert decide([track]) == Decision(Layer.CLEAR, because="no conflict")


@pytest.mark.parametrize(
    "report",
    [
        replace(SOUTHBOUND, goal=Goal(position_m=(math.nan, 0.0, -300.0))),
        replace(SOUTHBOUND, goal=replace(GOAL, airspeed_mps=math.nan)),
        replace(SOUTHBOUND, max_turn_rate_radps=math.nan),
        replace(SOUTHBOUND, max_turn_rate_radps=-1.0),
        replace(SOUTHBOUND, max_turn_rate_radps=0.0),
        replace(SOUTHBOUND, min_airspeed_mps=30.0, max_airspeed_mps=20.0),
        replace(SOUTHBOUND, min_airspeed_mps=-1.0),
        replace(SOUTHBOUND, max_airspeed_mps=math.inf),
    ],
)
def test_a_member_with_an_invalid_report_is_avoided_like_a_stranger(report: Member) -> None:
    friendly = member("B", (0.0, 150.0), (22.0, 0.0, 0.0), MEMBER)
    invalid = member("C", (390.0, 0.0), report=report)
    decision = decide([friendly, invalid])
    assert not by_group(decision)
    assert decision.guidance is not None
    assert "C" in {threat.track_id for threat in decision.threats}
    assert not is_valid(MemberState("C", invalid.position_m, invalid.velocity_mps, report))


def test_a_joint_response_that_leads_to_a_stranger_is_not_flown() -> None:
    head_on = member("B", (390.0, 0.0))
    alone = decide([head_on])
    assert alone.guidance is not None
    state = OwnState((0.0, 0.0, -300.0), 0.0, 22.0, 0.0, (0.0, 0.0))
    way = fly_ahead(state, Commands.of([alone.guidance]), Envelope()).row_m(0)
    # At the place that the joint response reaches after 16 s, far from the mission's line.
    stranger = replace(
        member("S", (way[14, 0], way[14, 1]), (0.0, 0.0, 0.0), None), protected_horizontal_m=40.0
    )
    assert abs(way[14, 1]) > 100.0
    assert Avoider(AvoidanceParams()).decide(0.0, own(), [stranger], GOAL).layer is Layer.CLEAR
    decision = decide([head_on, stranger])
    assert not by_group(decision)
    assert decision.guidance is not None


def test_a_conflict_with_a_stranger_comes_first() -> None:
    stranger = Track("S", 0.0, (1500.0, 0.0, -300.0), (-40.0, 0.0, 0.0))
    decision = decide([member("B", (390.0, 0.0)), stranger])
    assert not by_group(decision)
    assert "S" in {threat.track_id for threat in decision.threats}


@pytest.mark.parametrize("changes", [{"own_id": ""}, {"cooperate": False}])
def test_without_an_id_or_without_cooperation_there_is_no_group(changes: dict[str, object]) -> None:
    decision = decide([member("B", (390.0, 0.0))], **changes)
    assert not by_group(decision)
    assert decision.guidance is not None, "it is avoided like a stranger"


def test_two_members_with_one_id_are_not_a_group() -> None:
    twice = [member("B", (390.0, 0.0)), member("B", (300.0, 50.0))]
    decision = decide(twice)
    assert not by_group(decision)
    assert decision.guidance is not None


def test_a_track_with_our_own_id_is_ignored() -> None:
    echo = member("A", (0.0, 0.0), (22.0, 0.0, 0.0), MEMBER)
    assert decide([echo]).layer is Layer.CLEAR
    assert decide([echo, member("B", (390.0, 0.0))]) == decide([member("B", (390.0, 0.0))])


def test_too_many_members_are_not_a_group() -> None:
    crowd = [MemberState(f"M{i:02d}", (60.0 * i, 0.0, -300.0), (22.0, 0.0, 0.0), MEMBER) for i in range(11)]
    assert joint_response(crowd, FORMATION) is None
    assert joint_response(crowd[:10], FORMATION) is not None


def test_the_joint_guidance_is_held_before_the_return() -> None:
    """At the edge of the conflict, control is not taken and given back every tick."""
    flying = avoider()
    first = flying.decide(0.0, own(), [member("B", (390.0, 0.0))], GOAL)
    gone = flying.decide(1.0, own(time_s=1.0), [], GOAL)
    assert gone.guidance == first.guidance
    later = flying.decide(5.0, own(time_s=5.0), [], GOAL)
    assert later.layer is Layer.CLEAR


def test_a_member_at_its_goal_keeps_its_course() -> None:
    east = MemberState(
        "A", (0.0, 0.0, -300.0), (0.0, 22.0, 0.0), replace(MEMBER, goal=Goal(position_m=(0.0, 0.0, -300.0)))
    )
    other = MemberState("B", (0.0, 390.0, -300.0), (0.0, -22.0, 0.0), MEMBER)
    answer = joint_response([east, other], FORMATION)
    assert answer is not None
    assert abs(answer.guidance["A"].course_rad - math.pi / 2.0) <= math.radians(60.1)


def test_the_reported_goal_is_within_the_limits() -> None:
    limits = Envelope(min_altitude_m=250.0, max_altitude_m=350.0)
    flying = Avoider(AvoidanceParams(formation=FORMATION, envelope=limits))
    report = flying.member(own(), Goal(course_rad=0.0, airspeed_mps=60.0, altitude_m=100.0))
    assert report.goal.airspeed_mps == limits.max_airspeed_mps
    assert report.goal.altitude_m == 250.0
    assert flying.member(own(), Goal(course_rad=0.0)).goal.airspeed_mps == 22.0, "its present airspeed"


@pytest.mark.parametrize(
    "stranger",
    [
        Track("N", 0.0, (12_000.0, 0.0, -300.0), (0.0, 0.0, 0.0), protected_horizontal_m=math.nan),
        Track("N", 0.0, (12_000.0, 0.0, -300.0), (0.0, 0.0, 0.0), protected_vertical_m=math.inf),
        Track("N", 0.0, (12_000.0, 0.0, -300.0), (1e39, 0.0, 0.0)),
        Track("N", 0.0, (1e200, 0.0, -300.0), (0.0, 0.0, 0.0)),
    ],
)
def test_an_absurd_track_does_not_hide_another(stranger: Track) -> None:
    threat = Track("T", 0.0, (1500.0, 0.0, -300.0), (-40.0, 0.0, 0.0))
    with_it = Avoider(AvoidanceParams()).decide(0.0, own(), [threat, stranger], GOAL)
    assert with_it == Avoider(AvoidanceParams()).decide(0.0, own(), [threat], GOAL)
    assert with_it.layer is not Layer.CLEAR
