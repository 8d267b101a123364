"""Every variant of the avoidance commands only guidance within the limits."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.cost import CostContext
from companion.avoidance.inner import StrategyTable
from companion.avoidance.params import CostWeights
from companion.avoidance.senses import WrongWays
from companion.avoidance.trajectory import ALL_CONTROLS, Commands, Control, OwnState, Pace, fly_ahead
from companion.model import Goal, Guidance, Ownship, Track, Vec3
from companion.units import STANDARD_GRAVITY_MPS2
from tests.support.avoidance_cases import (
    ALL_VARIANTS,
    ENVELOPE,
    PARAMS,
    TIMES_S,
    Case,
    cases,
    variant_name,
    within_limits,
)


@pytest.mark.parametrize("params", ALL_VARIANTS, ids=variant_name)
@settings(max_examples=8, deadline=None, derandomize=True)
@given(case=cases(), airspeed_mps=st.floats(5.0, 45.0), altitude_m=st.floats(-100.0, 900.0))
def test_every_variant_commands_only_guidance_within_the_limits(
    params: AvoidanceParams, case: Case, airspeed_mps: float, altitude_m: float
) -> None:
    """Not even if the mission itself requires it."""
    own, tracks, goal = case
    unflyable = replace(goal, airspeed_mps=airspeed_mps, altitude_m=altitude_m)
    decision = Avoider(params).decide(0.0, own, tracks, unflyable)
    assert decision.guidance is None or within_limits(decision.guidance)


def random_context(seed: int) -> CostContext:
    chance = np.random.default_rng(seed)
    own = OwnState(
        (chance.uniform(-1e4, 1e4), chance.uniform(-1e4, 1e4), -chance.uniform(100.0, 600.0)),
        chance.uniform(-math.pi, math.pi),
        chance.uniform(ENVELOPE.min_airspeed_mps, ENVELOPE.max_airspeed_mps),
        chance.uniform(-ENVELOPE.max_sink_mps, ENVELOPE.max_climb_mps),
        (0.0, 0.0),
    )
    return CostContext(
        own=own,
        mission=Guidance(chance.uniform(0.0, 6.28), chance.uniform(5.0, 40.0), chance.uniform(-100.0, 900.0)),
        over_m=chance.uniform(0.0, 1500.0),
        under_m=chance.uniform(-500.0, 600.0),
        wrong=WrongWays(*map(bool, chance.integers(0, 2, 4))),
        horizon_s=90.0,
        goal_distance=1.0,
        breach_ratio=0.87,
        envelope=ENVELOPE,
        weights=CostWeights(),
        rule_course_rad=chance.uniform(0.0, 6.28),
        rule_pace=list(Pace)[chance.integers(3)],
    )


@pytest.mark.parametrize(
    "controls", [frozenset(some) for n in range(4) for some in itertools.combinations(Control, n)], ids=len
)
@pytest.mark.parametrize("seed", range(4))
def test_every_row_of_the_table_is_within_the_limits(seed: int, controls: frozenset[Control]) -> None:
    context = random_context(seed)
    commands = StrategyTable.within(controls).commands(context)
    paths, steps_s = fly_ahead(context.own, commands, ENVELOPE), np.diff(TIMES_S)
    middles_s = TIMES_S[:-1] + 0.5 * steps_s
    for row in range(len(commands)):
        guidance, path_m = commands.row(row), paths.row_m(row)
        assert within_limits(guidance)
        legs_m = np.diff(path_m, axis=0)
        course_rad = np.unwrap(
            np.concatenate([[context.own.course_rad], np.arctan2(legs_m[:, 1], legs_m[:, 0])])
        )
        between_s = np.diff(np.concatenate([[0.0], middles_s]))
        assert (
            np.abs(np.diff(course_rad))
            <= ENVELOPE.turn_rate_radps(context.own.airspeed_mps) * between_s + 1e-9
        ).all()
        climb_mps = -legs_m[:, 2] / steps_s
        assert climb_mps.max() <= ENVELOPE.max_climb_mps + 1e-9
        assert climb_mps.min() >= -ENVELOPE.max_sink_mps - 1e-9
        speed_mps = np.hypot(legs_m[:, 0], legs_m[:, 1]) / steps_s
        gained_mps = np.abs(speed_mps - context.own.airspeed_mps)
        assert (gained_mps <= ENVELOPE.max_acceleration_mps2 * middles_s + 1e-6).all()
        assert speed_mps[-1] == pytest.approx(guidance.airspeed_mps)


def test_a_turn_with_increasing_speed_is_predicted_within_the_bank_limit() -> None:
    """Half a circle to the right (eq. 11) at V_max (eq. 13) from 17 m/s: a fixed rate would overbank."""
    own = OwnState((0.0, 0.0, -300.0), 0.0, 17.0, 0.0, (0.0, 0.0))
    path_m = fly_ahead(own, Commands.of([Guidance(math.radians(179.0), 28.0, 300.0)]), ENVELOPE).row_m(0)
    legs_m, steps_s = np.diff(path_m, axis=0), np.diff(TIMES_S)
    course_rad = np.unwrap(np.arctan2(legs_m[:, 1], legs_m[:, 0]))
    rate_radps = np.abs(np.diff(course_rad)) / np.diff(TIMES_S[:-1] + 0.5 * steps_s)
    speed_mps = np.hypot(legs_m[:, 0], legs_m[:, 1]) / steps_s
    bank_rad = np.arctan(rate_radps * np.minimum(speed_mps[1:], speed_mps[:-1]) / STANDARD_GRAVITY_MPS2)
    assert bank_rad.max() <= ENVELOPE.max_bank_rad + math.radians(1.0)


def test_limits_that_change_in_a_conflict_are_kept_from_then_on() -> None:
    own = Ownship(0.0, (0.0, 0.0, -300.0), (24.0, 0.0, 0.0), 24.0, 0.0, (0.0, 0.0))
    threat = Track("T", 0.0, (600.0, 0.0, -300.0), (-10.0, 0.0, 0.0), protected_horizontal_m=300.0)
    avoider, goal = Avoider(PARAMS), Goal(0.0, 24.0, 300.0)
    assert avoider.decide(0.0, own, [threat], goal).guidance is not None
    avoider.envelope = replace(ENVELOPE, max_airspeed_mps=20.0, min_altitude_m=350.0)
    guidance = avoider.decide(0.0, own, [threat], goal).guidance
    assert guidance is not None
    assert within_limits(guidance, avoider.envelope)


@pytest.mark.parametrize("params", ALL_VARIANTS, ids=variant_name)
@settings(max_examples=8, deadline=None, derandomize=True)
@given(case=cases(), altitude_m=st.sampled_from([20.0, 95.0, 640.0, 1200.0]))
def test_below_the_floor_or_above_the_ceiling_every_guidance_leads_back(
    params: AvoidanceParams, case: Case, altitude_m: float
) -> None:
    own, tracks, goal = case

    def lifted(place: Vec3) -> Vec3:
        return (place[0], place[1], place[2] + 300.0 - altitude_m)

    own = replace(own, position_m=lifted(own.position_m))
    tracks = [replace(track, position_m=lifted(track.position_m)) for track in tracks]
    decision = Avoider(params).decide(0.0, own, tracks, replace(goal, altitude_m=altitude_m))
    assert decision.guidance is None or within_limits(decision.guidance)


@pytest.mark.parametrize("altitude_m", [20.0, 640.0])
@pytest.mark.parametrize("seed", range(4))
def test_no_row_moves_further_beyond_the_floor_or_ceiling(altitude_m: float, seed: int) -> None:
    context = random_context(seed)
    own = context.own._replace(position_m=(0.0, 0.0, -altitude_m), climb_mps=0.0)
    rows = StrategyTable.within(ALL_CONTROLS).commands(context._replace(own=own))
    heights_m = fly_ahead(own, rows, ENVELOPE).altitude_m
    steps_m = np.diff(heights_m, axis=1)
    assert (steps_m >= -1e-9).all() if altitude_m < 100.0 else (steps_m <= 1e-9).all()
    assert ((heights_m[:, -1] >= 100.0 - 1e-9) & (heights_m[:, -1] <= 600.0 + 1e-9)).all()


def test_the_floor_may_rise_above_the_aircraft_in_flight() -> None:
    own = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0, (0.0, 0.0))
    threat = Track("T", 0.0, (2500.0, 0.0, -300.0), (-40.0, 0.0, 0.0))
    avoider, goal = Avoider(AvoidanceParams()), Goal(0.0, 22.0, 300.0)
    for now_s, floor_m in enumerate((100.0, 250.0, 340.0, 420.0, 380.0)):
        avoider.envelope = replace(ENVELOPE, min_altitude_m=floor_m)
        seen = replace(threat, time_s=now_s)
        guidance = avoider.decide(now_s, replace(own, time_s=now_s), [seen], goal).guidance
        assert guidance is not None
        assert guidance.altitude_m >= floor_m
    avoider.envelope = replace(ENVELOPE, min_altitude_m=500.0)
    guidance = avoider.decide(5.0, replace(own, time_s=5.0), [], goal).guidance
    assert guidance is not None
    assert guidance.altitude_m >= 500.0, "also while holding before the return"
