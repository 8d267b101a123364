"""The page of a flight test: one HTML file with its figures, readable offline."""

import html
import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from companion.report.html import image, table
from companion.report.html import page as html_page
from sim.encounter_figure import COLOURS, DASHES, OWN, centre_map, draw_separation, laid_out
from sim.flight_test.judge import Judged
from sim.flight_test.report import COLUMNS, Report
from sim.flight_test.result import Result


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
    since_s = times_s - judged.begun_s
    figure, above, heights, apart = laid_out()
    above.plot(own_m[:, 1], own_m[:, 0], color=OWN, lw=1.6, label="own")
    heights.plot(since_s, -own_m[:, 2], color=OWN, lw=1.6)
    for i, (path, one) in enumerate(zip(seen, judged.intruders, strict=True)):
        shown = (times_s >= one.appears_s) & (times_s <= one.disappears_s)
        style: dict[str, Any] = {"color": COLOURS[i % 4], "ls": DASHES[i % 4], "lw": 1.6}
        above.plot(path[shown, 1], path[shown, 0], label=f"intruder {i + 1}", **style)
        heights.plot(since_s[shown], -path[shown, 2], **style)
    centre_map(above, own_m)
    draw_separation(apart, since_s, own_m, seen)
    for axes in (heights, apart):
        _mark(axes, judged)
    return figure


def _mark(axes: Axes, judged: Judged) -> None:
    """Lines at the first action and at the release."""
    for at_s, colour in ((judged.first_action_s, "#444"), (judged.given_back_s, "#999")):
        if at_s is not None and math.isfinite(at_s):
            axes.axvline(at_s, color=colour, lw=1.0)
