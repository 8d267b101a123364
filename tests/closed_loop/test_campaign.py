"""Campaigns: the same results on any number of workers, continued after interruption, correct figures."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from companion.control.rejoin import RejoinMode
from companion.errors import ConfigError
from sim.campaign.command import page_of, run
from sim.campaign.flight import closest_approach, fly, unmitigated
from sim.campaign.plan import Part, Plan
from sim.campaign.results import ResultLine, Results, percentile_ms, read_results
from sim.campaign.route import Route
from sim.campaign.summary import Figures, gather, summary_of
from sim.encounters import generate
from tests.support.thorough import sample

QUIET = Console(quiet=True)
MODES: tuple[RejoinMode, ...] = ("line", "off")


def without_timing(path: Path) -> list[ResultLine]:
    results = sorted(read_results(path), key=lambda result: (result["avoider"], result["number"]))
    return [{key: value for key, value in result.items() if key != "timing"} for result in results]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    plan, out = (
        Plan(12, seed=3, avoiders=("companion", "none")),
        tmp_path_factory.mktemp("c") / "flown.ndjson",
    )
    run(plan, out, QUIET, workers=1)
    return plan, out


def test_the_engine_avoids_most_collisions(flown: tuple[Plan, Path]) -> None:
    plan, out = flown
    by_avoider = gather(read_results(out))
    ours, unavoided = summary_of(by_avoider["companion"]), summary_of(by_avoider["none"])
    assert unavoided["p_nmac"] > 0.2
    assert unavoided["risk_ratio"] == unavoided["lowc_ratio"] == 1.0
    # One of them turns into us at 110 m/s in the last seconds.
    assert ours["p_nmac"] < 0.2 * unavoided["p_nmac"]
    assert ours["not_back_on_leg"] == 0
    assert 60.0 < ours["back_s"]["p50"] <= ours["back_s"]["p95"] < 300.0
    assert ours["back_s"]["p95"] <= ours["latest_back_s"] < 600.0
    assert ours["engaged_more_than_once"] == 0
    assert ours["decision_ms"]["p99"] > ours["decision_ms"]["p50"] > 0.0
    assert len(by_avoider["companion"]) == plan.encounters


@pytest.mark.parametrize("number", [9, 11, 18])
def test_an_intruder_that_turns_into_us_is_avoided(number: int) -> None:
    """In straight flight it would miss us; its turn leads to a collision."""
    encounter, plan = generate("turning", 3, number, hits=True), Plan(1)
    assert unmitigated(encounter).nmac
    flown = fly(encounter, plan.engine_for("companion"), plan.first_surveillance, plan.limits, seed=number)
    assert flown.closest.severity > 0.5


def test_more_workers_give_the_same_results(flown: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, out = flown
    run(plan, tmp_path / "two.ndjson", QUIET, workers=2)
    assert without_timing(tmp_path / "two.ndjson") == without_timing(out)


def test_an_interrupted_campaign_continues(flown: tuple[Plan, Path], tmp_path: Path) -> None:
    """After a kill in the middle of a line, that flight is repeated and the others are not."""
    plan, out = flown
    cut = tmp_path / "cut.ndjson"
    lines = out.read_text().splitlines(keepends=True)
    marked = json.loads(lines[2]) | {"deviation_m": -1.0}
    cut.write_text("".join([*lines[:2], json.dumps(marked) + "\n", *lines[3:9], lines[9][:40]]))
    run(plan, cut, QUIET, workers=1)
    again = without_timing(cut)
    assert [r["number"] for r in again] == [r["number"] for r in without_timing(out)]
    differing = [a for a, b in zip(again, without_timing(out), strict=True) if a != b]
    assert [one["deviation_m"] for one in differing] == [-1.0], "existing results are kept"


def test_the_same_encounters_are_flown_with_each_surveillance(
    flown: tuple[Plan, Path], tmp_path: Path
) -> None:
    """Existing results count; report and page list the surveillance presets separately."""
    plan, out = flown
    more = replace(plan, avoiders=("companion",), surveillance=("perfect", "poor"))
    both = tmp_path / "both.ndjson"
    both.write_bytes(out.read_bytes())
    report = run(more, both, QUIET, workers=1)
    ours = report["avoiders"]["companion"]
    assert ours["encounters"] == 24
    assert [one["encounters"] for one in ours["by_surveillance"].values()] == [12, 12]
    perfect = summary_of(gather(read_results(out))["companion"])
    for figure in ("risk_ratio", "lowc_ratio", "median_max_height_m"):
        assert ours["by_surveillance"]["perfect"][figure] == perfect[figure]
    text = page_of(more, both, report)
    assert "<td>poor</td><td>12</td>" in text


def test_results_of_another_campaign_are_not_changed(flown: tuple[Plan, Path], tmp_path: Path) -> None:
    _, out = flown
    before = out.read_bytes()
    with pytest.raises(ConfigError, match="another campaign"):
        run(Plan(12, seed=4), out, QUIET, workers=1)
    assert out.read_bytes() == before
    damaged = tmp_path / "damaged.ndjson"
    damaged.write_text(out.read_text().splitlines()[0] + "\nnot json\n")
    with pytest.raises(ConfigError, match="line 2"):
        run(Plan(12, seed=3), damaged, QUIET, workers=1)


def test_a_result_is_written_once(flown: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, out = flown
    results = Results.open(tmp_path / "r.ndjson", plan.identity())
    first = list(read_results(out))[:3]
    results.add(first)
    results.add(first)
    results.close()
    assert len(list(read_results(tmp_path / "r.ndjson"))) == 3


def test_the_unmitigated_flight_is_the_straight_line() -> None:
    """Without avoidance the plane's closest approach is that of the straight line."""
    plan = Plan(1, avoiders=("none",))
    for number in range(3):
        encounter = generate("mix", 8, number)
        flight = fly(encounter, plan.engine_for("none"), plan.first_surveillance, plan.limits)
        assert flight.closest.severity == pytest.approx(unmitigated(encounter).severity, abs=0.01)
        assert not flight.avoided


def test_missions_with_legs_slopes_and_corners_are_flown_back_to() -> None:
    plan = Plan(sample(5, 10), seed=4, legs=True)
    for number in plan.numbers():
        encounter = plan.source()(number)
        route = plan.route_of(encounter, number)
        assert route is not None
        flown = fly(
            encounter, plan.engine_for("companion"), plan.first_surveillance, plan.limits, route=route
        )
        assert not flown.closest.nmac
        assert flown.back_s is not None
        assert (flown.return_s is not None) is flown.avoided


def test_a_route_leads_through_the_encounter() -> None:
    """Without avoidance the aircraft meets the first intruder on the leg, at the encounter's height."""
    met = 0
    for number in range(20):
        encounter = generate("level", 5, number, hits=True)
        route = Plan(20, seed=5, legs=True).route_of(encounter, number)
        met += unmitigated(encounter, route, Plan(1).limits).nmac
    assert met >= 18


def test_a_locked_height_is_kept() -> None:
    plan = Plan(1, lock_height=True)
    heights = [
        fly(
            generate("level", 9, n, hits=True),
            plan.engine_for("companion"),
            plan.first_surveillance,
            plan.limits,
        ).height_m
        for n in range(3)
    ]
    assert max(heights) < 4.0


def test_halves_are_disjoint() -> None:
    tuning, evaluation = (set(Plan(50, part=part).numbers()) for part in (Part.TUNING, Part.EVALUATION))
    assert len(tuning) == len(evaluation) == 50
    assert not tuning & evaluation
    assert list(Plan(3).numbers()) == [0, 1, 2]


def test_an_unknown_avoider_or_surveillance_is_refused() -> None:
    for options in ({"avoiders": ("wizard",)}, {"surveillance": ("magic",)}):
        with pytest.raises(ConfigError, match=r"wizard|magic"):
            Plan(1, **options)  # type: ignore[arg-type]


def result(number: int, *, weight: float = 1.0, lost: bool = True, kept: bool = True) -> ResultLine:
    near = {"horizontal_m": 0.0, "vertical_m": 0.0, "severity": 0.5}
    return {
        "number": number, "avoider": "x", "surveillance": "perfect", "weight": weight,
        "geometry": "head-on", "closing_mps": 50.0,
        "nominal": near | {"nmac": lost, "lowc": lost}, "flown": near | {"nmac": not kept, "lowc": not kept},
        "deviation_m": float(number), "height_m": 10.0, "avoided": True, "engagements": 1, "back_s": 120.0,
        "return_s": 60.0, "on_left_leg": True, "given_back_on_leg": False, "strayed_s": 5.0,
        "timing": {"10": 5, "100": 1},
    }  # fmt: skip


def figures_of(results: list[ResultLine]) -> Figures:
    return gather(results)["x"]


def test_ratios_are_weighted() -> None:
    """The last of three conflicts with weights 1, 1 and 2 is not avoided: a half, not a third."""
    figures = figures_of([result(1), result(2), result(3, weight=2.0, kept=False), result(4, lost=False)])
    summary = summary_of(figures)
    assert summary["risk_ratio"] == 0.5
    assert summary["p_nmac"] == 0.4
    assert summary["nuisance_rate"] == 1.0
    assert summary["median_max_deviation_m"] == 2.0
    assert summary["conflicts"] == 3


def test_what_the_avoidance_causes_is_counted_apart_from_what_it_does_not_resolve() -> None:
    unresolved, induced = result(1, kept=False), result(2, lost=False, kept=False)
    summary = summary_of(figures_of([unresolved, induced, result(3), result(4, lost=False)]))
    assert (summary["induced_nmac"], summary["induced_lowc"]) == (1, 1)


def test_intervals_are_those_of_a_binomial() -> None:
    """With equal weights, 100 conflicts and 20 lost: about 0.2 +- 1.96 sqrt(0.2 0.8 / 100)."""
    figures = figures_of([result(n, kept=n % 5 > 0) for n in range(100)])
    low, high = summary_of(figures)["risk_ratio_ci95"]
    assert low == pytest.approx(0.2 - 0.078, abs=0.02)
    assert high == pytest.approx(0.2 + 0.078, abs=0.02)


def test_without_events_the_interval_is_not_empty() -> None:
    low, high = summary_of(figures_of([result(n) for n in range(300)]))["risk_ratio_ci95"]
    assert (low, high) == (0.0, 0.01)


def test_percentiles_of_binned_durations() -> None:
    assert percentile_ms({"0": 98, "100": 2}, 0.5) == 0.01
    assert percentile_ms({"0": 98, "100": 2}, 0.99) == pytest.approx(0.01 * 1.05**100, rel=0.01)


def test_the_closest_approach_is_of_one_moment() -> None:
    """Horizontally near while 100 m above: well clear."""
    encounter = generate("level", 1, 1, hits=True)
    straight = unmitigated(encounter)
    assert straight.nmac
    own_m = np.array(encounter.own_position_m) + np.arange(1201)[:, None] * 0.1 * np.array(
        encounter.own_velocity_mps
    )
    above = closest_approach(own_m - (0.0, 0.0, 100.0), encounter)
    assert not above.lowc
    assert above.severity == pytest.approx(100.0 / 76.2, abs=0.01)


def test_the_page_needs_no_network(flown: tuple[Plan, Path]) -> None:
    plan, out = flown
    report = {"avoiders": {name: summary_of(one) for name, one in gather(read_results(out)).items()}}
    page = page_of(plan, out, report)
    assert page.startswith("<!doctype html>")
    assert "companion" in page
    assert "head-on" in page or "crossing" in page
    assert "http://" not in page
    assert "https://" not in page


def test_given_back_on_the_leg_is_told_from_flying_on_to_its_waypoint() -> None:
    """On a leg with room behind the encounter, `line` flies back to it, and `off` does not."""
    encounter, plan = generate("level", 0, 0, hits=True), Plan(1, rejoin="off")
    north, east = math.cos(encounter.own_course_rad), math.sin(encounter.own_course_rad)
    start_m = encounter.own_position_m
    ends_m = [(start_m[0] + m * north, start_m[1] + m * east, start_m[2]) for m in (-3000.0, 9000.0, 60000.0)]
    flown = {
        mode: fly(
            encounter,
            replace(plan, rejoin=mode).engine_for("companion"),
            plan.first_surveillance,
            plan.limits,
            route=Route(tuple(ends_m)),
        )
        for mode in MODES
    }
    assert flown["line"].avoided
    assert flown["line"].given_back_on_leg
    assert flown["line"].on_left_leg
    assert flown["line"].strayed_s == 0.0
    assert not flown["off"].given_back_on_leg
    assert flown["off"].strayed_s > 30.0


def test_the_report_counts_where_the_aircraft_was_given_back_and_where_it_was_back() -> None:
    there = {"given_back_on_leg": True}
    later = {"on_left_leg": False, "strayed_s": 25.0}
    never = {"avoided": False, "engagements": 0, "return_s": None, "on_left_leg": False, "strayed_s": 0.0}
    figures = summary_of(figures_of([result(0) | there, result(1), result(2) | later, result(3) | never]))
    assert figures["given_back_on_leg"] == 1
    assert (figures["back_on_left_leg"], figures["back_on_later_leg"]) == (2, 1)
    assert figures["strayed_s"] == {"p50": 5.0, "p95": 23.0}
