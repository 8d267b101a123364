"""The figures of a campaign: ratios to flights without avoidance, with intervals, and their cost."""

from array import array
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.campaign.mirroring import SIDEWAYS, VERTICAL
from sim.campaign.results import ResultLine, percentile_ms

Array = NDArray[np.floating]

_RESAMPLES = 1000
_CHUNK = 2_000_000  # encounters resampled at a time, to bound memory
_COLUMNS = (
    "number", "surveillance", "geometry", "closing_mps", "weight", "nmac0", "lowc0", "nmac", "lowc",
    "avoided", "deviation_m", "height_m", "engagements", "return_s", "on_left_leg", "given_back_on_leg",
    "strayed_s", "mirrored", "source", "altitude_m",
)  # fmt: skip
# Pass lines for cooperative traffic, of ASTM F3442.
RISK_RATIO_LINE, LOWC_RATIO_LINE = 0.18, 0.40


class Figures:
    """The results of one avoider as columns of numbers, about a hundred bytes a result."""

    def __init__(self) -> None:
        self._numbers = array("d")
        self._words: dict[str, int] = {}
        self.timing: dict[str, int] = {}
        self.not_back = 0
        self.latest_back_s = 0.0

    def __len__(self) -> int:
        return len(self._numbers) // len(_COLUMNS)

    def add(self, result: ResultLine) -> None:
        """Add a result."""
        nominal, flown = result["nominal"], result["flown"]
        self._numbers.extend(
            (
                result["number"], self._code(result["surveillance"]), self._code(result["geometry"]),
                result["closing_mps"], result["weight"], nominal["nmac"], nominal["lowc"], flown["nmac"],
                flown["lowc"], result["avoided"], result["deviation_m"], result["height_m"],
                result["engagements"], _number_or_nan(result["return_s"]), bool(result["on_left_leg"]),
                bool(result["given_back_on_leg"]), result["strayed_s"], _mirrored(result.get("mirrored")),
                # Files of earlier versions have neither.
                self._code(result.get("source", "")), _number_or_nan(result.get("altitude_m")),
            )
        )  # fmt: skip
        self.not_back += result["back_s"] is None
        self.latest_back_s = max(self.latest_back_s, result["back_s"] or 0.0)
        for place, count in result["timing"].items():
            self.timing[place] = self.timing.get(place, 0) + count

    def columns(self) -> dict[str, Array]:
        """The columns, each (n,), sorted by number: sums do not depend on the order of the results."""
        table = np.array(self._numbers).reshape(-1, len(_COLUMNS))
        order = np.lexsort((table[:, 1], table[:, 0]))
        return dict(zip(_COLUMNS, table[order].T, strict=True))

    def words(self, column: str) -> dict[str, NDArray[np.bool_]]:
        """Masks (n,) of the results by the word in a column (`geometry`, `surveillance`, `source`)."""
        codes = self.columns()[column]
        found = {word: codes == code for word, code in sorted(self._words.items())}
        return {word: chosen for word, chosen in found.items() if chosen.any()}

    def _code(self, word: str) -> int:
        return self._words.setdefault(word, len(self._words))


def gather(results: Iterable[ResultLine], by: str = "avoider") -> dict[str, Figures]:
    """The results grouped by avoider, or by another text field."""
    figures: dict[str, Figures] = {}
    for result in results:
        figures.setdefault(result[by], Figures()).add(result)
    return figures


def summary_of(figures: Figures, encounters_per_s: float | None = None) -> dict[str, Any]:
    """The figures of one avoider, by the keys of the report."""
    columns = figures.columns()
    conflicts = columns["lowc0"] > 0.0
    return {
        "encounters": len(figures),
        "conflicts": int(conflicts.sum()),
        "p_nmac": _mean(columns, "nmac"),
        "p_lowc": _mean(columns, "lowc"),
        "induced_nmac": _induced(columns, "nmac"),
        "induced_lowc": _induced(columns, "lowc"),
        **ratio_of(columns, "risk_ratio", "nmac"),
        **ratio_of(columns, "lowc_ratio", "lowc"),
        "median_max_deviation_m": _weighted_median(columns["deviation_m"], columns["weight"], conflicts),
        "median_max_height_m": _weighted_median(columns["height_m"], columns["weight"], conflicts),
        **nuisance_of(columns),
        "engaged_more_than_once": int((columns["engagements"] > 1.0).sum()),
        "mean_engagements": _mean_of_engaged(columns),
        "not_back_on_leg": figures.not_back,
        **_back_on(columns),
        "latest_back_s": figures.latest_back_s,
        "back_s": _quantiles(columns["return_s"]),
        "strayed_s": _quantiles(columns["strayed_s"][columns["engagements"] > 0.0]),
        **_cancelling(columns),
        "decision_ms": {
            "p50": percentile_ms(figures.timing, 0.5),
            "p99": percentile_ms(figures.timing, 0.99),
        },
        "encounters_per_s": encounters_per_s,
    }


def _induced(columns: dict[str, Array], event: str) -> int:
    """The number of encounters in which the event happens only with avoidance."""
    return int(((columns[event] > 0.0) & (columns[f"{event}0"] == 0.0)).sum())


def ratio_of(columns: dict[str, Array], name: str, event: str) -> dict[str, object]:
    """The ratio of an event's frequency with and without avoidance, and its 95 % bootstrap interval.

    `None` if the event never happens without avoidance.
    """
    weight = columns["weight"]
    flown, nominal = weight * columns[event], weight * columns[f"{event}0"]
    if nominal.sum() <= 0.0:
        return {name: None, f"{name}_ci95": None}
    ratio = float(flown.sum() / nominal.sum())
    low, high = interval(len(weight), lambda picked: _divided(flown[picked].sum(1), nominal[picked].sum(1)))
    if not flown.any():
        # Resampling shows no spread if the event never happened: the rule of three bounds it.
        high = _bound_without_events(nominal)
    return {name: _shown(ratio), f"{name}_ci95": [_shown(low), _shown(high)]}


def _bound_without_events(nominal: Array) -> float:
    """The upper 95 % bound of a ratio without events: 3 / effective number of weighted samples."""
    effective = float(nominal.sum() ** 2 / (nominal**2).sum())
    return min(3.0 / effective, 1.0)


def nuisance_of(columns: dict[str, Array]) -> dict[str, object]:
    """The share of encounters with avoidance among those that stay well clear without it."""
    clear = columns["lowc0"] == 0.0
    flown, all_clear = columns["weight"] * columns["avoided"] * clear, columns["weight"] * clear
    if all_clear.sum() <= 0.0:
        return {"nuisance_rate": None, "nuisance_rate_ci95": None}
    low, high = interval(len(clear), lambda picked: _divided(flown[picked].sum(1), all_clear[picked].sum(1)))
    return {
        "nuisance_rate": _shown(float(flown.sum() / all_clear.sum())),
        "nuisance_rate_ci95": [_shown(low), _shown(high)],
    }


def interval(count: int, statistic: Callable[[NDArray[np.intp]], Array]) -> tuple[float, float]:
    """The bootstrap's 2.5 and 97.5 percentiles over encounters, with a fixed seed."""
    rng = np.random.default_rng(20_000)
    at_once = max(_CHUNK // count, 1)
    sizes = [min(at_once, _RESAMPLES - begun) for begun in range(0, _RESAMPLES, at_once)]
    values = np.concatenate([statistic(rng.integers(0, count, size=(size, count))) for size in sizes])
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0, float("inf")
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def _divided(above: Array, below: Array) -> Array:
    quotient: Array = np.divide(above, below, out=np.full(len(above), np.nan), where=below > 0.0)
    return quotient


def _back_on(columns: dict[str, Array]) -> dict[str, int]:
    """How many of the engaged were given back on leg and height, and back on the leg left or a later one."""
    back = (columns["engagements"] > 0.0) & np.isfinite(columns["return_s"])
    on_left = back & (columns["on_left_leg"] > 0.0)
    given_back = back & (columns["given_back_on_leg"] > 0.0)
    return {
        "given_back_on_leg": int(given_back.sum()),
        "back_on_left_leg": int(on_left.sum()),
        "back_on_later_leg": int((back & ~on_left).sum()),
    }


def _mirrored(ways: list[str] | None) -> float:
    """How maneuvers cancelled, as a number: 1 vertically, 2 sideways, 3 both; NaN unless both avoided."""
    return float("nan") if ways is None else (VERTICAL in ways) + 2.0 * (SIDEWAYS in ways)


def _cancelling(columns: dict[str, Array]) -> dict[str, object]:
    """In two-sided encounters: how often both avoided, how often they mirrored, and lost well clear so."""
    mirrored = columns["mirrored"]
    both = mirrored[np.isfinite(mirrored)]
    if not len(both):
        return {}
    counts = {
        VERTICAL: np.isin(both, (1.0, 3.0)), SIDEWAYS: both >= 2.0, "either": both > 0.0,
        "lowc": (mirrored > 0.0)[np.isfinite(mirrored)] & (columns["lowc"][np.isfinite(mirrored)] > 0.0),
    }  # fmt: skip
    return {
        "both_avoided": len(both),
        "mirrored": {name: int(chosen.sum()) for name, chosen in counts.items()},
    }


def _mean_of_engaged(columns: dict[str, Array]) -> float | None:
    """Engagements per encounter, of those with any."""
    engaged = columns["engagements"][columns["engagements"] > 0.0]
    return round(float(engaged.mean()), 3) if len(engaged) else None


def _quantiles(values: Array) -> dict[str, float | None]:
    """Median and 95 % quantile of the values that are known."""
    known = values[np.isfinite(values)]
    if not len(known):
        return {"p50": None, "p95": None}
    return {f"p{share}": round(float(np.percentile(known, share)), 1) for share in (50, 95)}


def _number_or_nan(value: float | None) -> float:
    return float("nan") if value is None else value


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
