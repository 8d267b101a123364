"""The cost of rows against brute force, track by track and time by time."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from companion.avoidance import Control
from companion.avoidance.cost import CostContext, EvaluatedRows, evaluate_rows
from companion.avoidance.inner import TABLE, StrategyTable
from companion.avoidance.intruders import Tracks, separation
from companion.avoidance.params import CostWeights
from companion.avoidance.trajectory import HORIZON_S, Array, Commands, OwnState, fly_ahead
from companion.model import Guidance
from tests.support.avoidance_cases import ENVELOPE, TIMES_S, make_context, one_track, random_tracks

CONTROLS = [frozenset(some) for count in range(4) for some in combinations(Control, count)]
NORTHBOUND = OwnState((0.0, 0.0, -300.0), 0.0, 22.0, 0.0, (0.0, 0.0))
NORTH = Guidance(0.0, 22.0, 300.0)


def evaluate_table(
    context: CostContext,
    tracks: Tracks,
    last_guidance: Guidance | None = None,
    controls: frozenset[Control] = frozenset(Control),
) -> EvaluatedRows:
    return evaluate_rows(context, StrategyTable.within(controls).commands(context), tracks, last_guidance)


def ratios(path_m: Array, tracks: Tracks, n: int) -> Array:
    """Separation from track `n` along one path, in protected volumes, (T,)."""
    offset = path_m - (tracks.position_m[n] + tracks.velocity_mps[n] * TIMES_S[:, None])
    horizontal = np.hypot(offset[:, 0], offset[:, 1]) / tracks.protected_horizontal_m[n]
    below = offset[:, 2]  # a grounded volume reaches down to the ground
    apart = np.maximum(-below, 0.0) if tracks.grounded[n] else np.abs(below)
    larger: Array = np.maximum(horizontal, apart / tracks.protected_vertical_m[n])
    return larger


def buffer_depth(ratio: float, protected_m: float, buffer_m: float) -> float:
    """1 at the volume and within it, 0 at the outer edge of the buffer and beyond, linear between."""
    into_m = buffer_m - (ratio - 1.0) * protected_m
    return min(max(into_m / buffer_m, 0.0), 1.0)


def brute_force_cost(row: Guidance, context: CostContext, tracks: Tracks) -> float:
    """The cost of a row as the comments of `CostWeights` describe it."""
    weights = context.weights
    path_m = fly_ahead(context.own, Commands.of([row]), context.envelope).row_m(0)
    cost, worst_buffer = 0.0, 0.0
    for n in range(len(tracks)):
        ratio = ratios(path_m, tracks, n)
        closest = min(ratio)
        cost += weights.margin * max(1.0 - closest, 0.0)
        if closest < context.breach_ratio:
            cost += weights.loss + weights.depth * (context.breach_ratio - closest)
        in_buffer = 0.0
        for i, step_s in enumerate(np.diff(TIMES_S)):
            share = step_s / HORIZON_S
            cost += weights.exposure * share * max(1.0 - ratio[i + 1], 0.0)
            if weights.nearness > 0.0:
                in_buffer += share * buffer_depth(
                    ratio[i + 1], tracks.protected_horizontal_m[n], tracks.buffer_m[n]
                )
        worst_buffer = max(worst_buffer, in_buffer)
    cost += weights.nearness * worst_buffer
    turn = abs(math.remainder(row.course_rad - context.own.course_rad, 2.0 * math.pi))
    off = math.remainder(row.course_rad - context.mission.course_rad, 2.0 * math.pi)
    cost += weights.turn * turn / math.pi + weights.deviation * abs(off) / math.pi
    cost += weights.speed * abs(row.airspeed_mps - context.mission.airspeed_mps) / 10.0
    cost += weights.height * abs(row.altitude_m - context.mission.altitude_m) / 100.0
    cost += weights.descent if row.altitude_m < context.mission.altitude_m - 1.0 else 0.0
    if context.prefers_turns and abs(row.altitude_m - context.mission.altitude_m) > 5.0:
        cost += weights.spared_height
    left, right = off < -math.radians(1.0), off > math.radians(1.0)
    cost += weights.wrong_side * ((context.wrong.left and left) or (context.wrong.right and right))
    up_m = row.altitude_m - context.mission.altitude_m
    cost += weights.wrong_sense * ((context.wrong.up and up_m > 5.0) or (context.wrong.down and up_m < -5.0))
    return cost


@pytest.mark.parametrize("nearness", [0.0, 10.0])
@pytest.mark.parametrize("seed", range(6))
def test_every_cost_is_that_of_brute_force(seed: int, nearness: float) -> None:
    context = make_context(weights=CostWeights(nearness=nearness), prefers_turns=seed % 2 == 1)
    tracks = random_tracks(np.random.default_rng(seed), 3, buffer_m=300.0)
    rows = evaluate_table(context, tracks)
    for row in range(0, len(TABLE), 11):
        wanted = brute_force_cost(rows.commands.row(row), context, tracks)
        assert rows.cost[row] == pytest.approx(wanted, abs=5e-3)


@pytest.mark.parametrize("controls", CONTROLS, ids=lambda some: "+".join(sorted(some)) or "none")
@pytest.mark.parametrize("seed", range(3))
def test_the_best_row_is_the_cheapest(seed: int, controls: frozenset[Control]) -> None:
    context, tracks = make_context(), random_tracks(np.random.default_rng(seed), 2)
    rows = evaluate_table(context, tracks, controls=controls)
    every = [rows.commands.row(row) for row in range(len(rows.commands))]
    cheapest = min(brute_force_cost(row, context, tracks) for row in every)
    assert brute_force_cost(rows.best_guidance, context, tracks) == pytest.approx(cheapest, abs=5e-3)


def test_the_first_of_rows_with_equal_cost_is_best() -> None:
    """On the mission's course a turn by 0 degrees is the same as the mission's own row, which comes first."""
    mission = make_context().mission
    context = make_context(own=make_context().own._replace(course_rad=mission.course_rad))
    far = replace(random_tracks(np.random.default_rng(1), 1), position_m=np.array([[9e4, 9e4, -300.0]]))
    assert evaluate_table(context, far).best == 0
    assert TABLE[0].controls == frozenset()


def test_all_rows_except_the_last_guidance_cost_a_switch() -> None:
    context, tracks = make_context(), random_tracks(np.random.default_rng(2), 2)
    last = Guidance(0.7, 20.0, 350.0)
    fresh, continued = evaluate_table(context, tracks), evaluate_table(context, tracks, last)
    assert continued.commands.row(0) == last
    assert continued.cost[0] == pytest.approx(brute_force_cost(last, context, tracks), abs=5e-3)
    for row in range(len(fresh.cost)):
        guidance = fresh.commands.row(row)
        # Between the mission and the last guidance, in course (10 to 40.1 degrees) and height (320 to 350 m).
        eases = 8.0 <= math.degrees(guidance.course_rad) <= 42.2 and 315.0 <= guidance.altitude_m <= 355.0
        switch = context.weights.ease if eases else context.weights.switch
        assert continued.cost[1 + row] == pytest.approx(fresh.cost[row] + switch), guidance


@pytest.mark.parametrize("seed", range(8))
def test_nearness_is_the_mean_depth_in_the_buffer(seed: int) -> None:
    context, tracks = make_context(), random_tracks(np.random.default_rng(seed), 4, buffer_m=400.0)
    row = Guidance(math.radians(60.0), 25.0, 300.0)
    paths = fly_ahead(context.own, Commands.of([row]), ENVELOPE)
    nearness = separation(paths, tracks, buffers=True).nearness
    for n in range(4):
        wanted = sum(
            step_s / HORIZON_S * buffer_depth(ratio, tracks.protected_horizontal_m[n], 400.0)
            for step_s, ratio in zip(np.diff(TIMES_S), ratios(paths.row_m(0), tracks, n)[1:], strict=True)
        )
        assert nearness[0, n] == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize(("miss_share", "is_entered"), [(0.999, True), (1.001, False)])
def test_entering_the_bare_volume_has_a_flat_price(miss_share: float, is_entered: bool) -> None:
    """The bare volume has a radius of 200 m; with its margin of 15 percent it is 230 m."""
    context = make_context(own=NORTHBOUND, mission=NORTH, weights=CostWeights(margin=0.0, exposure=0.0))
    beside = one_track((0.0, 200.0 * miss_share, -300.0), (22.0, 0.0, 0.0), 230.0, 50.0)
    cost = evaluate_table(context, beside, controls=frozenset()).cost[0]
    assert cost == pytest.approx(context.weights.loss if is_entered else 0.0, abs=0.5)


def test_nothing_beyond_the_horizon_costs() -> None:
    """The head-on threat is met after 50 s, when the shorter flight has ended."""
    context = make_context(own=NORTHBOUND, mission=NORTH)
    threat = one_track((2200.0, 0.0, -300.0), (-22.0, 0.0, 0.0), 200.0, 50.0)
    assert evaluate_table(context, threat).cost[0] > 100.0
    assert evaluate_table(context._replace(horizon_s=40.0), threat).cost[0] == 0.0


def test_a_row_beside_a_threat_leaves_it_unresolved() -> None:
    """A slower threat crosses from the left: turning along with it keeps as clear as passing behind it."""
    threat = one_track((1200.0, -1200.0, -300.0), (0.0, 20.0, 0.0), 700.0, 95.0)
    context = make_context(own=NORTHBOUND, mission=NORTH, passed_s=75.0)
    context = context._replace(mission_at_passed_m=np.array([22.0 * 75.0, 0.0]))
    rows = Commands.of([Guidance(math.radians(deg), 22.0, 300.0) for deg in (90.0, -90.0)])
    cost = {
        unresolved: evaluate_rows(
            context._replace(weights=replace(context.weights, unresolved=unresolved)), rows, threat, None
        ).cost
        for unresolved in (0.0, 10.0)
    }
    added = cost[10.0] - cost[0.0]
    assert added[0] > 3.0, "beside the threat the mission still leads through it"
    assert added[1] == 0.0, "behind the threat it is passed"
