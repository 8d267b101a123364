"""The page of a formation campaign: its figures, and the flights with the smallest distances drawn."""

import html
from collections.abc import Mapping, Sequence
from typing import Any

from companion.report.html import image, table
from companion.report.html import page as html_page
from sim.campaign.results import ResultLine
from sim.formation.figure import figure_of
from sim.formation.flight import FormationFlight
from sim.formation.plan import FormationPlan

_HEAD = (
    "avoider", "radio", "flights", "collisions", "pairs lost", "nearest [m]", "arrived", "safety value [m]",
    "near the meeting [m]", "way", "near collisions with the stranger", "decision p99 [ms]",
)  # fmt: skip
Drawn = tuple[ResultLine, FormationFlight]


def page(plan: FormationPlan, report: dict[str, Any], worst: Mapping[str, Sequence[Drawn]]) -> str:
    """The whole page as HTML. `worst` are the flights to draw, by avoider."""
    rows = [
        _row(name, radio, figures)
        for name, whole in report["avoiders"].items()
        for radio, figures in whole["by_radio"].items()
    ]
    parts = [
        "<h1>Crossings of a formation</h1>",
        f"<p>{html.escape(_in_words(plan))}</p>",
        table(_HEAD, rows),
        "<p class=why>Collisions: flights in which two members came within the separation, with 95 % "
        "intervals. Safety value: mean distance of all pairs, while all are under way.</p>",
    ]
    for name, drawn in worst.items():
        parts.append(f"<h2>{html.escape(name)}</h2>")
        parts += [_drawn(plan, line, flight) for line, flight in drawn]
    return html_page(f"Formation of {plan.members}, seed {plan.seed}", parts)


def _in_words(plan: FormationPlan) -> str:
    silent = "; one member falls silent" if plan.falls_silent else ""
    return (
        f"{plan.encounters:,} crossings of {plan.members} members ({plan.part}), seed {plan.seed}; "
        f"separation {plan.separation.smallest_m:g} m, {plan.separation.smallest_vertical_m:g} m in "
        f"height{silent}."
    )


def _row(name: str, radio: str, figures: dict[str, Any]) -> list[str]:
    return [
        html.escape(name), html.escape(radio), str(figures["flights"]), _share(figures, "collisions"),
        f"{figures['pairs_lost']} of {figures['pairs']}", f"{figures['smallest_m']['min']:.0f}",
        _share(figures, "arrived"), f"{figures['safety_value_m']:.0f}",
        f"{figures['safety_value_near_m']:.0f}", _number(figures["path_ratio"]),
        _share(figures, "stranger_nmac"), _number(figures["decision_ms"]["p99"]),
    ]  # fmt: skip


def _share(figures: dict[str, Any], name: str) -> str:
    if figures.get(name) is None:
        return "–"
    low, high = figures[f"{name}_ci95"]
    return f"{figures[name]:.3f} ({low:.3f}–{high:.3f})"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def _drawn(plan: FormationPlan, line: ResultLine, flight: FormationFlight) -> str:
    words = (
        f"smallest distance {line['smallest_m']:.0f} m, {line['pairs_lost']} pairs lost separation, "
        f"{line['arrived']} of {line['members']} arrived"
    )
    why = "; ".join(
        f"member {number}, {time_s:.0f} s {said}"
        for number, reasons in enumerate(flight.reasons, start=1)
        for time_s, said in reasons[:5]
    )
    return (
        f"<h3>Crossing {line['number']}, {html.escape(line['radio'])}</h3><p>{words}</p>"
        f"{image(figure_of(flight, plan.separation), words)}<p class=why>{html.escape(why)}</p>"
    )
