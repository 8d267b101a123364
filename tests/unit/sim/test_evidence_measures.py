"""Measures of the evidence: induced apart from unresolved, convergence, groups, pass lines."""

import math
from typing import Any

import numpy as np
import pytest

from sim.campaign.results import ResultLine
from sim.campaign.summary import Figures
from sim.evidence.measures import convergence_of, groups_of, kind_of, measured, row_of, sets_of
from sim.evidence.pass_lines import MET, NOT_MET, NOT_SHOWN, verdicts


def line(number: int, *, lost: bool = True, kept: bool = True, **more: Any) -> ResultLine:
    near = {"horizontal_m": 0.0, "vertical_m": 0.0, "severity": 0.5}
    return {
        "number": number, "avoider": "x", "surveillance": "perfect", "weight": 1.0, "geometry": "head-on",
        "closing_mps": 50.0, "nominal": near | {"nmac": lost, "lowc": lost},
        "flown": near | {"nmac": not kept, "lowc": not kept}, "deviation_m": 1.0, "height_m": 1.0,
        "avoided": True, "engagements": 1, "back_s": 120.0, "return_s": 60.0, "on_left_leg": True,
        "given_back_on_leg": False, "strayed_s": 5.0, "timing": {"10": 5},
    } | more  # fmt: skip


def figures_of(lines: list[ResultLine]) -> Figures:
    figures = Figures()
    for one in lines:
        figures.add(one)
    return figures


def test_induced_events_are_apart_from_unresolved_ones() -> None:
    """Weights count in the shares: 2 of the nominal 4 are unresolved, and 3 are induced."""
    lines = [
        line(0, kept=False, weight=2.0), line(1, weight=2.0),
        line(2, lost=False, kept=False, weight=3.0), line(3, lost=False),
    ]  # fmt: skip
    row = measured(figures_of(lines))
    assert (row["unresolved_nmac"], row["induced_nmac"]) == (1, 1)
    assert (row["unresolved_risk_ratio"], row["induced_risk_ratio"]) == (0.5, 0.75)
    assert row["risk_ratio"] == 1.25


def test_without_conflicts_there_are_no_ratios() -> None:
    row = row_of(figures_of([line(0, lost=False)]).columns())
    assert row["risk_ratio"] is row["lowc_ratio"] is row["unresolved_risk_ratio"] is None
    assert row_of(Figures().columns())["encounters"] == 0


def test_a_ratio_converges_with_the_encounters() -> None:
    """Half of the conflicts are kept clear: half of the interval is 1.96 sqrt(0.5 x 0.5 / n)."""
    rng = np.random.default_rng(1)
    for count, converged in ((400, False), (4000, True)):
        columns = figures_of([line(n, kept=bool(rng.random() < 0.5)) for n in range(count)]).columns()
        found = convergence_of(columns, "nmac")
        assert found["encounters"][-1] == count
        assert found["relative"] == pytest.approx(1.96 / math.sqrt(count), rel=0.1)
        assert found["converged"] is converged
        assert found["needed"] == pytest.approx(max(count, 1537), rel=0.2)
        assert found["moved"] < 0.2
        assert all(
            a <= b <= c for a, b, c in zip(found["low"], found["estimate"], found["high"], strict=True)
        )


def test_without_events_nothing_has_converged() -> None:
    found = convergence_of(figures_of([line(n) for n in range(30)]).columns(), "nmac")
    assert found["estimate"][-1] == 0.0
    assert found["relative"] is None
    assert not found["converged"]
    clear = convergence_of(figures_of([line(n, lost=False) for n in range(30)]).columns(), "nmac")
    assert clear["encounters"] == []


def test_groups_by_geometry_speed_height_and_aircraft() -> None:
    figures = figures_of(
        [
            line(0, source="uncor_1200only_fwse_v1p2", altitude_m=120.0),
            line(1, source="uncor_1200exclude_fwse_v1p2", altitude_m=400.0, closing_mps=95.0),
            line(2, source="uncor_1200only_rotorcraft_v1p2", altitude_m=2000.0),
            line(3),  # of an earlier version
        ]
    )
    found = groups_of(figures)
    groups = {what: {k: int(v.sum()) for k, v in masks.items()} for what, masks in found.items()}
    assert groups["geometry"] == {"head-on": 4}
    assert groups["closing speed"] == {"30-60 m/s": 3, "over 90 m/s": 1}
    assert groups["own height"] == {"0-152 m": 1, "305-610 m": 1, "over 914 m": 1}
    assert groups["other aircraft"] == {"fixed wing, one engine": 2, "rotorcraft": 1, "not recorded": 1}
    assert kind_of("turning") == "turning"
    assert sets_of(figures)["uncor_1200only_fwse_v1p2"]["weight_share"] == 0.25


@pytest.mark.parametrize(
    ("risk", "high", "lowc", "wanted"),
    [
        (0.01, 0.03, 0.1, (MET, MET, MET)),
        (0.01, 0.10, 0.1, (MET, MET, NOT_SHOWN)),
        (0.10, 0.25, 0.1, (NOT_SHOWN, MET, NOT_MET)),
        (0.01, 0.02, 0.45, (NOT_MET, MET, NOT_MET)),
    ],
)
def test_a_line_is_met_with_the_whole_interval(
    risk: float, high: float, lowc: float, wanted: tuple[str, ...]
) -> None:
    row = {"risk_ratio": risk, "risk_ratio_ci95": [0.0, high]}
    row |= {"lowc_ratio": lowc, "lowc_ratio_ci95": [lowc, lowc]}
    assert tuple(verdicts(row).values()) == wanted
    assert set(verdicts(row | {"risk_ratio": None}).values()) == {NOT_SHOWN}


def test_nothing_flown_is_nothing_to_converge() -> None:
    found = convergence_of(Figures().columns(), "lowc")
    assert (found["encounters"], found["estimate"], found["converged"]) == ([], [], False)
