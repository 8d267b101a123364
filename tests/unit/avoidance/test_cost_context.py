"""The context of a conflict: the separation that counts as a breach, and earliness."""

import pytest

from companion.avoidance import AvoidanceParams
from companion.avoidance.assess import assess_traffic, protected_tracks
from companion.avoidance.constraints import Constraints, Refusals
from companion.avoidance.cost import CostContext, conflict_context, evaluate_rows
from companion.avoidance.intruders import Tracks, TransitionDomain
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.policies import policy_of
from companion.avoidance.trajectory import Commands
from companion.model import Goal, Guidance, Ownship, Track

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
HEAD_ON = Track("A", 0.0, (2000.0, 0.0, -300.0), (-50.0, 0.0, 0.0))


def context_of(params: AvoidanceParams, track: Track = HEAD_ON) -> CostContext:
    flight, tracks = OwnFlight.at(0.0, OWN, GOAL), protected_tracks(0.0, [track], params)
    domain, policy = TransitionDomain(0.0), policy_of(params)
    assessment = assess_traffic(flight, tracks, params, params.envelope, policy, domain)
    assert assessment.conflict.all()
    constraints = Constraints(params.envelope, None, Refusals(), params.fence_look_ahead_turns)
    return conflict_context(flight, assessment, params, constraints, prefers_turns=False, overtime=0.0)


def test_a_volume_counts_as_entered_a_little_before_its_edge() -> None:
    params = AvoidanceParams(horizontal_margin=0.2, vertical_margin=0.3, lost_margin=0.05)
    assert context_of(params).breach_ratio == pytest.approx(1.05 / 1.2)


def test_a_volume_never_counts_as_entered_outside_its_margin() -> None:
    params = AvoidanceParams(horizontal_margin=0.0, vertical_margin=0.3, lost_margin=0.05)
    assert context_of(params).breach_ratio == 1.0


@pytest.mark.parametrize(
    ("distance_m", "earliness"), [(4900.0, 1.0), (2880.0, 0.5), (1400.0, 0.0), (-400.0, 0.0)]
)
def test_earliness_falls_from_1_to_0_as_the_closest_approach_gets_near(
    distance_m: float, earliness: float
) -> None:
    coming = Track("A", 0.0, (distance_m, 0.0, -300.0), (-50.0, 0.0, 0.0))
    assert context_of(AvoidanceParams(), coming).earliness == pytest.approx(earliness)


def test_switching_costs_twice_as_much_while_the_closest_approach_is_far_off() -> None:
    last, other = Guidance(0.5, 22.0, 300.0), Guidance(-0.5, 22.0, 300.0)
    near = context_of(AvoidanceParams())._replace(earliness=0.0, mission_at_passed_m=None)
    costs = [
        evaluate_rows(context, Commands.of([other]), Tracks.none(), last).cost
        for context in (near, near._replace(earliness=1.0))
    ]
    assert costs[1] - costs[0] == pytest.approx([0.0, near.weights.switch])
