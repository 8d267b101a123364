"""`companion-sim evidence`: flies, analyses, and writes page, document and JSON."""

import json
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any, Literal

from rich import box
from rich.console import Console
from rich.table import Table

import companion
from companion.cli.common import writable
from companion.errors import ConfigError
from sim.campaign.avoiders import COMPANION
from sim.campaign.command import fly_again, worst_of
from sim.campaign.page import figure_of
from sim.campaign.results import key_of
from sim.encounters import Encounter
from sim.evidence.analysis import SAME, Analysis
from sim.evidence.content import Drawn, sections_of
from sim.evidence.document import write_document
from sim.evidence.page import page
from sim.evidence.plan import EvidencePlan
from sim.evidence.run import fly_all
from sim.peers import PEERS

# Worst encounters that are drawn, of each preset, and of which presets.
_DRAWN = 3
_DRAWN_OF = ("perfect", "adsb-out", "poor")
_RESULTS = "results"


def available(names: list[str], console: Console) -> tuple[str, ...]:
    """The peers to fly: those named, or all that are installed."""
    if names:
        return tuple(dict.fromkeys(name for name in names if name != COMPANION))
    if find_spec("pyrvo") is None:
        console.print("orca is left out: it needs the pyrvo package (make orca)")
        return tuple(name for name in PEERS if name != "orca")
    return tuple(PEERS)


def run(
    evidence: EvidencePlan, out: Path, console: Console, *, workers: int | None, scheduler: str
) -> dict[str, Any]:
    """Fly what is missing, and write `evidence.html`, `.pdf` and `.json`; the figures."""
    results = _folder(out / _RESULTS)
    for name in ("evidence.html", "evidence.pdf", "evidence.json"):
        writable(out / name)
    fly_all(evidence, results, console, workers=workers, scheduler=scheduler)
    with console.status("analysis, page and document"):
        return _write(evidence, results, out)


def _write(evidence: EvidencePlan, results: Path, out: Path) -> dict[str, Any]:
    analysis = Analysis(evidence, results)
    report = analysis.report()
    (out / "evidence.json").write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    sections = sections_of(report, list(_worst(analysis, evidence)))
    subtitle, details = _titles(report)
    (out / "evidence.html").write_text(page(sections, subtitle), encoding="utf-8")
    write_document(out / "evidence.pdf", sections, subtitle, details)
    return report


def print_figures(console: Console, report: dict[str, Any]) -> None:
    """Print the product and the peers with each preset."""
    table = Table(box=box.SIMPLE, padding=(0, 1), collapse_padding=True)  # within eighty columns
    for heading in ("reports", "risk", "well clear", "unnecessary", "induced"):
        side: Literal["left", "right"] = "left" if heading == "reports" else "right"
        table.add_column(heading, justify=side, no_wrap=True)
    for preset, rows in report["results"].items():
        table.add_row(preset)
        for name, row in rows.items():
            if name != SAME:
                ratios = (_short(row, key) for key in ("risk_ratio", "lowc_ratio", "nuisance_rate"))
                table.add_row(f"  {name}", *ratios, f"{row['induced_nmac']}, {row['induced_lowc']}")
    console.print(table)
    console.print(
        "Ratios to flights without avoidance, with 95 % intervals. Induced: near mid-air\n"
        "collisions and losses of well clear that happen only with avoidance."
    )


def _short(row: dict[str, Any], key: str) -> str:
    """A value with its interval, in few letters."""
    if row[key] is None:
        return "-"
    low, high = row[f"{key}_ci95"]
    return f"{row[key]:.3f} {low:.2f}-{high:.2f}"


def _worst(analysis: Analysis, evidence: EvidencePlan) -> Iterator[Drawn]:
    """The worst encounters, flown again and drawn."""
    for preset in _DRAWN_OF:
        if preset not in evidence.presets:
            continue
        campaign, lines = analysis.main_lines(preset)
        source: Callable[[int], Encounter] = campaign.plan.source()
        for line in islice(worst_of(lines), _DRAWN):
            encounter, _, flown = fly_again(campaign.plan, source, key_of(line))
            near = flown.closest
            outcome = "NMAC" if near.nmac else "well clear lost"
            kept = "also without avoidance" if line["nominal"]["lowc"] else "induced: not without avoidance"
            yield (
                figure_of(encounter, flown),
                f"{preset}, encounter {line['number']}: {encounter.geometry}, {encounter.source}, closing "
                f"{encounter.closing_mps:.0f} m/s; nearest {near.horizontal_m:.0f} m aside and "
                f"{near.vertical_m:.0f} m in height: {outcome}, {kept}; weight {encounter.weight:.3g}.",
            )


def _titles(report: dict[str, Any]) -> tuple[str, list[str]]:
    """One line about the product, and the paragraphs of the title page."""
    how = report["configuration"]
    models = ", ".join(how["models"]) or "none; the encounters are built from their closest approach"
    subtitle = f"Companion {companion.__version__}, seed {how['seed']}, {how['part']} half of the encounters"
    computer = how["machine"]
    return subtitle, [
        f"{sum(how['flights'].values()):,} simulated flights by the engine that flies the aircraft.",
        f"Encounter models: {models}.",
        f"Analysed on {computer['processor']}, {computer['cores']} cores, {computer['system']}.",
        "The last section lists version, configuration and parameters.",
    ]


def _folder(path: Path) -> Path:
    """The folder of the results, created if missing; `ConfigError` if that fails."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    return path
