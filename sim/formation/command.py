"""`companion-sim campaign --formation`: options to flights, table and report."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from rich import box
from rich.console import Console
from rich.table import Table

from companion.errors import CompanionError, ConfigError
from sim.campaign.command import progress
from sim.campaign.results import Results, read_results
from sim.formation.engines import AVOIDERS, ORCA
from sim.formation.plan import FormationPlan
from sim.formation.runner import run_here
from sim.formation.summary import figures_of


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
        with progress(console, plan.flights, results, "crossings") as on_flown:
            run_here(plan, results, workers=workers, on_flown=on_flown)
    except KeyboardInterrupt:
        kept = f"campaign: interrupted; {len(results.done)} results are kept in {out}"
        raise CompanionError(f"{kept}, start again to continue") from None
    finally:
        results.close()
    figures = figures_of(line for line in read_results(out) if plan.wants(line))
    ordered = {name: figures[name] for name in plan.avoiders if name in figures}
    return {"formation": plan.members, "avoiders": ordered}


def print_figures(console: Console, report: dict[str, Any]) -> None:
    """Print a line for each avoider and radio."""
    table = Table(box=box.SIMPLE, padding=(0, 1))
    headings = ("avoider", "collisions", "nearest\n5 %", "arrived", "safety\nnear", "way", "stranger\nnmac")
    for heading in headings:
        side: Literal["left", "right"] = "left" if heading == "avoider" else "right"
        table.add_column(heading, justify=side, no_wrap=True)
    for name, whole in report["avoiders"].items():
        for radio, figures in whole["by_radio"].items():
            table.add_row(f"{name}\n{radio}", *_row(figures))
    console.print(table)
    console.print(
        "Collisions: flights in which two members came within the separation, with 95 % intervals.\n"
        "Nearest: the smallest distance of any pair, of all flights and as 5 % quantile. Safety value:\n"
        "mean distance of all pairs, under way and near the meeting. Way: flown length over the mission's.",
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
        _with_interval(figures, "stranger_nmac") if figures["stranger_flights"] else "-",
    )


def _with_interval(figures: dict[str, Any], name: str) -> str:
    low, high = figures[f"{name}_ci95"]
    return f"{figures[name]:.3f}\n{low:.3f}-{high:.3f}"
