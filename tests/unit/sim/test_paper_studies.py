"""The studies' arithmetic: intervals, the choice of the transition domain, ratios and their texts."""

import math
from dataclasses import replace

import pytest

from sim.paper.measures import Measures
from sim.paper.report import GOALS, PAPER, report, succeeded, table
from sim.paper.studies import (
    TransitionPoint,
    best_delta_beta_deg,
    mean_with_interval,
    share_with_interval,
)
from tests.support.contract import MEASURES

FLOWN = Measures(
    safety_value=5.0,
    heading_effort=0.01,
    speed_effort=0.0,
    min_separation=0.9,
    min_clearance=0.5,
    collisions=0,
    arrived=True,
    steps=300,
    path_ratio=1.1,
    jitter=2,
)


def point(delta_deg: float, share: tuple[float, float, float], safety: float) -> TransitionPoint:
    return TransitionPoint(
        "outer layer only", delta_deg, (safety, safety, safety), share, (0.1, 0.1, 0.1), (1.1, 1.1, 1.1)
    )


def test_the_interval_of_a_share_is_wilsons() -> None:
    # By hand from the formula with z = 1.96: 8 of 10.
    assert share_with_interval(8, 10) == pytest.approx((0.8, 0.4902, 0.9433), abs=1e-3)
    assert share_with_interval(200, 200)[2] == 1.0
    assert share_with_interval(200, 200)[1] == pytest.approx(0.9812, abs=1e-3)
    assert share_with_interval(0, 200)[1] == 0.0


def test_the_interval_of_a_mean_shrinks_with_the_root_of_the_number() -> None:
    few, many = mean_with_interval([1.0, 3.0] * 10), mean_with_interval([1.0, 3.0] * 1000)
    assert few[0] == many[0] == 2.0
    assert (few[2] - few[0]) / (many[2] - many[0]) == pytest.approx(10.0, rel=0.03)
    assert mean_with_interval([4.0]) == (4.0, 4.0, 4.0)


def test_the_largest_safety_value_among_those_that_arrive_is_best() -> None:
    points = [
        point(5.0, (0.90, 0.86, 0.93), 5.0),
        point(60.0, (0.97, 0.94, 0.99), 5.2),
        point(90.0, (0.98, 0.95, 0.99), 5.4),
        point(120.0, (0.80, 0.74, 0.85), 5.9),  # detours, and does not arrive
    ]
    assert best_delta_beta_deg(points) == 90.0


def experiments(**changes: Measures) -> dict[str, dict[str, Measures]]:
    rows = {"none": FLOWN, "outer": FLOWN, "inner": FLOWN, "two_layer": FLOWN, **changes}
    return {"single": rows, "group": rows}


def test_a_missed_target_is_reported_with_its_reason() -> None:
    outer = replace(FLOWN, path_ratio=1.5, min_clearance=0.04)
    inner = replace(FLOWN, safety_value=2.0, heading_effort=0.1)
    text = table(experiments(outer=outer, inner=inner), {})
    assert text.count("**short**") == 2, "the safety value against the outer layer, in both experiments"
    assert "1.50 times the straight path" in text
    assert text.count("reached") == 4


def test_no_missed_target_is_reported_if_all_are_reached() -> None:
    better = replace(FLOWN, safety_value=7.0, heading_effort=0.001)
    text = table(experiments(two_layer=better), {})
    assert "short" not in text.split("## Two layers against one")[1]


def test_a_flight_without_arrival_is_not_compared() -> None:
    lost = replace(FLOWN, arrived=False)
    assert table(experiments(outer=lost), {}).count("did not arrive") == 2


def test_an_experiment_fails_with_a_collision_or_without_arrival() -> None:
    assert succeeded(experiments())
    assert not succeeded(experiments(two_layer=replace(FLOWN, collisions=1)))
    assert not succeeded(experiments(two_layer=replace(FLOWN, arrived=False)))


def test_the_report_has_the_keys_of_the_contract() -> None:
    content = report(experiments(), {})
    for name in ("single", "group"):
        assert set(content[name]) == {"none", "outer", "inner", "two_layer"}
        assert set(content[name]["two_layer"]) >= MEASURES


def test_the_goals_are_the_papers_ratios() -> None:
    """The targets are the paper's ratios, up to the second digit."""
    for goal in GOALS:
        both = PAPER[goal.experiment]["two_layer"].get(goal.measure)
        one = PAPER[goal.experiment][goal.against].get(goal.measure)
        if both is not None and one is not None:
            wanted = goal.at_least if goal.at_least is not None else goal.at_most
            assert wanted is not None
            assert math.isclose(both / one, wanted, abs_tol=0.025)
