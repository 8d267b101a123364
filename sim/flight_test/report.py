"""The result of a flight test: as JSON, as a table on the terminal, and beside another one."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from companion import __version__
from companion.errors import ConfigError
from sim.flight_test.judge import Judged
from sim.flight_test.result import Result

Report = dict[str, Any]
_NAME_WIDTH = 26  # the table fits 80 columns
_SLOW = 0.1  # a rate of the vehicle's time this far from ours is shown


def report_of(result: Result) -> Report:
    """The figures for machines; times are the vehicle's [s], from the beginning of the encounter."""
    return {
        "passed": result.passed,
        "problem": result.problem,
        "autopilot": result.autopilot,
        "version": result.version,
        "companion": result.companion,
        "companion_version": __version__,
        "simulation": result.simulation,
        "time_rate": round(result.rate, 3),
        "wall_s": round(result.wall_s, 1),
        "left_out": result.left_out,
        "encounters": [
            _encounter(judged, result.failures.get(judged.plan.name, [])) for judged in result.encounters
        ],
    }


def _encounter(judged: Judged, failures: Sequence[str]) -> Report:
    nearest = judged.nearest
    return {
        "name": judged.plan.name,
        "passed": not failures,
        "failures": list(failures),
        "min_slant_m": _rounded(None if nearest is None else nearest.min_slant_m),
        "min_horizontal_m": _rounded(None if nearest is None else nearest.min_horizontal_m),
        "vertical_m": _rounded(None if nearest is None else nearest.vertical_m),
        "nmac": judged.nmac,
        "lowc": judged.lowc,
        "first_action_s": _rounded(judged.first_action_s),
        "modes": judged.modes,
        "max_deviation_m": _rounded(judged.max_deviation_m),
        "max_height_m": _rounded(judged.max_height_m),
        "back_on_leg_s": _rounded(judged.return_s),
        "resumed": judged.on_mission,
        "commands_refused": judged.refused,
        "commands_after_claim": None if judged.claim is None else judged.claim.commands,
        "intruders": [score.report() for score in judged.scores],
        "events": [[round(time_s, 1), text] for time_s, text in judged.events],
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, 1)


# Heading, and key in the report.
COLUMNS = (
    ("slant\n[m]", "min_slant_m"), ("side\n[m]", "min_horizontal_m"), ("high\n[m]", "vertical_m"),
    ("acts\n[s]", "first_action_s"), ("aside\n[m]", "max_deviation_m"), ("height\n[m]", "max_height_m"),
    ("back\n[s]", "back_on_leg_s"),
)  # fmt: skip


def table_of(report: Report) -> Table:
    """All encounters as a table."""
    table = _table("Flight test")
    table.add_column("re-\nfus.", justify="right", no_wrap=True)
    for each in report["encounters"]:
        figures = [_figure(each, key) for _, key in COLUMNS]
        refused = str(len(each["commands_refused"]) or "-")
        named = f"{escape(each['name'])}\n[dim]{' '.join(each['modes'])}[/]\n{verdict(each)}"
        table.add_row(named, *figures, refused)
    return table


def _table(title: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold", padding=(0, 1, 0, 0), box=SIMPLE)
    table.add_column("encounter", min_width=_NAME_WIDTH)
    for heading, _ in COLUMNS:
        table.add_column(escape(heading), justify="right", no_wrap=True)
    return table


def verdict(encounter: Report) -> str:
    """The result of one encounter in words, with colours."""
    if encounter["failures"]:
        return f"[bold red]{escape('; '.join(encounter['failures']))}[/]"
    return "[green]well clear[/]" if not encounter["lowc"] else "[yellow]as expected[/]"


def _figure(encounter: Report, key: str) -> str:
    value = encounter.get(key)
    return "-" if value is None else f"{value:.0f}"


def lines_of(report: Report) -> list[str]:
    """What the table does not say."""
    lines = []
    if report["problem"] is not None:
        lines.append(f"[bold red]Ended early: {report['problem']}[/]")
    if report["left_out"]:
        lines.append(f"Left out: {', '.join(report['left_out'])}.")
    if abs(report["time_rate"] - 1.0) > _SLOW:
        lines.append(f"The vehicle's time ran {report['time_rate']:.2f} times as fast as ours.")
    lost = sum(1 for each in report["encounters"] if each["failures"])
    count = len(report["encounters"])
    name = " ".join(filter(None, (report["autopilot"], report["version"])))
    how = "[green]passed[/]" if report["passed"] else "[bold red]not passed[/]"
    lines.append(f"{name}: {how}, {count - lost} of {count} encounters as expected.")
    return lines


def load_report(path: Path) -> Report:
    """An earlier report; `ConfigError` if it is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except (ValueError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: this is no JSON file") from error
    encounters = content.get("encounters") if isinstance(content, dict) else None
    if not isinstance(encounters, list) or not all(isinstance(e, dict) and "name" in e for e in encounters):
        raise ConfigError(f"{path}: this is no report of a flight test")
    report: Report = content
    return report


def comparison_of(report: Report, other: Report) -> Table:
    """Both runs, encounter by encounter: this one above, the other below."""
    table = _table("This run above, the other below")
    theirs = {each["name"]: each for each in other["encounters"]}
    ours = {each["name"]: each for each in report["encounters"]}
    for name in dict.fromkeys([*ours, *theirs]):
        pair = ours.get(name), theirs.get(name)
        cells = ["\n".join("-" if one is None else _figure(one, key) for one in pair) for _, key in COLUMNS]
        results = ["not flown" if one is None else _short(one) for one in pair]
        table.add_row(f"{escape(name)}: {results[0]}\n[dim]the other:[/] {results[1]}", *cells)
    return table


def _short(encounter: Report) -> str:
    return "[red]lost[/]" if encounter.get("failures") else "[green]passed[/]"
