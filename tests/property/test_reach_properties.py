"""Who is out of reach is told in plain numbers: it must be what the survey in arrays finds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams
from companion.avoidance.cone import TransitionDomain
from companion.avoidance.prediction import HORIZON_S
from companion.avoidance.survey import (
    Survey,
    mission_mps,
    mission_of,
    out_of_reach,
    own_state,
    take,
    tracks_at,
)
from companion.model import Goal, Ownship, Track, TrafficKind

PARAMS = AvoidanceParams()


def some_track(rng: np.random.Generator, turns: bool) -> Track:
    kind = TrafficKind.OBSTACLE if rng.random() < 0.2 else TrafficKind.AIRCRAFT
    north_m, east_m = rng.normal(0.0, 5000.0, 2).tolist()
    north_mps, east_mps = (0.0, 0.0) if kind is TrafficKind.OBSTACLE else rng.normal(0.0, 40.0, 2).tolist()
    return Track(
        str(rng.integers(1 << 30)),
        float(rng.uniform(-2.0, 0.0)),
        (north_m, east_m, -300.0),
        (north_mps, east_mps, 0.0),
        kind=kind,
        protected_horizontal_m=float(rng.uniform(0.0, 1500.0)) if rng.random() < 0.3 else None,
        turn_radps=float(rng.normal(0.0, 0.05)) if turns else 0.0,
    )


def surveyed(own: Ownship, goal: Goal, tracks: list[Track]) -> tuple[bool, Survey]:
    """Whether all are out of reach, and what is surveyed."""
    state = own_state(0.0, own)
    mission = mission_of(state, own, goal)
    onward_mps = mission_mps(state, mission)
    survey = take(
        state,
        mission,
        onward_mps,
        tracks_at(0.0, tracks, PARAMS, goal),
        PARAMS,
        PARAMS.envelope,
        TransitionDomain(PARAMS.delta_beta_rad),
        horizon_s=HORIZON_S,
        spare=0.0,
        avoiding=False,
    )
    return out_of_reach(state, onward_mps, 0.0, tracks, PARAMS), survey


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_who_is_out_of_reach_is_what_the_survey_finds(seed: int, turns: bool) -> None:
    rng = np.random.default_rng(seed)
    tracks = [some_track(rng, turns) for _ in range(rng.integers(1, 4))]
    course_rad, speed_mps = float(rng.uniform(-3.0, 3.0)), float(rng.uniform(15.0, 30.0))
    velocity = (speed_mps * np.cos(course_rad), speed_mps * np.sin(course_rad), 0.0)
    own = Ownship(0.0, (0.0, 0.0, -300.0), velocity, speed_mps, course_rad)
    goal = Goal(course_rad=float(rng.uniform(-3.0, 3.0)), airspeed_mps=22.0, altitude_m=300.0)
    away, survey = surveyed(own, goal, tracks)
    reached = (survey.surface_m < survey.outer_reach_m) | (survey.surface_m < survey.inner_reach_m)
    if turns:
        assert not away, "he may turn towards us"
    else:
        assert away == (not reached.any())
    assert not (away and survey.conflict.any())


@pytest.mark.parametrize(
    ("distance_m", "speed_mps", "away"),
    [
        (0.99 * (60.0 * 72.0 + 1.15 * 609.6), -50.0, False),
        (1.01 * (60.0 * 72.0 + 1.15 * 609.6), -50.0, True),
        (0.99 * (1500.0 + 1.15 * 609.6), 50.0, False),
        (1.01 * (1500.0 + 1.15 * 609.6), 50.0, True),
    ],
)
def test_the_reach_is_that_of_the_outer_layer(distance_m: float, speed_mps: float, away: bool) -> None:
    own = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
    track = Track("A", 0.0, (distance_m, 0.0, -300.0), (speed_mps, 0.0, 0.0))
    assert surveyed(own, Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0), [track])[0] is away
