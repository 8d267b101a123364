"""Passing a mission item that a track blocks: when, at which height and on which course."""

import math
from dataclasses import replace

import pytest

from companion.avoidance import AvoidanceParams, Control, Envelope
from companion.avoidance.assess import TrafficAssessment, assess_traffic, protected_tracks
from companion.avoidance.blocked_item import guidance_past, keeps_clear
from companion.avoidance.constraints import Constraints, Refusals
from companion.avoidance.intruders import TransitionDomain
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.policies import policy_of
from companion.model import Goal, Guidance, Ownship, Track, Vec3

PARAMS, ENVELOPE = AvoidanceParams(), Envelope()
ITEM_M: Vec3 = (1200.0, 0.0, -300.0)
GOAL = Goal(position_m=ITEM_M, airspeed_mps=22.0)
STAYING = Track("S", 0.0, (1400.0, 0.0, -310.0), (0.0, 0.0, 0.0))
# With margin, and some room; then ten seconds of descent or climb towards the mission's height.
OVER_M, UNDER_M = 310.0 + 97.15 + 25.0, 310.0 - 97.15 - 25.0


def flight(
    goal: Goal = GOAL, height_m: float = 300.0, course_rad: float = 0.0, north_m: float = 0.0
) -> OwnFlight:
    velocity = 22.0 * math.cos(course_rad), 22.0 * math.sin(course_rad), 0.0
    return OwnFlight.at(0.0, Ownship(0.0, (north_m, 0.0, -height_m), velocity, 22.0, course_rad), goal)


def assessed(own: OwnFlight, *tracks: Track) -> TrafficAssessment:
    return assess_traffic(
        own, protected_tracks(0.0, tracks, PARAMS), PARAMS, ENVELOPE, policy_of(PARAMS),
        TransitionDomain(0.0), release_margin=0.2,
    )  # fmt: skip


def past(own: OwnFlight, *tracks: Track, envelope: Envelope = ENVELOPE) -> Guidance | None:
    return guidance_past(own, assessed(own, *tracks), envelope)


@pytest.mark.parametrize(("height_m", "wanted_m"), [(320.0, OVER_M), (300.0, UNDER_M)])
def test_the_nearer_height_is_flown_towards_the_item(height_m: float, wanted_m: float) -> None:
    guidance = past(flight(height_m=height_m), STAYING)
    assert guidance is not None
    assert guidance.altitude_m == pytest.approx(wanted_m, abs=1.0)
    assert guidance.course_rad == pytest.approx(0.0)


def test_a_height_beyond_floor_or_ceiling_is_not_flown() -> None:
    guidance = past(flight(), STAYING, envelope=replace(ENVELOPE, min_altitude_m=250.0))
    assert guidance is not None
    assert guidance.altitude_m == pytest.approx(OVER_M, abs=1.0)
    neither = replace(ENVELOPE, min_altitude_m=250.0, max_altitude_m=400.0)
    assert past(flight(), STAYING, envelope=neither) is None


@pytest.mark.parametrize(
    "track",
    [
        replace(STAYING, velocity_mps=(-22.0, 0.0, 0.0)),
        replace(STAYING, position_m=(700.0, 0.0, -310.0), velocity_mps=(25.0, 0.0, 0.0)),
        replace(STAYING, position_m=(400.0, 0.0, -300.0)),
    ],
    ids=["flies towards us", "flies with us", "away from the item"],
)
def test_a_track_that_does_not_block_the_item_is_avoided_as_usual(track: Track) -> None:
    assert past(flight(), track) is None


def test_with_another_conflict_and_to_a_circle_it_is_not_passed() -> None:
    other = replace(STAYING, track_id="O", position_m=(800.0, 100.0, -300.0), velocity_mps=(-30.0, 0.0, 0.0))
    assert past(flight(), STAYING, other) is None
    assert past(flight(replace(GOAL, loiter_radius_m=80.0)), STAYING) is None
    assert past(flight(Goal(course_rad=0.0, altitude_m=300.0)), STAYING) is None


def test_within_the_turning_circle_the_aircraft_first_flies_on() -> None:
    beside = flight(height_m=UNDER_M, course_rad=1.2, north_m=1150.0)
    guidance = past(beside, STAYING)
    assert guidance is not None
    assert guidance.course_rad == pytest.approx(1.2)


def test_it_is_flown_only_where_it_keeps_clear_and_is_not_refused() -> None:
    at_height, level = flight(height_m=UNDER_M), flight()
    constraints = Constraints(ENVELOPE, None, Refusals(), 1.2)
    guidance = past(at_height, STAYING)
    assert guidance is not None
    assert keeps_clear(guidance, at_height, assessed(at_height, STAYING), constraints)
    near = replace(STAYING, position_m=(750.0, 0.0, -310.0))
    assert not keeps_clear(guidance, level, assessed(level, near), constraints), "entered before it is low"
    refused = Refusals().adding(Control.HEIGHT, guidance.altitude_m, 0.0)
    assert not keeps_clear(
        guidance, at_height, assessed(at_height, STAYING), constraints._replace(refusals=refused)
    )
