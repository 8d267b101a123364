"""The page of a campaign: one HTML file with its figures, readable offline."""

import html
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from companion.report.html import image, table
from companion.report.html import page as html_page
from sim.campaign.flight import EncounterResult
from sim.campaign.plan import Plan
from sim.campaign.summary import LOWC_RATIO_LINE, RISK_RATIO_LINE, Figures, ratio_of
from sim.encounter_figure import COLOURS, DASHES, HIGHEST_RATIO, OWN, centre_map, draw_separation, laid_out
from sim.encounters import Encounter

_CLOSING_EDGES_MPS = (0.0, 30.0, 60.0, 90.0, np.inf)
Flight = tuple[Encounter, EncounterResult]


def page(
    plan: Plan, report: dict[str, Any], figures: dict[str, Figures], worst: Mapping[str, Sequence[Flight]]
) -> str:
    """The whole page as HTML. `worst` are the encounters to draw, by avoider."""
    parts = [
        "<h1>Remaining risk</h1>",
        f"<p>{html.escape(_in_words(plan))}</p>",
        _summary_table(report),
        f"<p class=why>Ratios to flights without avoidance, with 95 % intervals (bootstrap over weighted "
        f"encounters). Pass lines for cooperative traffic: risk {RISK_RATIO_LINE}, well clear "
        f"{LOWC_RATIO_LINE}. Aside and height: the largest deviation, median over the encounters that lose "
        f"well clear without avoidance. Nuisance: avoidance flown in an encounter that stays well clear "
        f"without it.</p>",
    ]
    for name, one in figures.items():
        parts += [
            f"<h2>{html.escape(name)}</h2>",
            _group_table("geometry", one, one.words("geometry")),
            _group_table("closing speed", one, _by_closing(one)),
            _group_table("surveillance", one, one.words("surveillance")),
        ]
        for encounter, flown in worst.get(name, ()):
            parts.append(_drawn(encounter, flown))
    return html_page(f"Campaign, seed {plan.seed}", parts)


def _in_words(plan: Plan) -> str:
    source = (
        ", ".join(model.rsplit("/", 1)[-1] for model in plan.models) or "generated from the closest approach"
    )
    locked = "; height locked by floor and ceiling" if plan.lock_height else ""
    return (
        f"{plan.encounters:,} encounters ({plan.part}), seed {plan.seed}, from: {source}; "
        f"surveillance: {', '.join(plan.surveillance)}{locked}."
    )


def _summary_table(report: dict[str, Any]) -> str:
    head = (
        "avoider", "encounters", "conflicts", "risk ratio", "well clear ratio", "aside [m]", "height [m]",
        "nuisance", "not back on leg", "decision p99 [ms]",
    )  # fmt: skip
    rows = [
        [
            html.escape(name), f"{f['encounters']:,}", f"{f['conflicts']:,}",
            _ratio(f, "risk_ratio", RISK_RATIO_LINE), _ratio(f, "lowc_ratio", LOWC_RATIO_LINE),
            _number(f["median_max_deviation_m"]), _number(f["median_max_height_m"]),
            _ratio(f, "nuisance_rate", None), str(f["not_back_on_leg"]), str(f["decision_ms"]["p99"]),
        ]
        for name, f in report["avoiders"].items()
    ]  # fmt: skip
    return table(head, rows)


def _ratio(figures: dict[str, Any], name: str, line: float | None) -> str:
    value, interval = figures[name], figures[f"{name}_ci95"]
    if value is None:
        return "–"
    words = f"{value:.3f} ({interval[0]:.3f}–{interval[1]:.3f})"
    return f"<span class=over>{words}</span>" if line is not None and value > line else words


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f}"


Groups = dict[str, NDArray[np.bool_]]


def _by_closing(figures: Figures) -> Groups:
    closing = figures.columns()["closing_mps"]
    return {
        f"{low:.0f}–{high:.0f} m/s" if np.isfinite(high) else f"over {low:.0f} m/s": (closing >= low)
        & (closing < high)
        for low, high in pairwise(_CLOSING_EDGES_MPS)
    }


def _group_table(what: str, figures: Figures, groups: Groups) -> str:
    rows, whole = [], figures.columns()
    for name, chosen in groups.items():
        if not chosen.any():
            continue
        columns = {key: values[chosen] for key, values in whole.items()}
        risk, lowc = ratio_of(columns, "risk_ratio", "nmac"), ratio_of(columns, "lowc_ratio", "lowc")
        rows.append(
            [
                html.escape(name), f"{int(chosen.sum()):,}", f"{int(columns['lowc0'].sum()):,}",
                _ratio(risk, "risk_ratio", RISK_RATIO_LINE), _ratio(lowc, "lowc_ratio", LOWC_RATIO_LINE),
            ]
        )  # fmt: skip
    return table((what, "encounters", "conflicts", "risk ratio", "well clear ratio"), rows)


def _drawn(encounter: Encounter, flown: EncounterResult) -> str:
    near = flown.closest
    words = (
        f"nearest {near.horizontal_m:.0f} m aside, {near.vertical_m:.0f} m in height; "
        f"{'near mid-air collision' if near.nmac else 'well clear lost' if near.lowc else 'well clear'}; "
        f"weight {encounter.weight:.3g}"
    )
    why = "; ".join(f"{time_s:.0f} s {words}" for time_s, words in flown.reasons[:12])
    return (
        f"<h3>{html.escape(encounter.encounter_id)}: {html.escape(encounter.geometry)}</h3><p>{words}</p>"
        f"{image(figure_of(encounter, flown), words)}"
        f"<p class=why>{html.escape(why)}</p>"
    )


def figure_of(encounter: Encounter, flown: EncounterResult) -> Figure:
    """A figure of one encounter: map, heights, and separation over time with the volumes as bands."""
    figure, above, heights, apart = laid_out()
    times_s = np.arange(len(flown.own_m)) * 0.1
    shown = times_s <= encounter.duration_s
    own_m, times_s = flown.own_m[shown], times_s[shown]
    seen = [path.positions_m(times_s) for path in encounter.intruders]
    above.plot(flown.own_m[:, 1], flown.own_m[:, 0], color=OWN, lw=0.8)
    _over_time_marks(above, own_m, OWN, "-", "own")
    for i, place_m in enumerate(seen):
        _over_time_marks(above, place_m, COLOURS[i % 4], DASHES[i % 4], f"intruder {i + 1}")
    centre_map(above, flown.own_m)
    _over_time(heights, times_s, [own_m, *seen], lambda place_m: -place_m[:, 2])
    draw_separation(apart, times_s, own_m, seen)
    if flown.first_action_s is not None:
        apart.axvline(flown.first_action_s, color="#444", lw=1.0)
        apart.annotate("first action", (flown.first_action_s, 0.9 * HIGHEST_RATIO), fontsize=8)
    return figure


def _over_time_marks(axes: Axes, place_m: NDArray[np.floating], colour: str, dash: Any, label: str) -> None:
    axes.plot(place_m[:, 1], place_m[:, 0], color=colour, ls=dash, lw=1.6, label=label)
    marks = place_m[::100]  # every ten seconds
    axes.plot(marks[:, 1], marks[:, 0], ".", color=colour, ms=5)


def _over_time(
    axes: Axes,
    times_s: NDArray[np.floating],
    places: Sequence[NDArray[np.floating]],
    of: Callable[[NDArray[np.floating]], NDArray[np.floating]],
) -> None:
    for i, place_m in enumerate(places):
        colour, dash = (OWN, "-") if i == 0 else (COLOURS[(i - 1) % 4], DASHES[(i - 1) % 4])
        axes.plot(times_s, of(place_m), color=colour, ls=dash, lw=1.6)
