"""`companion-sim campaign` and `companion-sim encounter`: options to table, report and page."""

import contextlib
import json
import time
from collections.abc import Callable, Iterator
from functools import partial
from heapq import nsmallest
from pathlib import Path
from typing import Any, Literal

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from companion.errors import CompanionError, ConfigError, require
from sim.campaign.avoiders import NONE
from sim.campaign.cluster import parse_scheduler_address, run_on
from sim.campaign.flight import ClosestApproach, EncounterResult
from sim.campaign.plan import Plan
from sim.campaign.results import Key, ResultLine, Results, key_of, read_results
from sim.campaign.runner import fly_one, run_here
from sim.campaign.summary import LOWC_RATIO_LINE, RISK_RATIO_LINE, gather, summary_of
from sim.encounters import Encounter

# The scheduler of this machine's own processes.
LOCAL = "local"
_DRAWN = 6


def run(
    plan: Plan, out: Path, console: Console, *, workers: int | None = None, scheduler: str = LOCAL
) -> dict[str, Any]:
    """Fly the remaining encounters of a campaign, with a progress bar on a terminal; the figures by avoider.

    `scheduler`: `LOCAL` for `workers` processes of this machine, or the address of a dask scheduler.
    """
    if scheduler != LOCAL:
        if workers is not None:
            raise ConfigError("--workers: only for this machine; a scheduler's workers are started elsewhere")
        parse_scheduler_address(scheduler)
        require("distributed", "companion-sim campaign --scheduler", "sim")
    plan.check()
    results = Results.open(out, plan.identity())
    before, begun = len(results.done), time.perf_counter()
    try:
        with progress(console, plan.flights, before) as on_flown:
            if scheduler == LOCAL:
                run_here(plan, results, workers=workers, on_flown=on_flown)
            else:
                on_notice = partial(console.print, markup=False, soft_wrap=True)
                run_on(scheduler, plan, results, on_flown=on_flown, on_notice=on_notice)
    except KeyboardInterrupt:
        kept = (
            f"campaign: interrupted; {len(results.done)} results are kept in {out}, start again to continue"
        )
        raise CompanionError(kept) from None
    finally:
        results.close()
    flown, took_s = len(results.done) - before, time.perf_counter() - begun
    rate = round(flown / took_s, 1) if flown else None
    return {"avoiders": _report(plan, out, rate)}


def _report(plan: Plan, out: Path, rate: float | None) -> dict[str, Any]:
    """The figures by avoider; with several surveillance presets, by these too."""
    report = {name: summary_of(figures, rate) for name, figures in gather(_wanted(plan, out)).items()}
    if len(plan.surveillance) > 1:
        for name in report:
            by_preset = gather(_wanted(plan, out, name), "surveillance")
            report[name]["by_surveillance"] = {
                preset: summary_of(by_preset[preset]) for preset in plan.surveillance if preset in by_preset
            }
    return {name: report[name] for name in plan.avoiders if name in report}


@contextlib.contextmanager
def progress(
    console: Console, total: int, done_before: int, what: str = "encounters"
) -> Iterator[Callable[[int], None]]:
    """A progress bar on a terminal; call what it gives with the number newly flown."""
    if not console.is_terminal:
        yield lambda _: None
        return
    rate = TextColumn("{task.fields[rate]} a second")
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), rate, TimeRemainingColumn())
    with Progress(*columns, console=console) as bar:
        begun, flown = time.perf_counter(), 0
        task = bar.add_task("", total=total, completed=done_before, rate="0.0")

        def on_flown(more: int) -> None:
            nonlocal flown
            flown += more
            rate_hz = flown / max(time.perf_counter() - begun, 1e-9)
            bar.update(task, advance=more, rate=f"{rate_hz:.1f}")

        yield on_flown


def print_figures(console: Console, report: dict[str, Any]) -> None:
    """Print the main table: remaining risk, and its cost in deviation and nuisance."""
    table = Table(box=box.SIMPLE, padding=(0, 1))  # within eighty columns
    headings = ("avoider", "risk ratio", "well clear", "aside\nheight", "nuisance", "not\nback")
    for heading in headings:
        side: Literal["left", "right"] = "left" if heading == "avoider" else "right"
        table.add_column(heading, justify=side, no_wrap=True)
    rows = [
        (name, preset, figures)
        for name, whole in report["avoiders"].items()
        for preset, figures in whole.get("by_surveillance", {"": whole}).items()
    ]
    for name, preset, figures in rows:
        table.add_row(
            f"{name}\n{preset or format(figures['encounters'], ',') + ' flown'}",
            _with_interval(figures, "risk_ratio"),
            _with_interval(figures, "lowc_ratio"),
            f"{_metres(figures['median_max_deviation_m'])}\n{_metres(figures['median_max_height_m'])}",
            _with_interval(figures, "nuisance_rate"),
            str(figures["not_back_on_leg"]),
        )
    console.print(table)
    console.print(
        f"Ratios to flights without avoidance, with 95 % intervals; the pass lines are\n"
        f"{RISK_RATIO_LINE} and {LOWC_RATIO_LINE}. Aside and height are medians over conflicts.\n"
        "Not back: not on the mission's leg and height half an hour after the encounter.\n"
        + _way_back(report)
    )


def _way_back(report: dict[str, Any]) -> str:
    """Time from the take-over until back on leg and height, and repeated engagements, by avoider."""
    return "\n".join(
        f"{name}: back {_two(figures['back_s'])} after the take-over; "
        f"{figures['given_back_on_leg']} given back on the leg, {figures['back_on_left_leg']} back on the "
        f"one they left, {figures['back_on_later_leg']} on a later one; off it in the mission's mode for "
        f"{_two(figures['strayed_s'])}; {figures['engaged_more_than_once']} engaged more than once"
        + _mirrored(figures)
        for name, figures in report["avoiders"].items()
    )


def _mirrored(figures: dict[str, Any]) -> str:
    """Of the encounters in which both avoided, those whose maneuvers cancelled."""
    if "mirrored" not in figures:
        return ""
    ways = figures["mirrored"]
    return (
        f"; both avoided in {figures['both_avoided']}, mirrored in {ways['either']} ({ways['vertical']} in "
        f"height, {ways['sideways']} sideways), of which {ways['lowc']} lost well clear"
    )


def _two(quantiles: dict[str, float | None]) -> str:
    """Median and 95 % quantile."""
    return f"{_seconds(quantiles['p50'])} (95 %: {_seconds(quantiles['p95'])})"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f} s"


def _with_interval(figures: dict[str, Any], name: str) -> str:
    value, interval = figures[name], figures[f"{name}_ci95"]
    if value is None:
        return "-"
    return f"{value:.3f}\n{interval[0]:.3f}-{interval[1]:.3f}"


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f} m"


def write_report(path: Path, report: dict[str, Any]) -> None:
    """Write the figures as JSON."""
    path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


def page_of(plan: Plan, out: Path, report: dict[str, Any]) -> str:
    """The page of a flown campaign; its worst encounters are flown again for the drawings."""
    from sim.campaign.page import page  # matplotlib takes long to import, and is optional

    source, figures = plan.source(), gather(_wanted(plan, out))
    worst = {
        name: [fly_again(plan, source, key_of(line))[::2] for line in worst_of(_wanted(plan, out, name))]
        for name in figures
        if name != NONE
    }
    return page(plan, report, figures, worst)


def _wanted(plan: Plan, out: Path, avoider: str | None = None) -> Iterator[ResultLine]:
    """A plan's results, of all its avoiders or of one, read one at a time."""
    return (
        result for result in read_results(out) if plan.wants(result) and avoider in (None, result["avoider"])
    )


def worst_of(lines: Iterator[ResultLine]) -> list[ResultLine]:
    """The closest approaches among the flights that lost well clear, the worst first."""
    lost = (line for line in lines if line["flown"]["lowc"])
    return nsmallest(_DRAWN, lost, key=lambda line: (line["flown"]["severity"], line["number"]))


def fly_again(
    plan: Plan, source: Callable[[int], Encounter], key: Key
) -> tuple[Encounter, ClosestApproach, EncounterResult]:
    """Fly an encounter of the results once more; with its closest approach without avoidance."""
    return fly_one(plan, key, source(key[2]))


def show_encounter(plan: Plan, number: int, console: Console, out: Path | None) -> None:
    """Print one encounter, and draw it to `out`."""
    key = plan.avoiders[0], plan.surveillance[0], number
    encounter, nominal, flown = fly_again(plan, plan.source(), key)
    for name, near in (("unmitigated", nominal), ("flown", flown.closest)):
        outcome = "near mid-air collision" if near.nmac else "well clear lost" if near.lowc else "well clear"
        console.print(
            f"{name}: nearest {near.horizontal_m:.0f} m aside, {near.vertical_m:.0f} m in height: {outcome}"
        )
    console.print(
        f"{encounter.encounter_id}: {encounter.geometry}, closing {encounter.closing_mps:.0f} m/s; "
        f"largest deviation {flown.deviation_m:.0f} m aside, {flown.height_m:.0f} m in height"
    )
    for time_s, words in flown.reasons:
        console.print(f"{time_s:6.1f} s  {words}", markup=False)
    if out is not None:
        from sim.campaign.page import figure_of  # matplotlib takes long to import, and is optional

        figure_of(encounter, flown).savefig(out, dpi=110)
