"""The integrated strategy table: which rows there are, and the commands that they become."""

import math
from itertools import combinations, product

import pytest

from companion.avoidance.cost import CostContext, Height, Speed
from companion.avoidance.inner import TABLE, Course, StrategyTable
from companion.avoidance.trajectory import ALL_CONTROLS, Control, Pace
from companion.model import Guidance
from tests.support.avoidance_cases import ENVELOPE, MISSION, make_context

SOME_CONTROLS = [frozenset(some) for count in range(4) for some in combinations(Control, count)]


def rows_of(table: StrategyTable, context: CostContext) -> list[Guidance]:
    commands = table.commands(context)
    return [commands.row(row) for row in range(len(commands))]


def test_no_row_is_repeated() -> None:
    assert len(set(TABLE)) == len(TABLE)


def test_every_height_is_combined_with_every_ground_path() -> None:
    grounds = {row.ground for row in TABLE}
    assert {(row.ground, row.height) for row in TABLE} == set(product(grounds, Height))


def test_no_turn_is_so_large_that_it_could_go_either_way() -> None:
    turns_rad = [abs(row.ground.turn_rad) for row in TABLE]
    assert math.radians(160.0) < max(turns_rad) < math.radians(170.0)


def test_the_rules_have_rows_alone_and_together() -> None:
    pairs = {(row.ground.course, row.ground.speed) for row in TABLE}
    assert pairs >= {
        (Course.RULE, Speed.MISSION),
        (Course.MISSION, Speed.RULE),
        (Course.RULE, Speed.RULE),
        (Course.MISSION, Speed.SLOWEST),
        (Course.MISSION, Speed.FASTEST),
    }


def test_every_combination_of_controls_has_a_row() -> None:
    assert {row.controls for row in TABLE} == set(SOME_CONTROLS)


@pytest.mark.parametrize("controls", SOME_CONTROLS, ids=lambda some: "+".join(sorted(some)) or "none")
def test_a_narrowed_table_has_exactly_the_rows_with_its_controls(controls: frozenset[Control]) -> None:
    assert StrategyTable.within(controls).rows == tuple(row for row in TABLE if not row.controls - controls)


@pytest.mark.parametrize("controls", SOME_CONTROLS, ids=lambda some: "+".join(sorted(some)) or "none")
def test_an_excluded_control_keeps_the_value_of_the_mission(controls: frozenset[Control]) -> None:
    rows = rows_of(StrategyTable.within(controls), make_context())
    courses = {round(row.course_rad, 9) for row in rows}
    speeds, heights = {row.airspeed_mps for row in rows}, {row.altitude_m for row in rows}
    for control, values, mission in (
        (Control.HEADING, courses, round(MISSION.course_rad, 9)),
        (Control.SPEED, speeds, MISSION.airspeed_mps),
        (Control.HEIGHT, heights, MISSION.altitude_m),
    ):
        assert mission in values
        assert (len(values) > 1) is (control in controls)


def test_without_any_control_the_mission_is_the_only_row() -> None:
    assert rows_of(StrategyTable.within(frozenset()), make_context()) == [MISSION]


def test_rule_rows_have_the_course_and_speed_of_the_rules() -> None:
    table = StrategyTable.within(ALL_CONTROLS)
    context = make_context(rule_course_rad=1.234, rule_pace=Pace.FASTEST)
    for row, guidance in zip(table.rows, rows_of(table, context), strict=True):
        if row.ground.course is Course.RULE:
            assert guidance.course_rad == pytest.approx(1.234)
        if row.ground.speed is Speed.RULE:
            assert guidance.airspeed_mps == ENVELOPE.max_airspeed_mps


@pytest.mark.parametrize(
    ("pace", "speed_mps"), [(Pace.KEEP, 22.0), (Pace.SLOWEST, 16.0), (Pace.FASTEST, 28.0)]
)
def test_the_speed_rule_has_a_speed_for_every_pace(pace: Pace, speed_mps: float) -> None:
    table = StrategyTable.within(frozenset({Control.SPEED}))
    rows = zip(table.rows, rows_of(table, make_context(rule_pace=pace)), strict=True)
    assert [g.airspeed_mps for row, g in rows if row.ground.speed is Speed.RULE] == [speed_mps]


def test_heights_over_and_under_stay_between_floor_and_ceiling() -> None:
    table = StrategyTable.within(frozenset({Control.HEIGHT}))
    rows = zip(table.rows, rows_of(table, make_context(over_m=900.0, under_m=-50.0)), strict=True)
    assert {row.height: g.altitude_m for row, g in rows} == {
        Height.MISSION: 320.0,
        Height.LEVEL: 300.0,
        Height.OVER: 600.0,
        Height.UNDER: 100.0,
    }
