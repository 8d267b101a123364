"""The page of a flight test: one HTML file with its figures, readable offline."""

import html
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from companion.model import Layer
from companion.report.drawing import BANDS
from companion.report.html import image, table
from companion.report.html import page as html_page
from companion.units import (
    NMAC_HORIZONTAL_M,
    NMAC_VERTICAL_M,
    WELL_CLEAR_HORIZONTAL_M,
    WELL_CLEAR_VERTICAL_M,
)
from sim.flight_test.judge import Judged
from sim.flight_test.report import COLUMNS, Report
from sim.flight_test.result import Result

Array = NDArray[np.floating]

_OWN, _COLOURS = "#0072B2", ("#D55E00", "#009E73", "#CC79A7", "#000000")
_LOST, _NEAR = BANDS[Layer.OUTER], BANDS[Layer.INNER]
_SHOWN_RATIO = 4.0


def page(result: Result, report: Report) -> str:
    """The whole page as HTML."""
    name = " ".join(filter(None, (report["autopilot"], report["version"])))
    verdict = "passed" if report["passed"] else "not passed"
    parts = [
        "<h1>Flight test</h1>",
        f"<p>{html.escape(name)}: <b>{verdict}</b>. Companion {html.escape(report['companion_version'])}, "
        f"{html.escape(report['companion'])}; simulation shown by {html.escape(str(report['simulation']))}; "
        f"the vehicle's time ran {report['time_rate']:.2f} times as fast as ours.</p>",
    ]
    if report["problem"] is not None:
        parts.append(f"<p><b>Ended early: {html.escape(report['problem'])}</b></p>")
    parts.append(_summary(report))
    for judged, figures in zip(result.encounters, report["encounters"], strict=True):
        parts += _encounter(judged, figures)
    return html_page(f"Flight test: {name}", parts)


def _summary(report: Report) -> str:
    head = ["encounter", *(heading.replace("\n", " ") for heading, _ in COLUMNS), "refused", "result"]
    rows = []
    for each in report["encounters"]:
        figures = ["–" if each[key] is None else f"{each[key]:.0f}" for _, key in COLUMNS]
        refused = str(len(each["commands_refused"]))
        rows.append([html.escape(each["name"]), *figures, refused, html.escape(_words(each))])
    return table(head, rows)


def _words(encounter: Report) -> str:
    return "; ".join(encounter["failures"]) or "as expected"


def _encounter(judged: Judged, figures: Report) -> list[str]:
    words = _words(figures)
    parts = [f"<h2>{html.escape(judged.plan.name)}</h2>", f"<p class=why>{html.escape(words)}</p>"]
    if len(judged.path) > 1:
        parts.append(image(figure_of(judged), f"{judged.plan.name}: map, heights and separation"))
    events = [[f"{time_s:.1f} s", html.escape(text)] for time_s, text in figures["events"]]
    if events:
        parts.append(f"<details><summary>Timeline</summary>{table(('time', 'event'), events)}</details>")
    return parts


def figure_of(judged: Judged) -> Figure:
    """A figure of one encounter: map, heights, and separation over time with the volumes as bands."""
    times_s = np.array([time_s for time_s, _ in judged.path])
    own_m = np.array([place_m for _, place_m in judged.path])
    seen = [np.array([one.state_at(time_s)[0] for time_s in times_s]) for one in judged.intruders]
    reported = [(times_s >= one.appears_s) & (times_s <= one.disappears_s) for one in judged.intruders]
    since_s = times_s - judged.begun_s
    figure = Figure(figsize=(11.0, 4.4), layout="constrained")
    above, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.3), squeeze=False)[0]
    heights, apart = right.subplots(2, 1, sharex=True)
    _from_above(above.subplots(), own_m, [path[shown] for path, shown in zip(seen, reported, strict=True)])
    heights.plot(since_s, -own_m[:, 2], color=_OWN, lw=1.6)
    for i, (path, shown) in enumerate(zip(seen, reported, strict=True)):
        heights.plot(since_s[shown], -path[shown][:, 2], color=_COLOURS[i % 4], lw=1.6, ls="--")
    heights.set_ylabel("height [m]")
    _separation(apart, since_s, own_m, seen)
    for axes in (heights, apart):
        _mark(axes, judged)
    return figure


def _from_above(axes: Axes, own_m: Array, seen: Sequence[Array]) -> None:
    axes.plot(own_m[:, 1], own_m[:, 0], color=_OWN, lw=1.6, label="own")
    for i, path in enumerate(seen):
        axes.plot(path[:, 1], path[:, 0], color=_COLOURS[i % 4], lw=1.6, ls="--", label=f"intruder {i + 1}")
    reach_m = max(float(np.ptp(own_m[:, :2], axis=0).max()), 2500.0)
    centre = 0.5 * (own_m.min(0) + own_m.max(0))
    axes.set(
        xlim=(centre[1] - 0.6 * reach_m, centre[1] + 0.6 * reach_m),
        ylim=(centre[0] - 0.6 * reach_m, centre[0] + 0.6 * reach_m),
        aspect="equal", xlabel="east [m]", ylabel="north [m]",
    )  # fmt: skip
    axes.legend(fontsize=8)


def _separation(axes: Axes, since_s: Array, own_m: Array, seen: Sequence[Array]) -> None:
    for i, path in enumerate(seen):
        off_m = path - own_m
        horizontal = np.hypot(off_m[:, 0], off_m[:, 1]) / WELL_CLEAR_HORIZONTAL_M
        vertical = np.abs(off_m[:, 2]) / WELL_CLEAR_VERTICAL_M
        style: dict[str, Any] = {"color": _COLOURS[i % 4]}
        axes.plot(since_s, horizontal, lw=1.6, label="horizontal", **style)
        axes.plot(since_s, vertical, lw=0.8, ls=":", label="vertical", **style)
    near = max(NMAC_HORIZONTAL_M / WELL_CLEAR_HORIZONTAL_M, NMAC_VERTICAL_M / WELL_CLEAR_VERTICAL_M)
    axes.axhspan(0.0, 1.0, color=_LOST, zorder=0)
    axes.axhspan(0.0, near, color=_NEAR, zorder=0)
    axes.set(ylim=(0.0, _SHOWN_RATIO), xlabel="time [s]", ylabel="apart [well clear]")
    if seen:
        axes.legend(fontsize=8, loc="upper right", ncols=2)


def _mark(axes: Axes, judged: Judged) -> None:
    """Lines at the first action and at the release."""
    for at_s, colour in ((judged.first_action_s, "#444"), (judged.given_back_s, "#999")):
        if at_s is not None and math.isfinite(at_s):
            axes.axvline(at_s, color=colour, lw=1.0)
