"""The parts of a report's figures: phases of a flight, paths, bands, lines and axes."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from companion.model import Layer
from companion.report.drawing import BANDS, COLOURS, DASHES, INK, dress
from companion.report.encounters import Encounter
from companion.report.flight import LAYERS, Flight, Floats
from companion.units import (
    NMAC_HORIZONTAL_M,
    NMAC_VERTICAL_M,
    WELL_CLEAR_HORIZONTAL_M,
    WELL_CLEAR_VERTICAL_M,
)

Indices = NDArray[np.int64]
Style = dict[str, Any]

_WIDTH_IN = 10.5
MAX_POINTS = 3000  # of a line; more are not visible, and would make a page of many megabytes
_ROUND_S = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 86400)
AROUND_S = 75.0  # before and after the closest point of an encounter
_APART_M = (4.0 * WELL_CLEAR_HORIZONTAL_M, 4.0 * WELL_CLEAR_VERTICAL_M)


@dataclass(frozen=True)
class Phase:
    """A combination of flying or not and the layer that decided, with its drawing style."""

    flying: bool
    layer: Layer
    label: str
    line: Style
    band: Style | None = None


_OUTER: Style = {"color": "#C77700", "ls": DASHES[1]}
_INNER: Style = {"color": "#B3261E", "ls": DASHES[3]}
PHASES = (
    Phase(False, Layer.CLEAR, "not flown by Companion", {"color": COLOURS[0], "ls": "-", "lw": 1.4}),
    Phase(
        True, Layer.CLEAR, "rejoin, flown", {"color": COLOURS[1], "ls": DASHES[2], "lw": 2.4},
        {"color": "#CFE8DF", "hatch": None},
    ),
    Phase(
        True, Layer.OUTER, "outer layer, flown", _OUTER | {"lw": 2.8},
        {"color": BANDS[Layer.OUTER], "hatch": None},
    ),
    Phase(
        True, Layer.INNER, "inner layer, flown", _INNER | {"lw": 3.2},
        {"color": BANDS[Layer.INNER], "hatch": None},
    ),
    Phase(
        False, Layer.OUTER, "outer layer, advice only", _OUTER | {"lw": 1.4},
        {"color": BANDS[Layer.OUTER], "hatch": "//"},
    ),
    Phase(
        False, Layer.INNER, "inner layer, advice only", _INNER | {"lw": 1.6},
        {"color": BANDS[Layer.INNER], "hatch": "//"},
    ),
)  # fmt: skip


def draw_path(axes: Axes, flight: Flight, at: Indices, unit_m: float) -> list[Line2D]:
    """Draw our path at these rows, in units of `unit_m`; returns legend entries of the phases that occur."""
    east, north = flight.column("east_m") / unit_m, flight.column("north_m") / unit_m
    used = {}
    for phase, first, end in runs(flight, at):
        points = thinned(at[first : end + 1])
        axes.plot(east[points], north[points], **phase.line, zorder=4 if phase is PHASES[0] else 5)
        used[phase.label] = phase
    return [Line2D([], [], **one.line, label=one.label) for one in PHASES if one.label in used]


def draw_other(
    axes: Axes, flight: Flight, one: Encounter, number: int, unit_m: float, shown: Indices | None = None
) -> Line2D:
    """Draw the path of an aircraft, a line between both positions at the closest point, and the distance."""
    style = other_style(number)
    if shown is None:
        near = np.abs(flight.time_s[one.at] - flight.time_s[one.closest_at]) <= AROUND_S
        shown = np.flatnonzero(near)
    north_m, east_m = positions_m(flight, one)
    points = thinned(shown)
    axes.plot(east_m[points] / unit_m, north_m[points] / unit_m, lw=1.3, zorder=3, **style)
    ours = flight.column("east_m")[one.closest_at], flight.column("north_m")[one.closest_at]
    theirs = east_m[one.closest], north_m[one.closest]
    axes.plot(
        [ours[0] / unit_m, theirs[0] / unit_m], [ours[1] / unit_m, theirs[1] / unit_m],
        "o-", color=INK, lw=0.8, ms=5, mfc="white", zorder=6,
    )  # fmt: skip
    distance = f"{one.closest_slant_m:.0f} m"
    axes.annotate(
        distance, (theirs[0] / unit_m, theirs[1] / unit_m), xytext=(6, 6), textcoords="offset points",
        fontsize=8, color=INK, zorder=8,
    )  # fmt: skip
    return Line2D([], [], lw=1.3, **style, label=f"{one.name}, near its closest point")


def draw_well_clear(axes: Axes, flight: Flight, one: Encounter) -> None:
    """Draw the well clear volume around the other aircraft at the closest point, from above."""
    north_m, east_m = positions_m(flight, one)
    centre = east_m[one.closest], north_m[one.closest]
    axes.add_patch(
        Circle(centre, WELL_CLEAR_HORIZONTAL_M, fill=False, color=INK, lw=1.0, ls=(0, (8, 2)), zorder=2)
    )


def positions_m(flight: Flight, one: Encounter) -> tuple[Floats, Floats]:
    """The positions of the other aircraft, north and east [m]."""
    chosen = np.searchsorted(one.history.at, one.at)
    north_m, east_m = (relative[chosen] for relative in one.history.relative_m)
    return north_m + flight.column("north_m")[one.at], east_m + flight.column("east_m")[one.at]


def mark_times(axes: Axes, flight: Flight, at: Indices, unit_m: float) -> None:
    """Draw dots on our path at round times, about ten of them."""
    times_s = flight.time_s[at]
    span_s = float(times_s[-1] - times_s[0])
    every_s = next((n for n in _ROUND_S if span_s / n <= 10.0), 86_400)
    for mark_s in np.arange(math.ceil(times_s[0] / every_s) * every_s, times_s[-1], every_s)[:12]:
        here = at[min(int(np.searchsorted(times_s, mark_s)), len(at) - 1)]
        position = flight.column("east_m")[here] / unit_m, flight.column("north_m")[here] / unit_m
        axes.plot(*position, ".", color=INK, ms=5, zorder=6)
        axes.annotate(
            clock(float(mark_s)),
            position,
            xytext=(5, -9),
            textcoords="offset points",
            fontsize=7.5,
            color=INK,
            zorder=8,
        )


def runs(flight: Flight, at: Indices) -> Iterator[tuple[Phase, int, int]]:
    """The runs of rows in one phase, as first and last index into `at`."""
    if not at.size:
        return
    codes = flight.column("layer")[at].astype(int) + len(LAYERS) * flight.flying[at]
    edges = np.flatnonzero(np.diff(codes)) + 1
    for first, end in zip([0, *edges], [*edges, len(at)], strict=True):
        flying, layer = divmod(int(codes[first]), len(LAYERS))
        phase = next(p for p in PHASES if (p.flying, p.layer) == (bool(flying), LAYERS[layer]))
        yield phase, int(first), int(min(end, len(at) - 1))


def shade(
    flight: Flight, panels: Sequence[Axes], begin_s: float = -math.inf, end_s: float = math.inf
) -> list[Patch]:
    """Draw bands behind the times when a layer decided; returns legend entries of those that occur."""
    used = {}
    for phase, first, end in runs(flight, np.arange(len(flight))):
        from_s, to_s = float(flight.time_s[first]), float(flight.time_s[end])
        if phase.band is None or to_s < begin_s or from_s > end_s:
            continue
        used[phase.label] = phase
        for axes in panels:
            axes.axvspan(from_s, to_s, **band(phase.band), lw=0, zorder=0)
    return [Patch(**band(p.band), label=p.label) for p in PHASES if p.label in used and p.band]


def band(style: Style) -> Style:
    """The style of a band: filled if flown, hatched if advice only."""
    hatch = style["hatch"]
    return {"facecolor": "white" if hatch else style["color"], "edgecolor": style["color"], "hatch": hatch}


def separation_lines(horizontal: Axes, vertical: Axes) -> list[Line2D]:
    """Draw lines at well clear and at near mid-air collision, and limit the axes to distances of interest."""
    lines = (
        (horizontal, WELL_CLEAR_HORIZONTAL_M, NMAC_HORIZONTAL_M, _APART_M[0]),
        (vertical, WELL_CLEAR_VERTICAL_M, NMAC_VERTICAL_M, _APART_M[1]),
    )
    well_clear: Style = {"color": INK, "lw": 1.0, "ls": (0, (8, 2))}
    nmac: Style = {"color": "#B3261E", "lw": 1.2, "ls": (0, (2, 1))}
    for axes, clear_m, near_m, most_m in lines:
        axes.axhline(clear_m, **well_clear)
        axes.axhline(near_m, **nmac)
        axes.set_ylim(0.0, most_m)
    dress(horizontal, "", "horizontal [m]")
    dress(vertical, "", "vertical [m]")
    return [
        Line2D([], [], **well_clear, label="well clear, 610 m and 76 m"),
        Line2D([], [], **nmac, label="near mid-air collision, 152 m and 30 m"),
    ]


def over_time(axes: Axes, begin_s: float, end_s: float) -> None:
    """Set up a time axis in minutes and seconds."""
    end_s = max(end_s, begin_s + 1.0)
    every_s = next((n for n in _ROUND_S if (end_s - begin_s) / n <= 10.0), (end_s - begin_s) / 10.0)
    axes.set_xlim(begin_s, end_s)
    axes.set_xticks(np.arange(math.ceil(begin_s / every_s) * every_s, end_s + 1e-6, every_s))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: clock(value)))
    axes.set_xlabel("time")


def clock(time_s: float) -> str:
    """Seconds as text such as 1:02:03."""
    sign, whole = "-" if time_s < -0.5 else "", abs(round(time_s))
    hours, minutes, seconds = whole // 3600, whole // 60 % 60, whole % 60
    return f"{sign}{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{sign}{minutes}:{seconds:02d}"


def other_style(number: int) -> Style:
    """The style of the drawn aircraft with this number; the first colour of the palette is ours."""
    each = len(COLOURS) - 1
    return {"color": COLOURS[1 + number % each], "ls": DASHES[1 + number % each]}


def without_wraps(course_deg: Floats) -> Floats:
    """The course with gaps where it passes through north."""
    course_deg = course_deg.copy()
    course_deg[1:][np.abs(np.diff(course_deg)) > 180.0] = np.nan
    return course_deg


def thinned(at: Indices) -> Indices:
    """At most about `MAX_POINTS` of the rows, including the last one."""
    every = math.ceil(len(at) / MAX_POINTS)
    return at if every <= 1 else np.append(at[:-1:every], at[-1])


def extent(east: Floats, north: Floats) -> tuple[Floats, Floats]:
    """Lower left and upper right corner of a frame with a margin; at most three times as long as wide."""
    low, high = np.array([east.min(), north.min()]), np.array([east.max(), north.max()])
    longer = max(float((high - low).max()), 0.5)
    half = np.maximum((high - low) / 2.0, longer / 6.0) + 0.12 * longer
    return (low + high) / 2.0 - half, (low + high) / 2.0 + half


def new_figure(height_in: float) -> Figure:
    """An empty figure as wide as the page; `height_in` in inches."""
    return Figure((_WIDTH_IN, height_in), layout="constrained")
