"""What others may do: which surprises there are, and what they add to a price."""

from dataclasses import replace

import numpy as np
import pytest

from companion.avoidance.cost import price
from companion.avoidance.maneuvers import NO_SURPRISES, SurpriseParams, foreseen
from companion.avoidance.strategies import TABLE, StrategyTable
from companion.avoidance.trajectory import Commands, Tracks, fly_ahead, separation
from companion.model import Guidance
from tests.unit.avoidance.test_strategy_table import situation, traffic

PARAMS = SurpriseParams(turn_share=0.1, turn_radps=0.05, climb_share=0.02, climb_mps=3.0, within_s=40.0)


def tracks() -> Tracks:
    """One that flies straight and level, one in a right turn and a climb, one that stands."""
    some = traffic(np.random.default_rng(1), 3)
    velocity_mps = np.array([[50.0, 0.0, 0.0], [0.0, 40.0, -4.0], [0.0, 0.0, 0.0]])
    return replace(
        some,
        velocity_mps=velocity_mps,
        turn_radps=np.array([0.0, 0.03, 0.0]),
        grounded=np.array([False, False, True]),
    )


def test_each_may_turn_and_climb_either_way_and_what_stands_does_not() -> None:
    surprises = foreseen(tracks(), PARAMS)
    assert surprises.of.tolist() == 4 * [0, 1, 2]
    turns, climbs = surprises.turn_radps.reshape(4, 3), -surprises.sink_mps.reshape(4, 3)
    likely = surprises.likely.reshape(4, 3)
    assert turns[:, 0].tolist() == pytest.approx([0.05, -0.05, 0.0, 0.0])
    assert climbs[:, 0].tolist() == pytest.approx([0.0, 0.0, 3.0, -3.0])
    # Who turns or climbs already may stop that, or do more of it.
    assert turns[:, 1].tolist() == pytest.approx([0.0, 0.045, 0.03, 0.03])
    assert climbs[:, 1].tolist() == pytest.approx([4.0, 4.0, 0.0, 6.0])
    assert likely[:, 0].tolist() == pytest.approx([0.1, 0.1, 0.02, 0.02])
    assert likely[:, 2].tolist() == [0.0, 0.0, 0.0, 0.0]


def test_in_a_crowd_only_the_first_surprise() -> None:
    crowd = traffic(np.random.default_rng(4), 30)
    surprises = foreseen(crowd, replace(PARAMS, tracks=2))
    assert surprises.of.tolist() == 4 * [0, 1]
    assert len(surprises.likely) == 8


def test_where_nothing_may_surprise_there_is_what_is_predicted() -> None:
    assert [len(column) for column in foreseen(tracks(), NO_SURPRISES)] == [0, 0, 0, 0]


def test_a_surprise_has_its_share_of_what_it_would_cost() -> None:
    at, others = situation(), replace(traffic(np.random.default_rng(3), 3), grounded=np.zeros(3, dtype=bool))
    rows = StrategyTable(TABLE).commands(at)
    plain = price(at, rows, others, None)
    priced = price(at._replace(surprises=PARAMS), rows, others, None)
    surprises = foreseen(others, PARAMS)
    surprised, shares = others.subset(surprises.of), surprises.likely
    velocity_mps = np.column_stack([surprised.velocity_mps[:, :2], surprises.sink_mps])
    surprised = replace(surprised, turn_radps=surprises.turn_radps, velocity_mps=velocity_mps)
    paths = fly_ahead(at.own, rows, at.envelope)
    kept = separation(paths, surprised, horizon_s=PARAMS.within_s)
    weights, depth = at.weights, np.maximum(at.lost - kept.closest, 0.0)
    each = weights.margin * np.maximum(1.0 - kept.closest, 0.0) + weights.exposure * kept.exposure
    each += np.where(depth > 0.0, weights.loss, 0.0) + weights.depth * depth
    assert (each @ shares).max() > 1.0, "some surprise matters"
    assert priced.cost == pytest.approx(plain.cost + each @ shares)
    assert priced.closest.tolist() == plain.closest.tolist(), "told of what is predicted alone"


def test_of_two_ways_that_keep_clear_the_one_wins_that_would_still_if_they_turned() -> None:
    """Somebody passes 750 m to the left: he would come to us if he turned left."""
    at = situation(
        own=situation().own._replace(position_m=(0.0, 0.0, -300.0), course_rad=0.0),
        mission=Guidance(0.0, 22.0, 300.0),
        right_preferred=False,
    )
    passing = replace(
        traffic(np.random.default_rng(0), 1),
        position_m=np.array([[2400.0, -750.0, -300.0]]),
        velocity_mps=np.array([[-60.0, 0.0, 0.0]]),
        protected_horizontal_m=np.array([700.0]),
        protected_vertical_m=np.array([95.0]),
        grounded=np.zeros(1, dtype=bool),
    )
    rows = Commands.of([Guidance(0.0, 22.0, height_m) for height_m in (300.0, 400.0)])
    indifferent = price(at._replace(surprises=NO_SURPRISES), rows, passing, None)
    wary = price(at._replace(surprises=PARAMS), rows, passing, None)
    assert min(indifferent.closest) >= 1.0
    assert (indifferent.best(), wary.best()) == (0, 1)
