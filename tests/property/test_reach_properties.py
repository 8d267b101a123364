"""Who is out of reach, or flies past, is told in plain numbers: it must be what the survey finds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams
from companion.avoidance.assess import (
    Survey,
    mission_mps,
    mission_of,
    own_state,
    plainly_clear,
    take,
    tracks_at,
)
from companion.avoidance.cone import TransitionDomain, half_angle_rad
from companion.avoidance.trajectory import HORIZON_S
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


def surveyed(
    own: Ownship, goal: Goal, tracks: list[Track], entered: tuple[str, ...] = ()
) -> tuple[bool, Survey]:
    """Whether all are plainly clear, and what is surveyed; in some cones we were before."""
    state = own_state(0.0, own)
    mission = mission_of(state, own, goal)
    onward_mps = mission_mps(state, mission)
    domain = TransitionDomain(PARAMS.delta_beta_rad)
    domain.keep(entered, np.ones(len(entered), dtype=bool))
    away = plainly_clear(state, onward_mps, 0.0, tracks, PARAMS, domain)
    survey = take(
        state,
        mission,
        onward_mps,
        tracks_at(0.0, tracks, PARAMS, goal),
        PARAMS,
        PARAMS.envelope,
        domain,
        horizon_s=HORIZON_S,
        spare=0.0,
        avoiding=False,
    )
    return away, survey


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans())
def test_who_is_plainly_clear_is_what_the_survey_finds(seed: int, turns: bool, before: bool) -> None:
    rng = np.random.default_rng(seed)
    tracks = [some_track(rng, turns) for _ in range(rng.integers(1, 4))]
    course_rad, speed_mps = float(rng.uniform(-3.0, 3.0)), float(rng.uniform(15.0, 30.0))
    velocity = (speed_mps * np.cos(course_rad), speed_mps * np.sin(course_rad), 0.0)
    own = Ownship(0.0, (0.0, 0.0, -300.0), velocity, speed_mps, course_rad)
    goal = Goal(course_rad=float(rng.uniform(-3.0, 3.0)), airspeed_mps=22.0, altitude_m=300.0)
    entered = tuple(track.track_id for track in tracks[:1]) if before else ()
    away, survey = surveyed(own, goal, tracks, entered)
    motion, tracked = survey.motion, survey.tracks
    beta_rad = half_angle_rad(motion.distance_m, tracked.protected_horizontal_m)
    beta_rad[: len(entered)] += PARAMS.delta_beta_rad
    at_us = (survey.surface_m < survey.outer_reach_m) & (np.abs(motion.approach_rad) <= beta_rad)
    if turns:
        assert not away, "he may turn towards us"
    else:
        assert away == (not (at_us | (survey.surface_m < survey.inner_reach_m)).any())
    assert not (away and survey.conflict.any())


@pytest.mark.parametrize(
    ("distance_m", "speed_mps", "away"),
    [
        (0.99 * (60.0 * 72.0 + 1.15 * 609.6), -50.0, False),
        (1.01 * (60.0 * 72.0 + 1.15 * 609.6), -50.0, True),
        (0.99 * (1500.0 + 1.15 * 609.6), 21.0, False),
        (1.01 * (1500.0 + 1.15 * 609.6), 21.0, True),
        (0.99 * (1500.0 + 1.15 * 609.6), 50.0, True),  # he is faster than we are
    ],
)
def test_the_reach_is_that_of_the_outer_layer(distance_m: float, speed_mps: float, away: bool) -> None:
    own = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
    track = Track("A", 0.0, (distance_m, 0.0, -300.0), (speed_mps, 0.0, 0.0))
    assert surveyed(own, Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0), [track])[0] is away
