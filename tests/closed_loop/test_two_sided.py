"""Two-sided encounters flown through two engines, which know each other only by ADS-B."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from companion.errors import ConfigError
from sim.campaign.command import page_of, print_figures, run
from sim.campaign.plan import BOTH, Plan
from sim.campaign.results import read_results
from sim.campaign.runner import fly_one
from sim.encounters import generate, write_encounters

PLAN = Plan(3, seed=5, avoiders=("companion", "companion" + BOTH), two_sided=True)


def test_both_sides_are_flown_beside_one(tmp_path: Path) -> None:
    """Both keep well clear; the report has the mirrored maneuvers, and an ended campaign continues."""
    out = tmp_path / "two.ndjson"
    console = Console(width=100, record=True, quiet=True)
    run(replace(PLAN, encounters=2), out, console, workers=1)
    report = run(PLAN, out, console, workers=1)
    one, both = report["avoiders"]["companion"], report["avoiders"]["companion-both"]
    assert one["encounters"] == both["encounters"] == 3
    assert both["p_nmac"] == 0.0
    assert "mirrored" not in one
    assert both["mirrored"].keys() == {"vertical", "sideways", "either", "lowc"}
    lines = list(read_results(out))
    assert len(lines) == 6
    nominal = {line["number"]: line["nominal"] for line in lines if line["avoider"] == "companion"}
    assert all(line["nominal"] == nominal[line["number"]] for line in lines), "the same reference"
    print_figures(console, report)
    assert "companion-both" in page_of(PLAN, out, report)


def test_a_flight_is_repeatable() -> None:
    key = "companion-both", "adsb-out", 1
    encounter = PLAN.source()(1)
    first, again = (fly_one(PLAN, key, encounter) for _ in range(2))
    assert json.dumps(first[2].own_m.tolist()) == json.dumps(again[2].own_m.tolist())
    assert (first[0].intruders[0].position_m == again[0].intruders[0].position_m).all()


def test_encounters_with_an_intruder_of_another_class_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "hovering.csv"
    write_encounters(path, [generate("hovering", 1, 1)])
    with pytest.raises(ConfigError, match="--two-sided"):
        replace(PLAN, models=(str(path),)).check()


def test_the_mark_of_both_sides_belongs_to_two_sided_campaigns() -> None:
    with pytest.raises(ConfigError, match="companion-both"):
        Plan(1, avoiders=("companion" + BOTH,))
