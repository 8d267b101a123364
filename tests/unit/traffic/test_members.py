"""Members of our formation among the tracks."""

import math
from dataclasses import replace

import pytest

from companion.geodesy import LocalFrame
from companion.mavlink.facts import MemberIntent, OwnPosition, Sender
from companion.model import Goal, Guidance, Intent, Member, Proposal, Track
from companion.traffic import TrafficParams, TrafficPicture
from companion.traffic.members import MemberParams, fact_of, member_of

FRAME = LocalFrame(47.0, 8.0)
OTHER = Sender(7, 1)
GUIDANCE = Guidance(1.0, 22.0, 400.0)
INTENT = MemberIntent(
    Sender(7, 196),
    50,
    (47.05, 8.0),
    None,
    None,
    500.0,
    22.0,
    False,
    16.0,
    28.0,
    0.25,
    None,
    None,
    {1: 3},
    True,
)


def picture(system_ids: object = (7,)) -> TrafficPicture:
    return TrafficPicture(TrafficParams(), MemberParams(system_ids))  # type: ignore[arg-type]


def position(time_s: float, system_id: int = 7) -> OwnPosition:
    return OwnPosition(
        Sender(system_id, 1), time_s, 47.02 + 0.00018 * time_s, 8.0, 500.0, 100.0, (20.0, 0.0, 0.0), 0.0
    )


def only(tracks: tuple[Track, ...]) -> Track:
    (track,) = tracks
    return track


@pytest.mark.parametrize(
    ("system_ids", "is_member"), [((7,), True), ("all", True), ((8,), False), ((), False)]
)
def test_the_configured_systems_are_members(system_ids: object, is_member: bool) -> None:
    seen = picture(system_ids)
    seen.receive(INTENT, 0.0)
    assert seen.receive(position(0.0), 0.0) == "SYS-7"
    track = only(seen.tracker.tracks(0.0, FRAME))
    assert (track.protected_horizontal_m, track.protected_vertical_m) == (
        (50.0, 30.0) if is_member else (None, None)
    )
    assert (track.member is not None) is is_member


def test_what_a_member_announces_is_in_the_local_frame() -> None:
    seen = picture()
    seen.receive(replace(INTENT, flown=GUIDANCE, proposal=Proposal(4, None)), 0.0)
    seen.receive(position(0.0), 0.0)
    member = only(seen.tracker.tracks(0.0, FRAME)).member
    assert member is not None
    assert member.member_id == "7"
    assert member.goal.position_m is not None
    north_m, _, down_m = member.goal.position_m
    assert north_m == pytest.approx(5_560, abs=10)
    assert down_m == -500.0
    assert member.intent == Intent(GUIDANCE, Proposal(4, None), {"1": 3}, True)


def test_a_member_without_an_intent_has_the_small_volume_only() -> None:
    seen = picture()
    seen.receive(position(0.0), 0.0)
    track = only(seen.tracker.tracks(0.0, FRAME))
    assert track.protected_horizontal_m == 50.0
    assert track.member is None


def test_a_silent_member_becomes_a_stranger() -> None:
    """First its intent is forgotten, then it is one of the others, with their volume."""
    seen = picture()
    seen.receive(INTENT, 0.0)
    seen.receive(position(0.0), 0.0)
    seen.receive(position(4.0), 4.0)
    assert only(seen.tracker.tracks(4.9, FRAME)).member is not None
    late = only(seen.tracker.tracks(5.1, FRAME))
    assert late.member is None
    assert late.protected_horizontal_m == 50.0
    assert only(seen.tracker.tracks(9.1, FRAME)).protected_horizontal_m is None


def test_an_overtaken_intent_is_dropped_and_one_of_a_restarted_member_is_not() -> None:
    seen = picture()
    seen.receive(position(0.0), 0.0)
    for counter, flown, used in (
        (50, GUIDANCE, GUIDANCE),
        (49, None, GUIDANCE),
        (51, None, None),
        (65_500, GUIDANCE, None),
        (30_000, GUIDANCE, GUIDANCE),
    ):
        seen.receive(replace(INTENT, counter=counter, flown=flown), 0.0)
        member = only(seen.tracker.tracks(0.0, FRAME)).member
        assert member is not None
        assert member.intent is not None
        assert member.intent.flown == used, counter


def test_what_is_announced_is_what_the_others_read() -> None:
    intent = Intent(GUIDANCE, Proposal(9, GUIDANCE), {"2": 5}, True)
    goal = Goal(
        airspeed_mps=21.0, altitude_m=450.0, position_m=(1000.0, -300.0, -450.0), then_m=(2000.0, 9.0, -450.0)
    )
    sent = Member(goal, 15.0, 30.0, 0.3, intent, "7")
    read = member_of(fact_of(sent, FRAME, Sender(7, 196), 1), FRAME)
    assert read.goal.position_m == pytest.approx(goal.position_m, abs=0.02)
    assert read.goal.then_m == pytest.approx(goal.then_m, abs=0.02)
    assert replace(read, goal=goal) == sent


def along_a_bend(time_s: float, boot_time_s: float, system_id: int) -> OwnPosition:
    """A position on a way that turns to the right after 20 s."""
    north_m, east_m, course_rad = 0.0, 0.0, 0.0
    for tenth in range(round(10.0 * time_s)):
        course_rad = 0.03 * max(0.1 * tenth - 20.0, 0.0)
        north_m += 2.0 * math.cos(course_rad)
        east_m += 2.0 * math.sin(course_rad)
    lat_deg, lon_deg, _ = FRAME.to_geo(north_m, east_m, 0.0)
    velocity_mps = 20.0 * math.cos(course_rad), 20.0 * math.sin(course_rad), 0.0
    return OwnPosition(
        Sender(system_id, 1), boot_time_s, lat_deg, lon_deg, 500.0, 100.0, velocity_mps, course_rad
    )


@pytest.mark.parametrize("system_ids", [(7,), "all"])
def test_a_member_that_follows_us_closely_is_not_ourselves(system_ids: object) -> None:
    """It flies where we were two seconds ago, and turns as we did: a shadow, if it were not a member."""
    seen = picture(system_ids)
    for half in range(4, 140):
        now_s = 0.5 * half
        seen.observe_ownship(along_a_bend(now_s, now_s, 1), now_s)
        seen.receive(along_a_bend(now_s - 2.0, now_s, 7), now_s)
        if now_s > 4.0:
            assert only(seen.tracker.tracks(now_s, FRAME)).is_member
