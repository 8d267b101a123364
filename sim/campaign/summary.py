"""The figures of a campaign: ratios against flying undisturbed, with intervals, and their price."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.campaign.results import Result, percentile_ms

Array = NDArray[np.floating]

_RESAMPLES = 1000
_CHUNK = 50  # resamples at a time, so that memory stays flat
_COLUMNS = ("weight", "nmac0", "lowc0", "nmac", "lowc", "avoided", "deviation_m", "height_m", "engagements")
# Pass lines for cooperative traffic, of ASTM F3442.
RISK_RATIO_LINE, LOWC_RATIO_LINE = 0.18, 0.40


@dataclass
class Figures:
    """The results of one avoider, as columns."""

    rows: list[tuple[float, ...]] = field(default_factory=list)
    geometries: list[str] = field(default_factory=list)
    closing_mps: list[float] = field(default_factory=list)
    surveillance: list[str] = field(default_factory=list)
    timing: dict[str, int] = field(default_factory=dict)
    not_back: int = 0

    def add(self, result: Result) -> None:
        """One more."""
        nominal, flown = result["nominal"], result["flown"]
        self.rows.append(
            (
                result["weight"], nominal["nmac"], nominal["lowc"], flown["nmac"], flown["lowc"],
                result["avoided"], result["deviation_m"], result["height_m"], result["engagements"],
            )
        )  # fmt: skip
        self.geometries.append(result["geometry"])
        self.closing_mps.append(result["closing_mps"])
        self.surveillance.append(result["surveillance"])
        self.not_back += result["back_s"] is None
        for place, count in result["timing"].items():
            self.timing[place] = self.timing.get(place, 0) + count

    def columns(self) -> dict[str, Array]:
        """Each column, (n,)."""
        table = np.array(self.rows, dtype=float).reshape(len(self.rows), len(_COLUMNS))
        return dict(zip(_COLUMNS, table.T, strict=True))


def gather(results: Iterable[Result], by: str = "avoider") -> dict[str, Figures]:
    """The results by avoider, or by another of their words."""
    figures: dict[str, Figures] = {}
    # By number, so that sums come out the same in whatever order the results came.
    for result in sorted(results, key=key_of_order):
        figures.setdefault(result[by], Figures()).add(result)
    return figures


def key_of_order(result: Result) -> tuple[int, str]:
    """The order in which results are summed up."""
    return result["number"], result["surveillance"]


def summary_of(figures: Figures, encounters_per_s: float | None = None) -> dict[str, Any]:
    """The figures of one avoider, by the names of the report."""
    columns = figures.columns()
    conflicts = columns["lowc0"] > 0.0
    return {
        "encounters": len(figures.rows),
        "conflicts": int(conflicts.sum()),
        "p_nmac": _mean(columns, "nmac"),
        "p_lowc": _mean(columns, "lowc"),
        **ratio_of(columns, "risk_ratio", "nmac"),
        **ratio_of(columns, "lowc_ratio", "lowc"),
        "median_max_deviation_m": _weighted_median(columns["deviation_m"], columns["weight"], conflicts),
        "median_max_height_m": _weighted_median(columns["height_m"], columns["weight"], conflicts),
        **_nuisance(columns),
        "more_than_one_engagement": int((columns["engagements"] > 1.0).sum()),
        "not_back_on_line": figures.not_back,
        "decision_ms": {
            "p50": percentile_ms(figures.timing, 0.5),
            "p99": percentile_ms(figures.timing, 0.99),
        },
        "encounters_per_s": encounters_per_s,
    }


def ratio_of(columns: dict[str, Array], name: str, event: str) -> dict[str, object]:
    """What avoiding leaves of an event, and the interval that 95 % of resampled campaigns lie in.

    `None` where the event never happens undisturbed either: there is nothing to reduce.
    """
    weight = columns["weight"]
    flown, nominal = weight * columns[event], weight * columns[f"{event}0"]
    if nominal.sum() <= 0.0:
        return {name: None, f"{name}_ci95": None}
    ratio = float(flown.sum() / nominal.sum())
    low, high = _interval(len(weight), lambda picked: _divided(flown[picked].sum(1), nominal[picked].sum(1)))
    if not flown.any():
        # Resampling what never happened shows no spread: the rule of three bounds it.
        high = _none_seen(nominal)
    return {name: _shown(ratio), f"{name}_ci95": [_shown(low), _shown(high)]}


def _none_seen(nominal: Array) -> float:
    """The upper 95 % bound of a ratio when no event was left: 3 of as many as their weights count."""
    effective = float(nominal.sum() ** 2 / (nominal**2).sum())
    return min(3.0 / effective, 1.0)


def _nuisance(columns: dict[str, Array]) -> dict[str, object]:
    """The share of the encounters that stay well clear by themselves in which avoidance is flown."""
    clear = columns["lowc0"] == 0.0
    flown, all_clear = columns["weight"] * columns["avoided"] * clear, columns["weight"] * clear
    if all_clear.sum() <= 0.0:
        return {"nuisance_rate": None, "nuisance_rate_ci95": None}
    low, high = _interval(len(clear), lambda picked: _divided(flown[picked].sum(1), all_clear[picked].sum(1)))
    return {
        "nuisance_rate": _shown(float(flown.sum() / all_clear.sum())),
        "nuisance_rate_ci95": [_shown(low), _shown(high)],
    }


def _interval(count: int, statistic: Callable[[NDArray[np.intp]], Array]) -> tuple[float, float]:
    """The bootstrap's 2.5 and 97.5 percentiles over encounters; always the same draws."""
    rng = np.random.default_rng(20_000)
    drawn = [statistic(rng.integers(0, count, size=(_CHUNK, count))) for _ in range(_RESAMPLES // _CHUNK)]
    values = np.concatenate(drawn)
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0, float("inf")
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def _divided(above: Array, below: Array) -> Array:
    quotient: Array = np.divide(above, below, out=np.full(len(above), np.nan), where=below > 0.0)
    return quotient


def _mean(columns: dict[str, Array], name: str) -> float:
    weight = columns["weight"]
    return _shown(float((weight * columns[name]).sum() / weight.sum())) if weight.sum() > 0.0 else 0.0


def _weighted_median(values: Array, weight: Array, chosen: NDArray[np.bool_]) -> float | None:
    values, weight = values[chosen], weight[chosen]
    if not len(values):
        return None
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order])
    return round(float(values[order][np.searchsorted(share, 0.5 * share[-1])]), 1)


def _shown(value: float) -> float:
    return float(f"{value:.4g}")
