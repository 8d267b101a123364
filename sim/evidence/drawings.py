"""The analysis as figures."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from sim.evidence.pass_lines import PASS_LINES

Row = Mapping[str, Any]

_WIDTH_IN = 8.0
# Colours that are told apart also by readers who see few of them.
_RISK, _LOWC, _NUISANCE = "#D55E00", "#0072B2", "#009E73"
_MEASURES = (
    ("risk_ratio", "risk ratio", _RISK, "s"),
    ("lowc_ratio", "well clear ratio", _LOWC, "o"),
    ("nuisance_rate", "unnecessary", _NUISANCE, "^"),
)
_MARKS = "osD^vPX"
# Colour, strictest pass line, and words of a ratio.
_LOOKS = {
    "risk_ratio": (_RISK, min(line.risk_ratio for line in PASS_LINES), "risk ratio"),
    "lowc_ratio": (_LOWC, min(line.lowc_ratio for line in PASS_LINES), "well clear ratio"),
}


def convergence(by_preset: Mapping[str, Mapping[str, Row]]) -> Figure:
    """Running estimates of both ratios with their intervals, a row for each preset."""
    figure, grid = _grid(len(by_preset), 2, 1.5)
    for row, (preset, ratios) in zip(grid, by_preset.items(), strict=True):
        for axes, (name, one) in zip(row, ratios.items(), strict=True):
            colour, line, words = _LOOKS[name]
            axes.plot(one["encounters"], one["estimate"], color=colour, lw=1.4)
            axes.fill_between(one["encounters"], one["low"], one["high"], color=colour, alpha=0.2, lw=0)
            axes.axhline(line, color="#666", lw=0.8, ls="--")
            highest = max([line * 1.5, *one["high"][len(one["high"]) // 3 :]])
            axes.set(ylim=(0.0, min(highest, 1.2)), xscale="log")
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.set_title(f"{preset}: {words}", fontsize=9, loc="left")
    for axes in grid[-1]:
        axes.set_xlabel("encounters", fontsize=8)
    return figure


def sweeps(found: Sequence[Row]) -> Figure:
    """Each sweep in its own axes: the ratios and unnecessary manoeuvres over the varied value."""
    figure, grid = _grid((len(found) + 1) // 2, 2, 2.1)
    for axes, one in zip(grid.flat, found, strict=False):
        _draw_sweep(axes, one)
    for axes in grid.flat[len(found) :]:
        axes.set_visible(False)
    looks = [Line2D([], [], color=colour, marker=mark, label=words) for _, words, colour, mark in _MEASURES]
    figure.legend(handles=looks, loc="outside lower center", ncols=len(looks), fontsize=8)
    return figure


def _draw_sweep(axes: Axes, one: Row) -> None:
    places = np.arange(len(one["points"]), dtype=float)
    for name, words, colour, mark in _MEASURES:
        _draw_points(axes, places, one["points"], name, label=words, color=colour, marker=mark)
        places = places + 0.08  # intervals side by side
    axes.set_xticks(np.arange(len(one["points"])), [point["label"] for point in one["points"]])
    axes.set_ylim(0.0, 1.02)
    axes.set_title(one["title"] + (f" [{one['unit']}]" if one["unit"] else ""), fontsize=9, loc="left")


def _draw_points(axes: Axes, places: Any, points: Sequence[Row], name: str, **style: Any) -> None:
    """Values with their intervals; points without a value are left out."""
    known = [(place, point) for place, point in zip(places, points, strict=True) if point[name] is not None]
    if not known:
        return
    values = np.array([point[name] for _, point in known])
    edges = np.array([point[f"{name}_ci95"] for _, point in known]).T
    spread = np.abs(np.clip(edges, 0.0, 1.5) - values)
    axes.errorbar([place for place, _ in known], values, spread, ms=4, lw=1.0, capsize=2, **style)


def trade_off(points: Sequence[Row]) -> Figure:
    """Well clear ratio over the rate of unnecessary manoeuvres, the chosen point marked."""
    figure = Figure(figsize=(_WIDTH_IN, 3.8), layout="constrained")
    axes = figure.subplots()
    known = [point for point in points if None not in (point["lowc_ratio"], point["nuisance_rate"])]
    for mark, point in zip(_MARKS, known, strict=False):
        across, up = (np.array(point[f"{name}_ci95"]) for name in ("nuisance_rate", "lowc_ratio"))
        here = point["nuisance_rate"], point["lowc_ratio"]
        style: dict[str, Any] = {"color": "#888", "ms": 6}
        if not point["changes"]:
            style = {"color": _RISK, "ms": 11, "zorder": 5}
        axes.errorbar(
            *here, xerr=np.abs(across - here[0])[:, None], yerr=np.abs(up - here[1])[:, None],
            lw=0.7, capsize=2, marker=mark, label=point["label"], **style,
        )  # fmt: skip
    axes.set(
        xlabel="rate of unnecessary manoeuvres", ylabel="well clear ratio", xlim=(0, None), ylim=(0, None)
    )
    if known:
        axes.legend(fontsize=8)
    axes.grid(color="#ddd", lw=0.6)
    return figure


def tracks(by_preset: Mapping[str, Row]) -> Figure:
    """NEES of position and velocity by preset, with the chi-square interval as a band."""
    known = {name: one for name, one in by_preset.items() if one["encounters"]}
    figure, grid = _grid(1, 2, 2.8)
    for axes, what in zip(grid[0], ("position", "velocity"), strict=True):
        places = np.arange(len(known))
        for off, prefix, words, colour in (
            (-0.2, "", "as used", _LOWC), (0.2, "shifted_", "apart from latency", _NUISANCE),
        ):  # fmt: skip
            values = [max(one[f"{prefix}{what}_nees"], 1e-3) for one in known.values()]
            axes.bar(places + off, values, 0.4, label=words, color=colour)
        if known:
            low, high = next(iter(known.values()))["interval"]
            axes.axhspan(low, high, color="#000", alpha=0.15, lw=0)
        axes.set_yscale("log")
        axes.set_xticks(places, list(known), rotation=30, ha="right")
        axes.set_title(f"NEES of {what}", fontsize=9, loc="left")
    grid[0][0].legend(fontsize=7)
    return figure


def _grid(rows: int, columns: int, row_in: float) -> tuple[Figure, Any]:
    figure = Figure(figsize=(_WIDTH_IN, row_in * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat:
        axes.tick_params(labelsize=7)
        axes.grid(color="#ddd", lw=0.6)
    return figure, grid
