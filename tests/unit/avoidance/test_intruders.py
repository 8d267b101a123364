"""Intruder maneuvers: which ones are considered, and what they add to the cost of a row."""

from dataclasses import replace

import numpy as np
import pytest

from companion.avoidance.cost import evaluate_rows
from companion.avoidance.inner import TABLE, StrategyTable
from companion.avoidance.intruders import (
    NO_MANEUVERS,
    ManeuverParams,
    Tracks,
    enumerate_maneuvers,
    separation,
)
from companion.avoidance.senses import NO_WRONG_WAYS
from companion.avoidance.trajectory import Commands, OwnState, fly_ahead
from companion.model import Guidance
from tests.support.avoidance_cases import make_context, one_track, random_tracks

PARAMS = ManeuverParams(turn_share=0.1, turn_radps=0.05, climb_share=0.02, climb_mps=3.0, within_s=40.0)


def three_tracks() -> Tracks:
    """One flies straight and level, one turns right and climbs, one is an obstacle."""
    velocity_mps = np.array([[50.0, 0.0, 0.0], [0.0, 40.0, -4.0], [0.0, 0.0, 0.0]])
    return replace(
        random_tracks(np.random.default_rng(1), 3),
        velocity_mps=velocity_mps,
        turn_radps=np.array([0.0, 0.03, 0.0]),
        grounded=np.array([False, False, True]),
    )


def test_every_aircraft_may_turn_and_climb_either_way_and_obstacles_may_not() -> None:
    maneuvers = enumerate_maneuvers(three_tracks(), PARAMS)
    assert maneuvers.of.tolist() == 4 * [0, 1, 2]
    turns, climbs = maneuvers.turn_radps.reshape(4, 3), -maneuvers.sink_mps.reshape(4, 3)
    likely = maneuvers.likely.reshape(4, 3)
    assert turns[:, 0].tolist() == pytest.approx([0.05, -0.05, 0.0, 0.0])
    assert climbs[:, 0].tolist() == pytest.approx([0.0, 0.0, 3.0, -3.0])
    # A turn or climb may end, or become stronger.
    assert turns[:, 1].tolist() == pytest.approx([0.0, 0.045, 0.03, 0.03])
    assert climbs[:, 1].tolist() == pytest.approx([4.0, 4.0, 0.0, 6.0])
    assert likely[:, 0].tolist() == pytest.approx([0.1, 0.1, 0.02, 0.02])
    assert likely[:, 2].tolist() == [0.0, 0.0, 0.0, 0.0]


def test_in_a_crowd_only_the_first_tracks_maneuver() -> None:
    crowd = random_tracks(np.random.default_rng(4), 30)
    maneuvers = enumerate_maneuvers(crowd, replace(PARAMS, tracks=2))
    assert maneuvers.of.tolist() == 4 * [0, 1]
    assert len(maneuvers.likely) == 8


def test_without_probabilities_there_are_no_maneuvers() -> None:
    assert [len(column) for column in enumerate_maneuvers(three_tracks(), NO_MANEUVERS)] == [0, 0, 0, 0]


def test_a_maneuver_costs_in_proportion_to_its_probability() -> None:
    context = make_context()
    tracks = replace(random_tracks(np.random.default_rng(3), 3), grounded=np.zeros(3, dtype=bool))
    rows = StrategyTable(TABLE).commands(context)
    without = evaluate_rows(context, rows, tracks, None)
    with_them = evaluate_rows(context._replace(maneuvers=PARAMS), rows, tracks, None)
    maneuvers = enumerate_maneuvers(tracks, PARAMS)
    maneuvering = tracks.subset(maneuvers.of)
    velocity_mps = np.column_stack([maneuvering.velocity_mps[:, :2], maneuvers.sink_mps])
    maneuvering = replace(maneuvering, turn_radps=maneuvers.turn_radps, velocity_mps=velocity_mps)
    paths = fly_ahead(context.own, rows, context.envelope)
    kept = separation(paths, maneuvering, horizon_s=PARAMS.within_s)
    weights, depth = context.weights, np.maximum(context.breach_ratio - kept.closest, 0.0)
    each = weights.margin * np.maximum(1.0 - kept.closest, 0.0) + weights.exposure * kept.exposure
    each += np.where(depth > 0.0, weights.loss, 0.0) + weights.depth * depth
    assert (each @ maneuvers.likely).max() > 1.0, "some maneuver matters"
    assert with_them.cost == pytest.approx(without.cost + each @ maneuvers.likely)
    assert with_them.closest.tolist() == without.closest.tolist(), "closest is of predicted flights alone"


def test_a_row_that_stays_clear_if_the_intruder_turns_is_preferred() -> None:
    """An aircraft passes 750 m to the left, and would meet us if it turned left."""
    context = make_context(
        own=OwnState((0.0, 0.0, -300.0), 0.0, 21.0, 0.5, (2.0, -3.0)),
        mission=Guidance(0.0, 22.0, 300.0),
        wrong=NO_WRONG_WAYS,
    )
    passing = one_track((2400.0, -750.0, -300.0), (-60.0, 0.0, 0.0), 700.0, 95.0)
    rows = Commands.of([Guidance(0.0, 22.0, height_m) for height_m in (300.0, 400.0)])
    without = evaluate_rows(context._replace(maneuvers=NO_MANEUVERS), rows, passing, None)
    with_them = evaluate_rows(context._replace(maneuvers=PARAMS), rows, passing, None)
    assert min(without.closest) >= 1.0
    assert (without.best, with_them.best) == (0, 1)
