"""The figures of a flight report. Times are in minutes and seconds since the first record."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from companion.report.drawing import COLOURS, DASHES, GREY, INK, dress
from companion.report.encounters import Encounter
from companion.report.flight import Flight
from companion.report.link import LinkLog
from companion.report.plotting import (
    AROUND_S,
    MAX_POINTS,
    draw_other,
    draw_path,
    draw_well_clear,
    extent,
    mark_times,
    new_figure,
    other_style,
    over_time,
    separation_lines,
    shade,
    thinned,
    without_wraps,
)
from companion.units import WELL_CLEAR_HORIZONTAL_M

Style = dict[str, Any]

MAX_DRAWN = 8  # aircraft in one figure


def from_above(flight: Flight, encounters: Sequence[Encounter]) -> Figure:
    """The path by phase of the flight, the mission, and the closest points of encounters."""
    drawing = new_figure(8.0)
    axes = drawing.subplots()
    east_km, north_km = flight.column("east_m") / 1e3, flight.column("north_m") / 1e3
    legs_km = flight.legs_m / 1e3
    keys: list[Any] = []
    low, high = extent(east_km, north_km)
    if len(legs_km):
        axes.plot(
            legs_km[:, 1], legs_km[:, 0], color=GREY, lw=0.9, ls=(0, (1, 2)), marker="+", ms=7, zorder=2
        )
        keys.append(Line2D([], [], color=GREY, lw=0.9, ls=(0, (1, 2)), marker="+", label="mission"))
        near = (np.abs(legs_km[:, ::-1] - (low + high) / 2).max(axis=1)) < 3.0 * (high - low).max()
        low, high = extent(*np.vstack([legs_km[near][:, ::-1], low, high]).T)
    keys += draw_path(axes, flight, np.arange(len(flight)), 1e3)
    for number, one in enumerate(encounters[:MAX_DRAWN]):
        keys.append(draw_other(axes, flight, one, number, 1e3))
    axes.plot(east_km[0], north_km[0], ">", ms=9, mfc="white", mec=INK, zorder=7)
    axes.plot(east_km[-1], north_km[-1], "s", ms=7, mfc="white", mec=INK, zorder=7)
    keys += [
        Line2D([], [], ls="", marker=">", ms=9, mfc="white", mec=INK, label="first record"),
        Line2D([], [], ls="", marker="s", ms=7, mfc="white", mec=INK, label="last record"),
    ]
    mark_times(axes, flight, np.arange(len(flight)), 1e3)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    dress(axes, "east [km]", "north [km]")
    drawing.legend(handles=keys, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return drawing


def separation(flight: Flight, encounters: Sequence[Encounter]) -> Figure:
    """Horizontal and vertical distance of each aircraft that came near, over time."""
    drawing = new_figure(5.6)
    horizontal, vertical = drawing.subplots(2, 1, sharex=True)
    keys: list[Any] = []
    for number, one in enumerate(encounters[:MAX_DRAWN]):
        style = other_style(number)
        at = thinned(np.arange(len(one.at)))
        times_s = flight.time_s[one.at[at]]
        horizontal.plot(times_s, one.horizontal_m[at], lw=1.6, **style)
        vertical.plot(times_s, np.abs(one.vertical_m[at]), lw=1.6, **style)
        for axes, value in ((horizontal, one.closest_horizontal_m), (vertical, abs(one.closest_vertical_m))):
            axes.plot(
                flight.time_s[one.closest_at], value, "o", ms=6, mfc="white", mec=style["color"], zorder=6
            )
        keys.append(Line2D([], [], lw=1.6, **style, label=one.name))
    keys += shade(flight, (horizontal, vertical)) + separation_lines(horizontal, vertical)
    over_time(vertical, 0.0, float(flight.time_s[-1]))
    drawing.legend(handles=keys, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return drawing


def commands(flight: Flight) -> Figure:
    """Height, airspeed and course over time, as flown and as decided by the companion."""
    drawing = new_figure(7.2)
    height, speed, course = drawing.subplots(3, 1, sharex=True)
    at = thinned(np.arange(len(flight)))
    times_s = flight.time_s[at]
    flown: Style = {"color": COLOURS[0], "lw": 1.5}
    decided: Style = {"color": INK, "lw": 1.4, "ls": DASHES[1]}
    height.plot(times_s, flight.heights_m("altitude_m")[at], **flown)
    height.plot(times_s, flight.heights_m("commanded_altitude_m")[at], **decided)
    speed.plot(times_s, flight.column("airspeed_mps")[at], **flown)
    speed.plot(times_s, flight.column("commanded_airspeed_mps")[at], **decided)
    for name, style in (("course_deg", flown), ("commanded_course_deg", decided)):
        course.plot(times_s, without_wraps(flight.column(name)[at]), **style)
    course.set(ylim=(0.0, 360.0), yticks=range(0, 361, 90))
    dress(height, "", f"height {flight.height_name} [m]")
    dress(speed, "", "airspeed [m/s]")
    dress(course, "", "course [°]")
    over_time(course, 0.0, float(flight.time_s[-1]))
    keys = [
        Line2D([], [], **flown, label="flown"),
        Line2D([], [], **decided, label="decided"),
        *shade(flight, (height, speed, course)),
    ]
    drawing.legend(handles=keys, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return drawing


def encounter(flight: Flight, one: Encounter, number: int) -> Figure:
    """One encounter from above, with heights and distances, `AROUND_S` before and after its closest point."""
    drawing = new_figure(5.0)
    left, right = drawing.subfigures(1, 2, width_ratios=(1.0, 1.25), squeeze=False)[0]
    above = left.subplots()
    heights, horizontal, vertical = right.subplots(3, 1, sharex=True)
    closest_s = float(flight.time_s[one.closest_at])
    begin_s, end_s = closest_s - AROUND_S, closest_s + AROUND_S
    if one.acted_s is not None:
        begin_s = min(begin_s, closest_s - one.acted_s - 5.0)
    ours = np.flatnonzero((flight.time_s >= begin_s) & (flight.time_s <= end_s))
    theirs = np.flatnonzero((flight.time_s[one.at] >= begin_s) & (flight.time_s[one.at] <= end_s))
    style = other_style(number)

    draw_path(above, flight, ours, 1.0)
    mark_times(above, flight, ours, 1.0)
    draw_other(above, flight, one, number, 1.0, theirs)
    draw_well_clear(above, flight, one)
    low, high = extent(flight.column("east_m")[ours], flight.column("north_m")[ours])
    middle, half = (low + high) / 2.0, max(float((high - low).max()) / 2.0, 1.5 * WELL_CLEAR_HORIZONTAL_M)
    above.set(
        aspect="equal",
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] - half, middle[1] + half),
    )
    above.locator_params(nbins=5)
    above.ticklabel_format(useOffset=False, style="plain")
    dress(above, "east [m]", "north [m]")

    times_s = flight.time_s[one.at[theirs]]
    heights.plot(flight.time_s[ours], flight.heights_m("altitude_m")[ours], color=COLOURS[0], lw=1.6)
    heights.plot(
        flight.time_s[ours], flight.heights_m("commanded_altitude_m")[ours], color=INK, lw=1.2, ls=DASHES[1]
    )
    own_m = flight.heights_m("altitude_m")[one.at[theirs]]
    heights.plot(times_s, own_m + one.vertical_m[theirs], lw=1.6, **style)
    horizontal.plot(times_s, one.horizontal_m[theirs], lw=1.6, **style)
    vertical.plot(times_s, np.abs(one.vertical_m[theirs]), lw=1.6, **style)
    separation_lines(horizontal, vertical)
    shade(flight, (heights, horizontal, vertical), begin_s, end_s)
    dress(heights, "", f"{flight.height_name} [m]")
    for axes in (heights, horizontal, vertical):
        axes.axvline(closest_s, color=INK, lw=0.9)
        if one.acted_s is not None:
            axes.axvline(closest_s - one.acted_s, color=INK, lw=0.9, ls=DASHES[3])
    over_time(vertical, begin_s, end_s)
    return drawing


def link(log: LinkLog) -> Figure:
    """Messages per second of each sender, and the times when the autopilot was not heard."""
    drawing = new_figure(3.2)
    axes = drawing.subplots()
    last_s = max((max(s.per_second, default=0) for s in log.senders.values()), default=0)
    keys: list[Any] = []
    senders = sorted(log.senders.values(), key=lambda sender: -sender.messages)[: len(COLOURS)]
    for number, sender in enumerate(senders):
        rates = np.zeros(last_s + 1)
        for second, count in sender.per_second.items():
            rates[second] = count
        width = max(math.ceil(len(rates) / MAX_POINTS), 1)
        means = rates[: len(rates) // width * width].reshape(-1, width).mean(axis=1)
        style: Style = {"color": COLOURS[number], "ls": DASHES[number], "lw": 1.2}
        axes.step(np.arange(len(means)) * width, means, where="post", **style)
        system, component = sender.address
        keys.append(Line2D([], [], **style, label=f"{system}:{component}"))
    autopilot = log.autopilot
    for begin_s, end_s in () if autopilot is None else autopilot.gaps[:200]:
        axes.axvspan(begin_s, end_s, color="#F3C6C2", lw=0)
    if autopilot is not None and autopilot.gaps:
        keys.append(Patch(color="#F3C6C2", label="autopilot not heard"))
    dress(axes, "", "messages a second")
    axes.set_ylim(bottom=0.0)
    over_time(axes, 0.0, max(float(last_s), 1.0))
    drawing.legend(handles=keys, loc="outside lower center", ncols=6, fontsize=9, frameon=False)
    return drawing
