"""What is made of a survey: when the volume counts as lost."""

import pytest

from companion.avoidance import AvoidanceParams
from companion.avoidance.cone import TransitionDomain
from companion.avoidance.prediction import HORIZON_S
from companion.avoidance.pricing import Situation
from companion.avoidance.situations import conflict
from companion.avoidance.survey import mission_of, own_state, take, tracks_at
from companion.model import Goal, Ownship, Track

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
HEAD_ON = Track("A", 0.0, (2000.0, 0.0, -300.0), (-50.0, 0.0, 0.0))


def situation(params: AvoidanceParams) -> Situation:
    state = own_state(0.0, OWN)
    mission, tracks = mission_of(state, OWN, GOAL), tracks_at(0.0, [HEAD_ON], params, GOAL)
    survey = take(
        state,
        mission,
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
