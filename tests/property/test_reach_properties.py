"""The fast path agrees with the full assessment about tracks that are out of reach or fly past."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams
from companion.avoidance.assess import (
    TrafficAssessment,
    assess_traffic,
    needs_no_assessment,
    protected_tracks,
)
from companion.avoidance.intruders import TransitionDomain, half_angle_rad
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.policies import policy_of
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


def both_ways(
    own: Ownship, goal: Goal, tracks: list[Track], entered: tuple[str, ...] = ()
) -> tuple[bool, TrafficAssessment]:
    """The result of the fast path, and the full assessment; some cones have been entered before."""
    flight, policy = OwnFlight.at(0.0, own, goal), policy_of(PARAMS)
    domain = TransitionDomain(policy.outer.widening_rad)
    domain.keep(entered, np.ones(len(entered), dtype=bool))
    is_clear = needs_no_assessment(flight, 0.0, tracks, PARAMS, domain)
    predicted = protected_tracks(0.0, tracks, PARAMS)
    return is_clear, assess_traffic(flight, predicted, PARAMS, PARAMS.envelope, policy, domain)


@given(st.integers(0, 2**32 - 1), st.booleans(), st.booleans())
def test_the_fast_path_finds_what_the_assessment_finds(seed: int, turns: bool, before: bool) -> None:
    rng = np.random.default_rng(seed)
    tracks = [some_track(rng, turns) for _ in range(rng.integers(1, 4))]
    course_rad, speed_mps = float(rng.uniform(-3.0, 3.0)), float(rng.uniform(15.0, 30.0))
    velocity = (speed_mps * np.cos(course_rad), speed_mps * np.sin(course_rad), 0.0)
    own = Ownship(0.0, (0.0, 0.0, -300.0), velocity, speed_mps, course_rad)
    goal = Goal(course_rad=float(rng.uniform(-3.0, 3.0)), airspeed_mps=22.0, altitude_m=300.0)
    entered = tuple(track.track_id for track in tracks[:1]) if before else ()
    is_clear, assessment = both_ways(own, goal, tracks, entered)
    motion, surface_m = assessment.motion, assessment.surface_m
    beta_rad = half_angle_rad(motion.distance_m, assessment.tracks.protected_horizontal_m)
    beta_rad[: len(entered)] += PARAMS.delta_beta_rad
    in_cone = (surface_m < assessment.outer_reach_m) & (np.abs(motion.approach_rad) <= beta_rad)
    if turns:
        assert not is_clear, "a turning track may turn towards us"
    else:
        assert is_clear == (not (in_cone | (surface_m < assessment.inner_reach_m)).any())
    assert not (is_clear and assessment.conflict.any())


@pytest.mark.parametrize(
    ("distance_m", "speed_mps", "is_clear"),
    [
        (0.99 * (60.0 * 72.0 + 1.15 * 609.6), -50.0, False),
        (1.01 * (60.0 * 72.0 + 1.15 * 609.6), -50.0, True),
        (0.99 * (1500.0 + 1.15 * 609.6), 21.0, False),
        (1.01 * (1500.0 + 1.15 * 609.6), 21.0, True),
        (0.99 * (1500.0 + 1.15 * 609.6), 50.0, True),  # faster than we are
    ],
)
def test_the_reach_is_that_of_the_outer_layer(distance_m: float, speed_mps: float, is_clear: bool) -> None:
    own = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
    track = Track("A", 0.0, (distance_m, 0.0, -300.0), (speed_mps, 0.0, 0.0))
    goal = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
    assert both_ways(own, goal, [track])[0] is is_clear
