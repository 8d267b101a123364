"""The figure of sources: when each of them reported each aircraft, and when it was not heard."""

from collections.abc import Sequence
from typing import Any, Final

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from companion.output.sighting import NOT_HEARD
from companion.report.drawing import COLOURS, GREY, dress
from companion.report.flight import Flight, TrackHistory
from companion.report.plotting import new_figure, over_time

MAX_DRAWN: Final = 12
_HATCHES: Final = ("", "////", "....", "\\\\\\\\", "xxxx", "----")
# A single report is as wide as this share of the flight.
_LEAST_SHARE: Final = 0.003


def sources(flight: Flight, aircraft: Sequence[TrackHistory]) -> Figure:
    """One row for each aircraft, with a bar for each source; pale where it was coasted."""
    names = sorted({source for one in aircraft for source in one.sighting.sources})
    styles = {name: _style(number) for number, name in enumerate(names)}
    drawing = new_figure(0.9 + 0.42 * len(aircraft) + 0.2 * (1 + len(names) // 2))
    axes = drawing.subplots()
    least_s = _LEAST_SHARE * max(float(flight.time_s[-1]), 1.0)
    for row, one in enumerate(aircraft):
        spans_s = one.sighting.spans_s
        heard = one.sighting.sources
        for begin_s, end_s in spans_s.get(NOT_HEARD, ()):
            axes.broken_barh([(begin_s, max(end_s - begin_s, least_s))], (row - 0.4, 0.8), **_COASTED)
        for number, source in enumerate(heard):
            height = 0.8 / len(heard)
            bars = [(begin_s, max(end_s - begin_s, least_s)) for begin_s, end_s in spans_s[source]]
            axes.broken_barh(bars, (row - 0.4 + number * height, height), **styles[source])
    axes.set_yticks(range(len(aircraft)), [one.name for one in aircraft])
    axes.set_ylim(len(aircraft) - 0.5, -0.5)
    dress(axes, "", "")
    over_time(axes, 0.0, float(flight.time_s[-1]))
    keys = [Patch(**styles[name], label=name) for name in names]
    if any(NOT_HEARD in one.sighting.spans_s for one in aircraft):
        keys.append(Patch(**_COASTED, label="not heard, coasted"))
    drawing.legend(handles=keys, loc="outside lower center", ncols=2, fontsize=9, frameon=False)
    return drawing


_COASTED: Final[dict[str, Any]] = {"facecolor": "#eeeeee", "edgecolor": GREY, "linestyle": "--", "lw": 0.8}


def _style(number: int) -> dict[str, Any]:
    """Sources differ in colour and hatching."""
    hatch = _HATCHES[number // len(COLOURS) % len(_HATCHES)]
    return {"facecolor": COLOURS[number % len(COLOURS)], "edgecolor": "white", "hatch": hatch, "lw": 0.4}
