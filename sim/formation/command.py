"""`companion-sim campaign --formation`: options to flights, table and report."""

from dataclasses import replace
from heapq import nsmallest
from pathlib import Path
from typing import Any, Literal

from rich import box
from rich.console import Console
from rich.table import Table

from companion.errors import CompanionError, ConfigError
from sim.campaign.command import progress
from sim.campaign.results import Results, read_results
from sim.formation.engines import AVOIDERS, ORCA
from sim.formation.judgement import judge
from sim.formation.plan import FormationPlan
from sim.formation.runner import fly_one, run_here
from sim.formation.summary import figures_of

_DRAWN = 4


def available(avoiders: tuple[str, ...], console: Console, plan: FormationPlan) -> FormationPlan:
    """The plan with these avoiders, or with all; of all, one whose library is missing is left out."""
    if avoiders:
        return replace(plan, avoiders=avoiders)
    try:
        replace(plan, avoiders=(ORCA,)).check()
    except ConfigError as error:
        console.print(f"left out: {error}", markup=False, soft_wrap=True)
        return replace(plan, avoiders=tuple(name for name in AVOIDERS if name != ORCA))
    return replace(plan, avoiders=AVOIDERS)


def run(plan: FormationPlan, out: Path, console: Console, *, workers: int | None = None) -> dict[str, Any]:
    """Fly the remaining crossings, with a progress bar on a terminal; the figures by avoider and radio."""
    plan.check()
    results = Results.open(out, plan.identity())
    try:
        with progress(console, plan.flights, len(results.done), "crossings") as on_flown:
            run_here(plan, results, workers=workers, on_flown=on_flown)
    except KeyboardInterrupt:
        kept = f"campaign: interrupted; {len(results.done)} results are kept in {out}"
        raise CompanionError(f"{kept}, start again to continue") from None
    finally:
        results.close()
    figures = figures_of(line for line in read_results(out) if plan.wants(line))
    ordered = {name: figures[name] for name in plan.avoiders if name in figures}
    return {"formation": plan.members, "avoiders": ordered}


def page_of(plan: FormationPlan, out: Path, report: dict[str, Any]) -> str:
    """The page of a flown campaign; the flights with the smallest distances are flown again for it."""
    from sim.formation.page import page  # matplotlib takes long to import, and is optional

    worst = {}
    for name in report["avoiders"]:
        lines = (line for line in read_results(out) if plan.wants(line) and line["avoider"] == name)
        nearest = nsmallest(_DRAWN, lines, key=lambda line: (line["smallest_m"], line["number"]))
        worst[name] = [(line, fly_one(plan, name, line["radio"], line["number"])) for line in nearest]
    return page(plan, report, worst)


def show_crossing(plan: FormationPlan, number: int, console: Console, out: Path | None) -> None:
    """Fly one crossing again, print its measures and decisions, and draw it to `out`."""
    flight = fly_one(plan, plan.avoiders[0], next(iter(plan.radios)), number)
    for name, value in judge(flight, plan.separation).line().items():
        console.print(f"{name}: {value}", highlight=False)
    for member, reasons in enumerate(flight.reasons, start=1):
        for time_s, words in reasons:
            console.print(f"member {member}  {time_s:6.1f} s  {words}", markup=False)
    if out is not None:
        from sim.formation.figure import figure_of  # matplotlib takes long to import, and is optional

        figure_of(flight, plan.separation).savefig(out, dpi=110)


def print_figures(console: Console, report: dict[str, Any]) -> None:
    """Print a line for each avoider and radio."""
    table = Table(box=box.SIMPLE, padding=(0, 1))
    headings = ("avoider", "collided", "near\n5 %", "arrived", "safety", "way", "NMAC")
    for heading in headings:
        side: Literal["left", "right"] = "left" if heading == "avoider" else "right"
        table.add_column(heading, justify=side, no_wrap=True)
    for name, whole in report["avoiders"].items():
        for radio, figures in whole["by_radio"].items():
            table.add_row(f"{name}\n{radio}", *_row(figures))
    console.print(table)
    console.print(
        "Collided: flights in which two members came within the separation, with 95 % intervals.\n"
        "Near: the smallest distance of any pair, and its 5 % quantile over flights. Safety: mean\n"
        "distance of all pairs, under way and around the meeting. Way: flown length over the mission's.\n"
        "NMAC: share of members with a near collision with the stranger.",
        soft_wrap=True,
    )


def _row(figures: dict[str, Any]) -> tuple[str, ...]:
    nearest, near = figures["smallest_m"], figures["safety_value_near_m"]
    way = figures["path_ratio"]
    return (
        _with_interval(figures, "collisions"),
        f"{nearest['min']:.0f} m\n{nearest['p5']:.0f} m",
        _with_interval(figures, "arrived"),
        f"{figures['safety_value_m']:.0f} m\n{near:.0f} m",
        "-" if way is None else f"{way:.3f}",
        f"{figures['stranger_nmac']:.3f}" if figures["stranger_flights"] else "-",
    )


def _with_interval(figures: dict[str, Any], name: str) -> str:
    low, high = figures[f"{name}_ci95"]
    return f"{figures[name]:.3f}\n{low:.3f}-{high:.3f}"
