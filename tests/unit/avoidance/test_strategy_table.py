"""The integrated strategy table: which rows there are, and their prices against brute force."""

import math
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest

from companion.avoidance.control import ALL_CONTROLS, Control
from companion.avoidance.cost import CostWeights, Situation, price
from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array
from companion.avoidance.inner import emergency
from companion.avoidance.reactive_rules import Pace
from companion.avoidance.strategies import TABLE, Course, Height, Speed, StrategyTable
from companion.avoidance.trajectory import HORIZON_S, Commands, OwnState, Tracks, fly_ahead, separation
from companion.model import Guidance

ENVELOPE = Envelope(min_altitude_m=100.0, max_altitude_m=600.0)
TIMES_S = np.concatenate([np.arange(0.0, 12.0), np.arange(12.0, 60.0, 2.0), np.arange(60.0, 91.0, 3.0)])
NARROWED = [frozenset(some) for count in range(4) for some in combinations(Control, count)]
MISSION = Guidance(math.radians(10.0), 22.0, 320.0)


def situation(**changes: object) -> Situation:
    usual = Situation(
        own=OwnState((0.0, 0.0, -300.0), math.radians(20.0), 21.0, 0.5, (2.0, -3.0)),
        mission=MISSION,
        over_m=410.0,
        under_m=190.0,
        right_preferred=True,
        horizon_s=HORIZON_S,
        goal_distance=1.0,
        lost=1.0 / 1.15,
        envelope=ENVELOPE,
        weights=CostWeights(),
        rule_course_rad=math.radians(130.0),
        rule_pace=Pace.SLOWEST,
    )
    return usual._replace(**changes)  # type: ignore[arg-type]


def traffic(chance: np.random.Generator, count: int, shell_m: float = 0.0) -> Tracks:
    return Tracks(
        tuple(f"T{i}" for i in range(count)),
        np.column_stack([chance.uniform(-1500.0, 1500.0, (count, 2)), chance.uniform(-400.0, -200.0, count)]),
        np.column_stack([chance.uniform(-40.0, 40.0, (count, 2)), chance.uniform(-2.0, 2.0, count)]),
        chance.uniform(150.0, 700.0, count),
        chance.uniform(40.0, 90.0, count),
        chance.random(count) < 0.3,
        np.full(count, shell_m),
        np.zeros(count),
    )


def flown(table: StrategyTable, at: Situation) -> list[Guidance]:
    commands = table.commands(at)
    return [commands.row(row) for row in range(len(commands))]


def ratios(path_m: Array, others: Tracks, n: int) -> Array:
    """Distances to one track along one path, in protected volumes, at the times of the prediction."""
    offset = path_m - (others.position_m[n] + others.velocity_mps[n] * TIMES_S[:, None])
    horizontal = np.hypot(offset[:, 0], offset[:, 1]) / others.protected_horizontal_m[n]
    below = offset[:, 2]  # what is grounded reaches down to the earth
    apart = np.maximum(-below, 0.0) if others.grounded[n] else np.abs(below)
    larger: Array = np.maximum(horizontal, apart / others.protected_vertical_m[n])
    return larger


def shell_depth(ratio: float, protected_m: float, shell_m: float) -> float:
    """1 at the volume and within, 0 from the outside of the shell on, and straight between."""
    into_m = shell_m - (ratio - 1.0) * protected_m
    return min(max(into_m / shell_m, 0.0), 1.0)


def price_of(row: Guidance, at: Situation, others: Tracks) -> float:
    """What a row costs, from the words of `CostWeights`, one track and one moment after the other."""
    weights = at.weights
    path_m = fly_ahead(at.own, Commands.of([row]), at.envelope).row_m(0)
    cost, worst_shell = 0.0, 0.0
    for n in range(len(others)):
        ratio = ratios(path_m, others, n)
        closest = min(ratio)
        cost += weights.margin * max(1.0 - closest, 0.0)
        if closest < at.lost:
            cost += weights.loss + weights.depth * (at.lost - closest)
        in_shell = 0.0
        for i, step_s in enumerate(np.diff(TIMES_S)):
            share = step_s / HORIZON_S
            cost += weights.exposure * share * max(1.0 - ratio[i + 1], 0.0)
            if weights.nearness > 0.0:
                in_shell += share * shell_depth(
                    ratio[i + 1], others.protected_horizontal_m[n], others.shell_m[n]
                )
        worst_shell = max(worst_shell, in_shell)
    cost += weights.nearness * worst_shell
    turn = abs(math.remainder(row.course_rad - at.own.course_rad, 2.0 * math.pi))
    off = math.remainder(row.course_rad - at.mission.course_rad, 2.0 * math.pi)
    cost += weights.turn * turn / math.pi + weights.deviation * abs(off) / math.pi
    cost += weights.speed * abs(row.airspeed_mps - at.mission.airspeed_mps) / 10.0
    cost += weights.height * abs(row.altitude_m - at.mission.altitude_m) / 100.0
    cost += weights.descent if row.altitude_m < at.mission.altitude_m - 1.0 else 0.0
    if at.spares_heights and abs(row.altitude_m - at.mission.altitude_m) > 5.0:
        cost += weights.spared_height
    cost += weights.wrong_side if at.right_preferred and off < -math.radians(1.0) else 0.0
    return cost


def test_every_row_is_there_once() -> None:
    assert len(set(TABLE)) == len(TABLE)


def test_every_height_goes_with_every_way_over_the_ground() -> None:
    grounds = {row.ground for row in TABLE}
    assert {(row.ground, row.height) for row in TABLE} == set(product(grounds, Height))


def test_no_turn_leaves_open_which_way_round_it_goes() -> None:
    turns_rad = [abs(row.ground.turn_rad) for row in TABLE]
    assert math.radians(160.0) < max(turns_rad) < math.radians(170.0)


def test_the_rules_are_there_alone_and_together() -> None:
    pairs = {(row.ground.course, row.ground.speed) for row in TABLE}
    assert pairs >= {
        (Course.RULE, Speed.MISSION),
        (Course.MISSION, Speed.RULE),
        (Course.RULE, Speed.RULE),
        (Course.MISSION, Speed.SLOWEST),
        (Course.MISSION, Speed.FASTEST),
    }


def test_every_combination_of_controls_has_a_row() -> None:
    assert {row.controls for row in TABLE} == set(NARROWED)


@pytest.mark.parametrize("controls", NARROWED, ids=lambda some: "+".join(sorted(some)) or "none")
def test_a_narrowed_table_has_all_the_rows_of_its_controls_and_no_others(
    controls: frozenset[Control],
) -> None:
    assert StrategyTable.within(controls).rows == tuple(row for row in TABLE if not row.controls - controls)


@pytest.mark.parametrize("controls", NARROWED, ids=lambda some: "+".join(sorted(some)) or "none")
def test_a_control_that_is_not_allowed_stays_as_the_mission_has_it(controls: frozenset[Control]) -> None:
    rows = flown(StrategyTable.within(controls), situation())
    courses = {round(row.course_rad, 9) for row in rows}
    speeds, heights = {row.airspeed_mps for row in rows}, {row.altitude_m for row in rows}
    for control, values, mission in (
        (Control.HEADING, courses, round(MISSION.course_rad, 9)),
        (Control.SPEED, speeds, MISSION.airspeed_mps),
        (Control.HEIGHT, heights, MISSION.altitude_m),
    ):
        assert mission in values
        assert (len(values) > 1) is (control in controls)


def test_without_any_control_the_mission_is_flown() -> None:
    assert flown(StrategyTable.within(frozenset()), situation()) == [MISSION]


def test_rows_ask_for_what_the_rules_say() -> None:
    table = StrategyTable.within(ALL_CONTROLS)
    at = situation(rule_course_rad=1.234, rule_pace=Pace.FASTEST)
    for row, guidance in zip(table.rows, flown(table, at), strict=True):
        if row.ground.course is Course.RULE:
            assert guidance.course_rad == pytest.approx(1.234)
        if row.ground.speed is Speed.RULE:
            assert guidance.airspeed_mps == ENVELOPE.max_airspeed_mps


@pytest.mark.parametrize(
    ("pace", "speed_mps"), [(Pace.KEEP, 22.0), (Pace.SLOWEST, 16.0), (Pace.FASTEST, 28.0)]
)
def test_the_speed_rule_has_a_speed_for_every_pace(pace: Pace, speed_mps: float) -> None:
    table = StrategyTable.within(frozenset({Control.SPEED}))
    rows = zip(table.rows, flown(table, situation(rule_pace=pace)), strict=True)
    assert [g.airspeed_mps for row, g in rows if row.ground.speed is Speed.RULE] == [speed_mps]


def test_heights_over_and_under_stay_between_floor_and_ceiling() -> None:
    table = StrategyTable.within(frozenset({Control.HEIGHT}))
    rows = zip(table.rows, flown(table, situation(over_m=900.0, under_m=-50.0)), strict=True)
    assert {row.height: g.altitude_m for row, g in rows} == {
        Height.MISSION: 320.0,
        Height.LEVEL: 300.0,
        Height.OVER: 600.0,
        Height.UNDER: 100.0,
    }


@pytest.mark.parametrize("nearness", [0.0, 10.0])
@pytest.mark.parametrize("seed", range(6))
def test_every_price_is_that_of_brute_force(seed: int, nearness: float) -> None:
    at = situation(weights=CostWeights(nearness=nearness), spares_heights=seed % 2 == 1)
    others = traffic(np.random.default_rng(seed), 3, shell_m=300.0)
    priced = price(at, StrategyTable(TABLE).commands(at), others, None)
    for row in range(0, len(TABLE), 11):
        assert priced.cost[row] == pytest.approx(price_of(priced.commands.row(row), at, others), abs=5e-3)


@pytest.mark.parametrize("controls", NARROWED, ids=lambda some: "+".join(sorted(some)) or "none")
@pytest.mark.parametrize("seed", range(3))
def test_the_emergency_flies_the_cheapest_row(seed: int, controls: frozenset[Control]) -> None:
    at, others = situation(), traffic(np.random.default_rng(seed), 2)
    table = StrategyTable.within(controls)
    priced = emergency(at, table, others, None)
    cheapest = min(price_of(row, at, others) for row in flown(table, at))
    assert price_of(priced.commands.row(priced.best()), at, others) == pytest.approx(cheapest, abs=5e-3)


def test_of_equals_the_first_is_flown() -> None:
    """Rows of one price differ in name only: the mission's own row comes before a turn by nothing."""
    at = situation(own=situation().own._replace(course_rad=MISSION.course_rad))
    far = replace(traffic(np.random.default_rng(1), 1), position_m=np.array([[9e4, 9e4, -300.0]]))
    assert emergency(at, StrategyTable(TABLE), far, None).best() == 0
    assert TABLE[0].controls == frozenset()


def test_what_is_flown_already_is_cheaper_by_the_price_of_a_change() -> None:
    at, others, held = situation(), traffic(np.random.default_rng(2), 2), Guidance(0.7, 20.0, 350.0)
    fresh = emergency(at, StrategyTable(TABLE), others, None)
    going_on = emergency(at, StrategyTable(TABLE), others, held)
    assert going_on.commands.row(0) == held
    assert going_on.cost[0] == pytest.approx(price_of(held, at, others), abs=5e-3)
    for row in range(len(fresh.cost)):
        asked = fresh.commands.row(row)
        # Between the mission and what is held, in course (10 to 40.1 degrees) and height (320 to 350 m).
        eases = 8.0 <= math.degrees(asked.course_rad) <= 42.2 and 315.0 <= asked.altitude_m <= 355.0
        change = at.weights.ease if eases else at.weights.switch
        assert going_on.cost[1 + row] == pytest.approx(fresh.cost[row] + change), asked


@pytest.mark.parametrize("seed", range(8))
def test_nearness_is_the_mean_depth_in_the_shell(seed: int) -> None:
    at, others = situation(), traffic(np.random.default_rng(seed), 4, shell_m=400.0)
    row = Guidance(math.radians(60.0), 25.0, 300.0)
    paths = fly_ahead(at.own, Commands.of([row]), ENVELOPE)
    nearness = separation(paths, others, shells=True).nearness
    for n in range(4):
        wanted = sum(
            step_s / HORIZON_S * shell_depth(ratio, others.protected_horizontal_m[n], 400.0)
            for step_s, ratio in zip(np.diff(TIMES_S), ratios(paths.row_m(0), others, n)[1:], strict=True)
        )
        assert nearness[0, n] == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize(("miss_m", "is_lost"), [(0.999, True), (1.001, False)])
def test_the_volume_itself_has_a_flat_price_from_its_edge_on(miss_m: float, is_lost: bool) -> None:
    """Passed at a little less or more than 200 m; with the margin of 15 percent it is 230 m."""
    own = OwnState((0.0, 0.0, -300.0), 0.0, 22.0, 0.0, (0.0, 0.0))
    at = situation(own=own, mission=Guidance(0.0, 22.0, 300.0), weights=CostWeights(margin=0.0, exposure=0.0))
    beside = Tracks(
        ("T",),
        np.array([[0.0, 200.0 * miss_m, -300.0]]),
        np.array([[22.0, 0.0, 0.0]]),
        np.array([230.0]),
        np.array([50.0]),
        np.zeros(1, dtype=bool),
        np.zeros(1),
        np.zeros(1),
    )
    cost = emergency(at, StrategyTable.within(frozenset()), beside, None).cost[0]
    assert cost == pytest.approx(at.weights.loss if is_lost else 0.0, abs=0.5)


def test_beyond_the_horizon_nothing_costs() -> None:
    """The head-on threat is met after 50 s; a flight that ends before is not disturbed by it."""
    own = OwnState((0.0, 0.0, -300.0), 0.0, 22.0, 0.0, (0.0, 0.0))
    mission = Guidance(0.0, 22.0, 300.0)
    threat = Tracks(
        ("T",),
        np.array([[2200.0, 0.0, -300.0]]),
        np.array([[-22.0, 0.0, 0.0]]),
        np.array([200.0]),
        np.array([50.0]),
        np.zeros(1, dtype=bool),
        np.zeros(1),
        np.zeros(1),
    )
    table = StrategyTable(TABLE)
    whole = emergency(situation(own=own, mission=mission), table, threat, None)
    short = emergency(situation(own=own, mission=mission, horizon_s=40.0), table, threat, None)
    assert whole.cost[0] > 100.0
    assert short.cost[0] == 0.0


def test_whoever_flies_on_beside_a_threat_has_it_still_before_him() -> None:
    """Somebody slower crosses from the left: turning along keeps clear as well as passing behind him does."""
    own = OwnState((0.0, 0.0, -300.0), 0.0, 22.0, 0.0, (0.0, 0.0))
    threat = replace(
        traffic(np.random.default_rng(0), 1),
        position_m=np.array([[1200.0, -1200.0, -300.0]]),
        velocity_mps=np.array([[0.0, 20.0, 0.0]]),
        protected_horizontal_m=np.array([700.0]),
        protected_vertical_m=np.array([95.0]),
        grounded=np.zeros(1, dtype=bool),
    )
    mission = Guidance(0.0, 22.0, 300.0)
    usual = situation(own=own, mission=mission, passed_s=75.0)
    usual = usual._replace(mission_then_m=np.array([22.0 * 75.0, 0.0]))
    rows = Commands.of([Guidance(math.radians(deg), 22.0, 300.0) for deg in (90.0, -90.0)])
    cost = {
        unresolved: price(
            usual._replace(weights=replace(usual.weights, unresolved=unresolved)), rows, threat, None
        ).cost
        for unresolved in (0.0, 10.0)
    }
    added = cost[10.0] - cost[0.0]
    assert added[0] > 3.0, "beside him: the mission leads through him still"
    assert added[1] == 0.0, "behind him: passed"
