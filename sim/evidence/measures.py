"""Measures of flown encounters: ratios with intervals, induced and unresolved events, and convergence."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.campaign.summary import Array, Figures, nuisance_of, ratio_of, summary_of

Mask = NDArray[np.bool_]
Columns = dict[str, Array]

_CLOSING_EDGES_MPS = (0.0, 30.0, 60.0, 90.0, np.inf)
# Bands of 500 and 1000 ft.
_HEIGHT_EDGES_M = (0.0, 152.4, 304.8, 609.6, 914.4, np.inf)
# Half of a 95 % interval as a share of the estimate: so small, it has converged.
CONVERGED = 0.05
_POINTS = 60
_EVENTS = {"nmac": "risk_ratio", "lowc": "lowc_ratio"}
# Words in the names of the encounter models.
_KINDS = {"fwse": "fixed wing, one engine", "fwme": "fixed wing, several engines", "rotorcraft": "rotorcraft"}


def row_of(columns: Columns) -> dict[str, Any]:
    """Ratios and nuisance with 95 % intervals; the counts of induced and of unresolved events."""
    return {
        "encounters": len(columns["number"]),
        "conflicts": int((columns["lowc0"] > 0.0).sum()),
        **ratio_of(columns, "risk_ratio", "nmac"),
        **ratio_of(columns, "lowc_ratio", "lowc"),
        **nuisance_of(columns),
        **_events(columns),
    }


def measured(figures: Figures) -> dict[str, Any]:
    """The whole summary of an avoider, with unresolved events apart from induced ones."""
    return summary_of(figures) | _events(figures.columns())


def _events(columns: Columns) -> dict[str, Any]:
    """Of near mid-air collisions and losses: how many were unresolved and induced, and their shares.

    Unresolved: there with and without avoidance. Induced: only with it. The shares are parts of the ratio.
    """
    found: dict[str, Any] = {}
    for event, ratio in _EVENTS.items():
        flown, nominal = columns[event] > 0.0, columns[f"{event}0"] > 0.0
        for name, chosen in (("unresolved", flown & nominal), ("induced", flown & ~nominal)):
            found[f"{name}_{event}"] = int(chosen.sum())
            found[f"{name}_{ratio}"] = _share(columns["weight"], chosen, nominal)
    return found


def _share(weight: Array, chosen: Mask, of: Mask) -> float | None:
    whole = float(weight[of].sum())
    return float(f"{weight[chosen].sum() / whole:.4g}") if whole > 0.0 else None


def chosen_columns(columns: Columns, chosen: Mask) -> Columns:
    """The columns of some of the encounters."""
    return {name: values[chosen] for name, values in columns.items()}


def groups_of(figures: Figures) -> dict[str, dict[str, Mask]]:
    """Masks of the encounters by group: geometry, closing speed, height band and aircraft type."""
    columns = figures.columns()
    kinds: dict[str, Mask] = {}
    for source, chosen in figures.words("source").items():
        kind = kind_of(source)
        kinds[kind] = kinds.get(kind, np.zeros(len(chosen), dtype=bool)) | chosen
    return {
        "geometry": figures.words("geometry"),
        "closing speed": _bands(columns["closing_mps"], _CLOSING_EDGES_MPS, "m/s"),
        "own height": _bands(columns["altitude_m"], _HEIGHT_EDGES_M, "m"),
        "other aircraft": kinds,
    }


def kind_of(source: str) -> str:
    """The type of the other aircraft: by the name of its model, otherwise the kind of encounter."""
    return next((kind for word, kind in _KINDS.items() if word in source), source or "not recorded")


def _bands(values: Array, edges: tuple[float, ...], unit: str) -> dict[str, Mask]:
    masks = {
        f"{low:.0f}-{high:.0f} {unit}" if np.isfinite(high) else f"over {low:.0f} {unit}": (values >= low)
        & (values < high)
        for low, high in pairwise(edges)
    }
    return {name: chosen for name, chosen in masks.items() if chosen.any()}


def sets_of(figures: Figures) -> dict[str, dict[str, float]]:
    """By model: encounters, their share of the weight, conflicts, and the effective number of encounters."""
    columns = figures.columns()
    whole = float(columns["weight"].sum())
    return {
        source: {
            "encounters": int(chosen.sum()),
            "weight_share": round(float(columns["weight"][chosen].sum()) / whole, 4),
            "conflicts": int((columns["lowc0"][chosen] > 0.0).sum()),
            "nmac_without": int((columns["nmac0"][chosen] > 0.0).sum()),
            "effective": round(_effective(columns["weight"][chosen]), 1),
        }
        for source, chosen in figures.words("source").items()
    }


def _effective(weight: Array) -> float:
    """The number of equally weighted encounters that would give the same variance (Kish)."""
    return float(weight.sum() ** 2 / (weight**2).sum())


def convergence_of(columns: Columns, event: str) -> dict[str, Any]:
    """The running estimate of a ratio with its 95 % interval, and whether it has converged.

    `relative`: half of the last interval as a share of the estimate. `moved`: the largest distance of the
    estimate from its last value within the last half of the encounters, as a share of that value. `needed`:
    encounters for a `relative` of 5 %.
    """
    ratio, half = _running(columns["weight"], columns[event], columns[f"{event}0"])
    count = len(ratio)
    shown = np.unique(np.geomspace(max(min(20, count), 1), max(count, 1), _POINTS).astype(int)) - 1
    shown = shown[np.isfinite(ratio[shown])] if count else shown[:0]
    return {
        "encounters": (shown + 1).tolist(),
        "estimate": _rounded(ratio[shown]),
        "low": _rounded(np.maximum(ratio[shown] - half[shown], 0.0)),
        "high": _rounded(ratio[shown] + half[shown]),
        **_verdict(ratio, half),
    }


def _running(weight: Array, flown: Array, nominal: Array) -> tuple[Array, Array]:
    """The ratio of weighted sums after each encounter, and half of its 95 % interval (delta method)."""
    whole = np.cumsum(weight * nominal)
    below = np.maximum(whole, 1e-300)
    ratio = np.where(whole > 0.0, np.cumsum(weight * flown) / below, np.nan)
    # Events are 0 or 1, so that they are their own squares.
    square = np.cumsum(weight**2 * flown) - 2.0 * ratio * np.cumsum(weight**2 * flown * nominal)
    square += ratio**2 * np.cumsum(weight**2 * nominal)
    return ratio, 1.96 * np.sqrt(np.maximum(square, 0.0)) / below


def _verdict(ratio: Array, half: Array) -> dict[str, Any]:
    """Whether the last estimate has converged; without any event there is nothing to compare with."""
    if not len(ratio) or not ratio[-1] > 0.0:
        return {"relative": None, "moved": None, "needed": None, "converged": False}
    relative, late = float(half[-1] / ratio[-1]), ratio[len(ratio) // 2 :]
    moved = float(np.abs(late - ratio[-1]).max() / ratio[-1])
    return {
        "relative": round(relative, 4),
        "moved": round(moved, 4) if np.isfinite(moved) else None,
        "needed": round(len(ratio) * max(relative / CONVERGED, 1.0) ** 2),
        "converged": relative <= CONVERGED,
    }


def _rounded(values: Array) -> list[float]:
    return [float(f"{value:.4g}") for value in values]
