"""Figures of the paper's experiments, written as PNG files.

A layer is a pale band: none on the mission, narrow for the outer, wide and darker for the inner layer. UAVs
and strategies differ in colour and in marker or dash pattern, so the figures are readable without colour.
"""

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, PercentFormatter
from numpy.typing import NDArray

from companion.model import Layer
from companion.report.drawing import BANDS, COLOURS, DASHES, GREY, INK, dress
from sim.paper import measures
from sim.paper.flight import LAYERS, Flight
from sim.paper.studies import TransitionPoint

Array = NDArray[np.float64]
Box = tuple[Array, Array]  # lower left and upper right corner
Window = tuple[int, int]  # first and last step shown
Style = dict[str, Any]

_COLUMN_IN, _PAGE_IN = 5.2, 8.0  # printed 3.5 and 7.2 inches wide, with letters of at least 5 points
_MARKERS = ("o", "s", "D", "^", "v", "P")
_STRATEGIES = tuple(Style(color=c, ls=dash, lw=1.7) for c, dash in zip(COLOURS, DASHES, strict=True))
_BANDS = {Layer.OUTER: (BANDS[Layer.OUTER], 6.0), Layer.INNER: (BANDS[Layer.INNER], 10.0)}
_STANDING, _MOVING = "#a8a8a8", ("#D6EAF7", "#D3EBDD", "#F1DDE9", "#F0EDC0")
_KEY: Style = {"loc": "outside lower center", "fontsize": 9, "frameon": False, "columnspacing": 1.4}
_TEXT: Style = {"fontsize": 7.5, "ha": "center", "va": "center_baseline", "color": INK, "zorder": 8}
_EDGE: Style = {"facecolors": "none", "linewidths": 0.7, "linestyles": "--"}
_COMMANDED: Style = {"lw": 0.9, "ls": (0, (4, 1.5))}
# With more obstacles or UAVs than this, names, numbers and circles are left out.
_NAMED_OBSTACLES, _NAMED_UAVS = 12, 6


def trajectory(flight: Flight, path: Path) -> None:
    """Figure 7: the whole flight from above."""
    _draw_periods(flight, 7, [(0, flight.steps)], path)


def trajectories_in_time(flight: Flight, path: Path) -> None:
    """Figure 10: the flight from above in four successive periods."""
    bounds = np.linspace(0, flight.steps, 5).round().astype(int).tolist()
    _draw_periods(flight, 10, list(itertools.pairwise(bounds)), path)


def commands_over_time(flight: Flight, path: Path) -> None:
    """Figures 8 and 11: heading and speed, flown and commanded."""
    group = len(flight.uavs) > 1
    number = 11 if group else 8
    figure = _figure(_COLUMN_IN, 5.6, f"Figure {number}: heading and speed, {flight.method.label}")
    heading, speed = figure.subplots(2, 1, sharex=True)
    keys: list[Artist] = []
    for i, one in enumerate(flight.uavs):
        flown, steps = slice(0, one.steps + 1), np.arange(one.steps + 1)
        course, style = np.unwrap(one.course[flown]), {"color": COLOURS[i % 6], "lw": 1.7}
        commanded: Style = _COMMANDED | {"color": COLOURS[i % 6] if group else INK}
        if group:
            style |= {"marker": _MARKERS[i % 6], "ms": 5.0, "markevery": max(one.steps // 9, 1)}
        heading.plot(steps, np.degrees(course), **style)
        heading.plot(steps[:-1], np.degrees(course + one.turn_command[flown])[:-1], **commanded)
        keys += speed.plot(steps, one.speed[flown], **style, label=one.uav.id if group else "flown")
        speed.plot(steps[:-1], one.uav.step + one.speed_command[: one.steps], **commanded)
    keys = [*keys[:_NAMED_UAVS], Line2D([], [], color=INK, **_COMMANDED, label="commanded")]
    for axes, layer in itertools.product((heading, speed), () if group else _BANDS):
        for first, end in _runs(flight, 0, layer):
            axes.axvspan(first, end, color=_BANDS[layer][0], alpha=0.7, lw=0)
    dress(heading, "", "heading [°]")
    dress(speed, "step", "speed [lengths per step]")
    speed.set_xlim(0, max(flight.steps, 1))
    figure.legend(handles=keys + ([] if group else _layer_key()), ncols=4, **_KEY)
    figure.savefig(path)


def safety_over_time(flights: Sequence[Flight], path: Path) -> None:
    """Figures 9 and 12: shortest distance and safety value at every step, one line per strategy."""
    number = 12 if any(len(flight.uavs) > 1 for flight in flights) else 9
    height_in, title = 5.8 + 0.15 * len(flights), f"Figure {number}: shortest distance and safety value"
    figure = _figure(_COLUMN_IN, height_in, title)
    upper, lower = figure.subplots(2, 1, sharex=True)
    keys: list[Artist] = []
    for i, flight in enumerate(flights):
        safety, label = measures.safety_values(flight), flight.method.label
        style = _STRATEGIES[(len(flights) - 1 - i) % 6]
        if safety.size:
            upper.plot(measures.distances(flight).min(axis=1), **style)
            lower.plot(safety, **style)
            label = f"{label} (mean safety value {safety.mean():.2f})"
        keys.append(Line2D([], [], **style, label=label))
    contacts, scene = measures.contacts(flights[0]), flights[0].scene
    if contacts.size:
        edges = np.unique([contacts.min(), contacts.max()])
        begins = edges - scene.uav_radius + scene.inner_radius
        spans = [upper.axhspan(0.0, edge, color=GREY, alpha=0.3, lw=0) for edge in edges]
        lines = [upper.axhline(begin, color=GREY, lw=0.9, ls="--") for begin in begins]
        spans[0].set_label("collision, " + " to ".join(f"{edge:.3g}" for edge in edges))
        lines[0].set_label("inner layer, " + " to ".join(f"{begin:.3g}" for begin in begins))
        keys += [spans[0], lines[0]]
    dress(upper, "", "shortest distance [lengths]")
    dress(lower, "step", "safety value, eq. 3 [lengths]")
    upper.set_ylim(bottom=0.0)
    lower.set_xlim(0, max(flight.steps for flight in flights))
    figure.legend(handles=keys, **_KEY)
    figure.savefig(path)


def minima(rows: Mapping[str, Sequence[Flight]], path: Path) -> None:
    """Local minima: one row of maps per scene, one column per strategy."""
    tall, wide = len(rows), max(len(flights) for flights in rows.values())
    figure = _figure(max(2.2 * wide, 4.5), 2.6 * tall + 1.0, "Local minima of the potential field")
    grid = figure.subplots(tall, wide, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for row, (name, flights) in zip(grid, rows.items(), strict=True):
        view = _view(flights)
        for axes, flight in zip(row, flights, strict=False):
            axes.set_axis_on()
            _draw_map(axes, flight, view, (0, flight.steps), 0)
            measured, label = measures.measure(flight), textwrap.fill(flight.method.label, 26)
            end = f"arrived in {measured.steps} steps" if measured.arrived else "did not arrive"
            end += ", collided" if measured.collisions else ""
            axes.set_title(f"{label}\n{end}\nturn reversals: {measured.jitter}", fontsize=8.5)
            axes.set(xlabel="", ylabel="")
        row[0].set_ylabel(name.replace("-", " "), fontweight="bold")
    figure.legend(handles=_map_key(next(iter(rows.values()))[0], 0), ncols=4, **_KEY)
    figure.savefig(path)


def transition(points: Sequence[TransitionPoint], chosen_deg: float, path: Path) -> None:
    """The effect of the width of the transition domain, with 95 % intervals."""
    figure = _figure(_PAGE_IN, 5.8, "Transition domain, with 95 % intervals")
    panels = figure.subplots(2, 2, sharex=True).ravel()
    names = list(dict.fromkeys(point.method for point in points))
    for i, name in enumerate(names):
        mine = sorted((p for p in points if p.method == name), key=lambda p: p.delta_beta_deg)
        x, style = [p.delta_beta_deg for p in mine], _STRATEGIES[(len(names) - 1 - i) % 6]
        rows = [(p.safety_value, p.arrived_share, p.min_clearance, p.path_ratio) for p in mine]
        for axes, (value, low, high) in zip(panels, np.array(rows).transpose(1, 2, 0), strict=True):
            axes.fill_between(x, low, high, color=style["color"], alpha=0.18, lw=0)
            axes.vlines(x, low, high, color=style["color"], lw=0.8, alpha=0.6)
            axes.plot(x, value, **style, marker=_MARKERS[i % 6], ms=4.5, label=name)
    labels = ("safety value [lengths]", "flights that arrived", "smallest clearance [lengths]", "path ratio")
    for axes, label in zip(panels, labels, strict=True):
        axes.axvline(chosen_deg, color=INK, lw=0.9, label=f"chosen: {chosen_deg:g}°")
        axes.xaxis.set_major_locator(MaxNLocator(7, steps=[1, 1.5, 3, 4.5, 6, 9, 10]))
        dress(axes, "width of the transition domain Δβ [°]" if axes in panels[2:] else "", label)
    panels[1].yaxis.set_major_formatter(PercentFormatter(1.0))
    figure.legend(*panels[0].get_legend_handles_labels(), ncols=4, **_KEY)
    figure.savefig(path)


def shares(rows: Sequence[tuple[str, float, float, float]], path: Path) -> None:
    """Shares of random fields flown to the goal without collision; rows of label, share, low, high."""
    figure = _figure(_COLUMN_IN, 1.3 + 0.38 * len(rows), "Random fields, with 95 % intervals")
    axes = figure.subplots()
    for y, (_, share, low, high) in enumerate(rows):
        axes.hlines(y, low, high, color=COLOURS[0], lw=7.0, alpha=0.35)
        axes.plot(share, y, "o", color=COLOURS[0], ms=4.5)
        axes.text(1.06, y, f"{share:.1%}  ({low:.1%} to {high:.1%})", va="center_baseline", fontsize=8.5)
    dress(axes, "flown to the goal without collision", "")
    axes.set_yticks(range(len(rows)), [textwrap.fill(label, 20) for label, *_ in rows])
    axes.set(xlim=(-0.02, 1.02), ylim=(max(len(rows), 1) - 0.5, -0.5))
    axes.xaxis.set_major_formatter(PercentFormatter(1.0))
    figure.savefig(path)


def _draw_periods(flight: Flight, number: int, periods: Sequence[Window], path: Path) -> None:
    """One map per period, with at most eight marks at a round number of steps."""
    every = next(n * 10**k for k in itertools.count() for n in (1, 2, 5) if n * 10**k * 8 >= flight.steps)
    side, width_in = (1, _COLUMN_IN) if len(periods) == 1 else (2, _PAGE_IN)
    view = _view([flight])
    slope = np.divide(*(view[1] - view[0])[::-1])
    title = f"{flight.scene.description}, {flight.method.label}"
    if (number == 7) == (len(flight.uavs) == 1):
        title = f"Figure {number}: {title}"
    figure = _figure(width_in, 0.9 * width_in * slope + 1.6, title)
    grid = figure.subplots(side, side, sharex=True, sharey=True, squeeze=False)
    for axes, (first, last) in zip(grid.flat, periods, strict=True):
        _draw_map(axes, flight, view, (first, last), every)
        axes.set_title(f"steps {first} to {last}" if side > 1 else "", fontsize=10)
        axes.label_outer()
    figure.legend(handles=_map_key(flight, every), ncols=2 + side, **_KEY)
    figure.savefig(path)


def _draw_map(axes: Axes, flight: Flight, view: Box, window: Window, every: int) -> None:
    """The scene from above during a window of steps, with a mark every `every` steps (0: none, thinner)."""
    axes.set(xlim=(view[0][0], view[1][0]), ylim=(view[0][1], view[1][1]), aspect="equal")
    axes.locator_params(nbins=8 if every else 5, steps=[1, 2, 5, 10])
    dress(axes, "x [lengths]", "y [lengths]")
    if flight.scene.obstacles:
        _draw_obstacles(axes, flight, view, window, every)
    for i in range(len(flight.uavs)):
        _draw_uav(axes, flight, i, window, every)


def _draw_uav(axes: Axes, flight: Flight, i: int, window: Window, every: int) -> None:
    one, colour, marker, size = flight.uavs[i], COLOURS[i % 6], _MARKERS[i % 6], 1.0 if every else 0.65
    first, last = (min(step, one.steps) for step in window)
    axes.plot(*one.position[: first + 1].T, color=colour, lw=0.9, ls=":", zorder=3)
    for layer, (band, width) in _BANDS.items():
        runs = [one.position[max(a, first) : min(b, last) + 1] for a, b in _runs(flight, i, layer)]
        axes.add_collection(LineCollection(runs, colors=band, linewidths=width * size, zorder=1.5))
    axes.plot(*one.position[first : last + 1].T, color=colour, lw=1.8 * size, zorder=4)
    for place, shape, points in ((one.uav.start, ">", 8), (one.uav.goal, "*", 14)):
        axes.plot(*place, shape, ms=points * size, mec=INK, mfc=colour, mew=0.8 * size, zorder=6)
    if not every or len(flight.uavs) > _NAMED_UAVS:
        return
    for step in _marks(first, last - (last == one.arrived_step), every):
        axes.plot(*one.position[step], marker, ms=10, mfc="white", mec=colour, mew=1.3, zorder=7)
        axes.annotate(str(step // every), one.position[step], **_TEXT)
    if len(flight.uavs) > 1:
        axes.annotate(one.uav.id, one.uav.start, xytext=(-9, -9), textcoords="offset points", **_TEXT)
        if last != one.arrived_step:
            axes.plot(*one.position[last], marker, ms=6, color=colour, zorder=7)
            radius = np.array([flight.scene.inner_radius + flight.scene.uav_radius])
            _draw_discs(axes, one.position[last : last + 1], radius, edgecolors=colour, **_EDGE)


def _draw_obstacles(axes: Axes, flight: Flight, view: Box, window: Window, every: int) -> None:
    spheres, period = flight.scene.obstacles, slice(window[0], window[1] + 1)
    few = len(spheres) <= _NAMED_OBSTACLES
    radius = np.array([sphere.radius for sphere in spheres])
    moves = np.array([sphere.velocity != (0.0, 0.0) for sphere in spheres])
    standing, tracks = flight.obstacles[0, ~moves], flight.obstacles[period, moves]
    _draw_discs(axes, standing, radius[~moves], facecolors=_STANDING, edgecolors=INK, lw=0.6, zorder=2)
    if few:
        _draw_discs(axes, standing, radius[~moves] + flight.scene.inner_radius, edgecolors=GREY, **_EDGE)
    ends = list(tracks[[0, -1]].swapaxes(0, 1))
    axes.add_collection(LineCollection(ends, colors=INK, linewidths=0.8, linestyles=":", zorder=2))
    if few and every:
        shown = [flight.obstacles[step, moves] for step in _marks(*window, every)]
        _name_obstacles(axes, flight, view, window, every)
    else:
        # With many obstacles, only the disc nearest to an aircraft is drawn for each.
        gaps = [np.linalg.norm(tracks - one.position[period, None], axis=2) for one in flight.uavs]
        shown = [tracks[np.min(gaps, axis=0).argmin(axis=0), np.arange(tracks.shape[1])]]
    tints = [_MOVING[m % len(_MOVING)] for m in range(tracks.shape[1])]
    for places in shown:
        _draw_discs(axes, places, radius[moves], facecolors=tints, edgecolors=INK, lw=0.4, zorder=2.5)


def _name_obstacles(axes: Axes, flight: Flight, view: Box, window: Window, every: int) -> None:
    """Annotate all names, and for moving obstacles the marks' numbers and an arrow ahead."""
    for m, sphere in enumerate(flight.scene.obstacles):
        track = flight.obstacles[window[0] : window[1] + 1, m]
        inside = np.flatnonzero(((track > view[0]) & (track < view[1])).all(axis=1))
        if sphere.velocity == (0.0, 0.0):
            axes.annotate(sphere.id, (sphere.at[0], sphere.at[1] - sphere.radius - 0.25), **_TEXT)
        elif inside.size:
            ahead = np.array(sphere.velocity) / np.hypot(*sphere.velocity)
            end, arrow = track[inside[-1]], {"arrowstyle": "-|>", "color": INK, "lw": 0.8}
            axes.annotate("", end, end - 0.3 * ahead, arrowprops=arrow, zorder=2)
            axes.annotate(sphere.id, track[inside[0]] - 0.3 * ahead, **_TEXT)
            for step in set(_marks(*window, every)) & set((inside + window[0]).tolist()):
                axes.annotate(str(step // every), flight.obstacles[step, m], **_TEXT)


def _draw_discs(axes: Axes, centres: Array, radius: Array, **style: Any) -> None:
    size, where = 2.0 * radius, {"offsets": centres, "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(size, size, 0.0 * size, units="xy", **where, **style))


def _layer_key() -> list[Line2D]:
    return [Line2D([], [], c=band, lw=width, label=f"{at} layer") for at, (band, width) in _BANDS.items()]


def _map_key(flight: Flight, every: int) -> list[Line2D]:
    count, few = len(flight.uavs), len(flight.scene.obstacles) <= _NAMED_OBSTACLES
    moving = [sphere.velocity != (0.0, 0.0) for sphere in flight.scene.obstacles]
    dots = [(">", 7, "white", "start"), ("*", 12, "white", "goal")]
    if every and count <= _NAMED_UAVS:
        dots.append(("$1$", 6, INK, f"every {every} steps"))
    if not all(moving):
        dots.append(("o", 9, _STANDING, "standing obstacle"))
    if any(moving):
        dots.append(("o", 9, _MOVING[0], "moving obstacle" if few and every else "moving, when nearest"))
    colour = INK if count > 1 else COLOURS[0]
    keys = [Line2D([], [], c=colour, lw=1.8, label="on its mission"), *_layer_key()]
    keys += [Line2D([], [], ls="", marker=m, ms=ms, mfc=c, mec=INK, label=label) for m, ms, c, label in dots]
    if (few and not all(moving)) or 1 < count <= _NAMED_UAVS:
        keys.append(Line2D([], [], color=GREY, lw=0.8, ls="--", label="inner radius $R_i + R_b$"))
    return keys


def _view(flights: Sequence[Flight]) -> Box:
    """The shown area: all paths, a few standing obstacles, and a margin."""
    paths = [one for flight in flights for one in flight.uavs]
    few = [one.at for one in flights[0].scene.obstacles[:_NAMED_OBSTACLES] if one.velocity == (0.0, 0.0)]
    fixed = [*few, *(one.uav.start for one in paths), *(one.uav.goal for one in paths)]
    places = np.concatenate([fixed, *(one.position for one in paths)])
    low, high = places.min(axis=0), places.max(axis=0)
    longer = (high - low).max()
    half = np.maximum((high - low) / 2.0, 0.3 * longer) + 0.09 * longer
    return (low + high) / 2.0 - half, (low + high) / 2.0 + half


def _marks(first: int, last: int, every: int) -> range:
    return range(max(-(-first // every), 1) * every, last + 1, every)


def _runs(flight: Flight, i: int, layer: Layer) -> list[tuple[int, int]]:
    """The half-open ranges of steps in which the layer decided."""
    decided = flight.uavs[i].layer[: flight.uavs[i].steps] == LAYERS.index(layer)
    edges = np.flatnonzero(np.diff(decided.astype(int), prepend=0, append=0))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def _figure(width_in: float, height_in: float, title: str) -> Figure:
    figure = Figure((width_in, height_in), dpi=160, layout=ConstrainedLayoutEngine(w_pad=0.09, h_pad=0.06))
    figure.suptitle(textwrap.fill(title[0].upper() + title[1:], round(width_in * 11.5)), fontsize=11)
    return figure
