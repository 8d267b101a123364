"""What is made of a survey: when the volume counts as lost, and what is told of the threats."""

import math

import pytest

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.assess import mission_mps, mission_of, own_state, take, tracks_at
from companion.avoidance.cone import TransitionDomain
from companion.avoidance.cost import Situation, price
from companion.avoidance.cost_context import conflict
from companion.avoidance.outer import OuterMethod
from companion.avoidance.params import Layers
from companion.avoidance.trajectory import HORIZON_S, Commands, Tracks
from companion.model import Goal, Guidance, Ownship, Threat, Track, TrafficKind

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
HEAD_ON = Track("A", 0.0, (2000.0, 0.0, -300.0), (-50.0, 0.0, 0.0))


def situation(params: AvoidanceParams, track: Track = HEAD_ON) -> Situation:
    state = own_state(0.0, OWN)
    mission, tracks = mission_of(state, OWN, GOAL), tracks_at(0.0, [track], params, GOAL)
    survey = take(
        state,
        mission,
        mission_mps(state, mission),
        tracks,
        params,
        params.envelope,
        TransitionDomain(0.0),
        horizon_s=HORIZON_S,
        spare=0.0,
        avoiding=False,
    )
    assert survey.conflict.all()
    return conflict(state, mission, survey, GOAL, params, params.envelope)


def test_a_volume_counts_as_lost_a_little_before_its_edge() -> None:
    params = AvoidanceParams(horizontal_margin=0.2, vertical_margin=0.3, lost_margin=0.05)
    assert situation(params).lost == pytest.approx(1.05 / 1.2)


def test_but_never_before_the_margin_begins() -> None:
    params = AvoidanceParams(horizontal_margin=0.0, vertical_margin=0.3, lost_margin=0.05)
    assert situation(params).lost == 1.0


def threat(track: Track) -> Threat:
    return Avoider(AvoidanceParams()).decide(0.0, OWN, [track], GOAL).threats[0]


@pytest.mark.parametrize(("down_m", "miss_m"), [(-330.0, 0.0), (-270.0, 30.0)])
def test_nothing_flies_under_a_mast(down_m: float, miss_m: float) -> None:
    mast = Track("M", 0.0, (600.0, 10.0, down_m), (0.0, 0.0, 0.0), kind=TrafficKind.OBSTACLE)
    assert threat(mast).miss_vertical_m == pytest.approx(miss_m)


def test_a_threat_is_told_where_it_is_and_how_near_the_mission_would_come() -> None:
    crossing = Track("A", 0.0, (1000.0, 1500.0, -320.0), (0.0, -30.0, -0.5), icao=0xABCDEF)
    told = threat(crossing)
    assert (told.track_id, told.icao) == ("A", 0xABCDEF)
    assert told.distance_m == pytest.approx(math.hypot(1000.0, 1500.0))
    assert told.relative_altitude_m == pytest.approx(20.0)
    assert told.bearing_rad == pytest.approx(math.atan2(1500.0, 1000.0))
    closest_s = (1000.0 * 22.0 + 1500.0 * 30.0) / (22.0**2 + 30.0**2)
    assert told.time_to_closest_s == pytest.approx(closest_s)
    north_m, east_m = 1000.0 - 22.0 * closest_s, 1500.0 - 30.0 * closest_s
    assert told.miss_horizontal_m == pytest.approx(math.hypot(north_m, east_m))
    assert told.miss_vertical_m == pytest.approx(20.0 + 0.5 * closest_s)


@pytest.mark.parametrize(
    ("distance_m", "early"), [(4900.0, 1.0), (2880.0, 0.5), (1400.0, 0.0), (-400.0, 0.0)]
)
def test_there_is_time_while_the_closest_approach_is_far_off(distance_m: float, early: float) -> None:
    coming = Track("A", 0.0, (distance_m, 0.0, -300.0), (-50.0, 0.0, 0.0))
    assert situation(AvoidanceParams(), coming).early == pytest.approx(early)


def test_a_change_of_mind_costs_twice_as_much_while_there_is_time() -> None:
    held, other = Guidance(0.5, 22.0, 300.0), Guidance(-0.5, 22.0, 300.0)
    soon = situation(AvoidanceParams())._replace(early=0.0, mission_then_m=None)
    costs = [
        price(one, Commands.of([other]), Tracks.none(), held).cost for one in (soon, soon._replace(early=1.0))
    ]
    assert costs[1] - costs[0] == pytest.approx([0.0, soon.weights.switch])


@pytest.mark.parametrize(("method", "repels"), [(OuterMethod.FIELD, True), (OuterMethod.CONE, False)])
def test_who_flies_beside_us_repels_in_the_plain_field_alone(method: OuterMethod, repels: bool) -> None:
    """Within reach, but in no cone: then only who is in conflict repels."""
    params = AvoidanceParams(outer_method=method, layers=Layers.OUTER)
    beside = Track("B", 0.0, (0.0, 1200.0, -300.0), (22.0, 0.0, 0.0))
    alone, both = (
        Avoider(params).decide(0.0, OWN, tracks, GOAL).guidance for tracks in ([HEAD_ON], [HEAD_ON, beside])
    )
    assert alone is not None
    assert both is not None
    assert (both.course_rad != alone.course_rad) is repels
