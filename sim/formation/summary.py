"""The figures of a formation campaign, with 95 % intervals over flights."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.campaign.results import ResultLine, percentile_ms
from sim.campaign.summary import interval
from sim.formation.engines import INNER, NONE, OUTER

Array = NDArray[np.floating]


def figures_of(results: Iterable[ResultLine]) -> dict[str, Any]:
    """The figures by avoider, and within each by radio."""
    lines = sorted(results, key=lambda one: (one["radio"], one["number"]))
    names = dict.fromkeys(line["avoider"] for line in lines)
    by_key = {(line["avoider"], line["radio"], line["number"]): line for line in lines}
    figures: dict[str, Any] = {}
    for name in names:
        ours = [line for line in lines if line["avoider"] == name]
        radios = dict.fromkeys(line["radio"] for line in ours)
        figures[name] = summary_of(ours, by_key)
        figures[name]["by_radio"] = {
            radio: summary_of([line for line in ours if line["radio"] == radio], by_key) for radio in radios
        }
    return figures


def summary_of(lines: list[ResultLine], by_key: dict[tuple[str, str, int], ResultLine]) -> dict[str, Any]:
    """The figures of some flights by one avoider; `by_key` has all flights, for comparisons."""
    smallest_m = _column(lines, "smallest_m")
    pairs = int(_column(lines, "pairs").sum())
    members = _column(lines, "members")
    return {
        "flights": len(lines),
        **_share("collisions", _column(lines, "pairs_lost") > 0.0),
        "pairs_lost": int(_column(lines, "pairs_lost").sum()),
        "pairs_near": int(_column(lines, "pairs_near").sum()),
        "pairs": pairs,
        "smallest_m": {
            "min": _shown(smallest_m.min()),
            "p5": _shown(np.percentile(smallest_m, 5.0)),
            "p50": _shown(np.percentile(smallest_m, 50.0)),
        },
        **_share("arrived", _column(lines, "arrived") / members),
        "all_arrived": int((_column(lines, "arrived") == members).sum()),
        **_mean("safety_value_m", _column(lines, "safety_value_m")),
        **_mean("safety_value_near_m", _column(lines, "safety_value_near_m")),
        **{f"safety_to_{other}": _safety_ratio(lines, by_key, other) for other in (OUTER, INNER, NONE)},
        **_mean("path_ratio", _column(lines, "path_ratio")),
        "engagements": round(float(_column(lines, "engagements").mean()), 2),
        **_stranger(lines),
        "intent_bytes_per_s": max(line["intent_bytes_per_s"] for line in lines),
        "decision_ms": _timing(lines),
    }


def _stranger(lines: list[ResultLine]) -> dict[str, Any]:
    """Of the flights with a stranger: the share of members with a near collision, and without well clear."""
    crossed = [line for line in lines if line["nmac"] is not None]
    if not crossed:
        return {"stranger_flights": 0}
    members = _column(crossed, "members")
    return {
        "stranger_flights": len(crossed),
        **_share("stranger_nmac", _column(crossed, "nmac") / members),
        **_share("stranger_lowc", _column(crossed, "lowc") / members),
    }


def _safety_ratio(
    lines: list[ResultLine], by_key: dict[tuple[str, str, int], ResultLine], other: str
) -> dict[str, float] | None:
    """The safety values over those of another avoider, of the same crossings, where all arrived in both."""
    pairs = [
        (line, beside)
        for line in lines
        if (beside := by_key.get((other, line["radio"], line["number"]))) is not None
        and line is not beside
        and line["arrived"] == beside["arrived"] == line["members"]
    ]
    if not pairs:
        return None
    ratios = {
        name: np.array([one[name] / beside[name] for one, beside in pairs])
        for name in ("safety_value_m", "safety_value_near_m")
    }
    whole, near = ratios["safety_value_m"], ratios["safety_value_near_m"]
    return {"flights": len(pairs), "whole": _shown(whole.mean()), "near": _shown(near.mean())}


def _timing(lines: list[ResultLine]) -> dict[str, float | None]:
    counts: dict[str, int] = {}
    for line in lines:
        for place, count in line["timing"].items():
            counts[place] = counts.get(place, 0) + count
    if not counts:
        return {"p50": None, "p99": None}
    return {"p50": percentile_ms(counts, 0.5), "p99": percentile_ms(counts, 0.99)}


def _share(name: str, values: Array | NDArray[np.bool_]) -> dict[str, Any]:
    """The mean of shares from 0 to 1; where nothing or everything counts, the rule of three bounds it."""
    shares = np.asarray(values, dtype=float)
    low, high = interval(len(shares), lambda picked: shares[picked].mean(1))
    bound = min(3.0 / len(shares), 1.0)
    if not shares.any():
        high = bound
    elif (shares == 1.0).all():
        low = 1.0 - bound
    return {name: _shown(shares.mean()), f"{name}_ci95": [_shown(low), _shown(high)]}


def _mean(name: str, values: Array) -> dict[str, Any]:
    known = values[np.isfinite(values)]
    if not len(known):
        return {name: None, f"{name}_ci95": None}
    low, high = interval(len(known), lambda picked: known[picked].mean(1))
    return {name: _shown(known.mean()), f"{name}_ci95": [_shown(low), _shown(high)]}


def _column(lines: list[ResultLine], name: str) -> Array:
    return np.array([np.nan if line[name] is None else line[name] for line in lines], dtype=float)


def _shown(value: float | np.floating) -> float:
    return float(f"{float(value):.4g}")
