"""`companion-sim paper`: flies the studies, draws figures, writes reports, shows progress."""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from companion.avoidance.cost import Speed
from companion.avoidance.inner import TABLE, Course
from companion.errors import ConfigError
from sim.paper import methods, report, studies
from sim.paper.flight import Flight
from sim.paper.measures import Measures


def run_experiments(out: Path, console: Console) -> bool:
    """Fly section 4 and the local minima; write reports and figures 7 to 12; True on success."""
    with _bar(console, "experiments") as progress:
        flights = studies.fly_experiments(progress)
    with _bar(console, "local minima") as progress:
        scenes = studies.fly_minima(progress)
    with _bar(console, "figures") as progress:
        _draw(out, flights, scenes, progress)
    experiments, minima = report.measured(flights), report.measured(scenes)
    _write_json(out / "report.json", report.report(experiments, minima))
    text = report.table(experiments, minima)
    (out / "table.md").write_text(text, encoding="utf-8")
    for name, rows in experiments.items():
        console.print(_summary(name, rows))
    console.print(f"{out}: table.md explains these and the other strategies; report.json; figures 7 to 12.")
    return report.succeeded(experiments)


def run_transition(out: Path, fields: int | None, console: Console) -> None:
    """Sweep the width of the transition domain; write `transition.json`, `.md` and `.png`."""
    from sim.paper import plots  # matplotlib takes long to import, and is optional

    with _bar(console, "transition domain") as progress:
        points = studies.study_transition(fields, progress)
    chosen_deg = studies.best_delta_beta_deg(points)
    _write_json(out / "transition.json", report.transition_report(points, chosen_deg))
    (out / "transition.md").write_text(report.transition_table(points, chosen_deg), encoding="utf-8")
    plots.transition(points, chosen_deg, out / "transition.png")
    default_deg = math.degrees(methods.DEFAULTS.delta_beta_rad)
    console.print(f"Best width of the transition domain: {chosen_deg:g} degrees (default {default_deg:g}).")


def run_fields(out: Path, fields: int | None, console: Console) -> None:
    """Fly every strategy over random fields; write `fields.json`, `.md` and `.png`."""
    from sim.paper import plots  # matplotlib takes long to import, and is optional

    with _bar(console, "random fields") as progress:
        shares, closed = studies.study_fields(fields, progress)
    _write_json(out / "fields.json", report.fields_report(shares, closed))
    text = report.fields_table(shares, closed)
    (out / "fields.md").write_text(text, encoding="utf-8")
    plots.shares([(share.method.label, *share.without_collision) for share in shares], out / "fields.png")
    table = Table(title="Arrived without collision", title_justify="left")
    for heading in ("strategy", "share", "95 %"):
        table.add_column(heading)
    for share in shares:
        middle, low, high = share.without_collision
        table.add_row(share.method.label, f"{middle:.3f}", f"{low:.3f} to {high:.3f}")
    console.print(table)


def folder(path: Path) -> Path:
    """The output folder, created if missing; `ConfigError` if it is not writable."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    return path


def print_strategy_table(console: Console) -> None:
    """Print every row of the strategy table."""
    table = Table(title=f"Strategy table, {len(TABLE)} rows", title_justify="left")
    for heading in ("row", "course", "speed", "height", "controls"):
        table.add_column(heading, justify="right" if heading == "row" else "left")
    for number, row in enumerate(TABLE, start=1):
        ground = row.ground
        course = ground.course.value
        if ground.course is Course.TURN:
            course = _turn(math.degrees(ground.turn_rad))
        rule = " (eq. 11)" if ground.course is Course.RULE else ""
        speed = ground.speed.value + (" (eq. 13)" if ground.speed is Speed.RULE else "")
        controls = ", ".join(sorted(row.controls)) or "none"
        table.add_row(str(number), course + rule, speed, row.height.value, controls)
    console.print(table)


def _turn(turn_deg: float) -> str:
    if round(turn_deg) == 0:
        return "straight on"
    return f"turn {'right' if turn_deg > 0 else 'left'} {abs(turn_deg):.0f}°"


def _draw(
    out: Path, flights: dict[str, list[Flight]], scenes: dict[str, list[Flight]], progress: studies.Progress
) -> None:
    from sim.paper import plots  # matplotlib takes long to import, and is optional

    by_name = {name: {flight.method.name: flight for flight in flown} for name, flown in flights.items()}
    single, group = by_name["single"], by_name["group"]
    reported = [method.name for method in methods.REPORTED]
    figures: tuple[Callable[[], None], ...] = (
        lambda: plots.trajectory(single["two_layer"], out / "figure-07.png"),
        lambda: plots.commands_over_time(single["two_layer"], out / "figure-08.png"),
        lambda: plots.safety_over_time([single[name] for name in reported], out / "figure-09.png"),
        lambda: plots.trajectories_in_time(group["two_layer"], out / "figure-10.png"),
        lambda: plots.commands_over_time(group["two_layer"], out / "figure-11.png"),
        lambda: plots.safety_over_time([group[name] for name in reported], out / "figure-12.png"),
        lambda: plots.minima(scenes, out / "minima.png"),
    )
    for number, draw in enumerate(figures, start=1):
        draw()
        progress(number, len(figures))


def _summary(name: str, rows: Mapping[str, Measures]) -> Table:
    table = Table(title={"single": "One UAV", "group": "Three UAVs"}[name], title_justify="left")
    table.add_column("strategy", no_wrap=True)
    for heading in ("safety", "effort", "clearance", "hits", "arrived", "path"):
        table.add_column(heading, justify="right")
    for method in methods.REPORTED:
        one = rows[method.name]
        table.add_row(
            method.label,
            f"{one.safety_value:.3f}",
            f"{one.heading_effort:.4f}",
            f"{one.min_clearance:.2f}",
            str(one.collisions),
            "yes" if one.arrived else "no",
            f"{one.path_ratio:.2f}",
        )
    return table


@contextmanager
def _bar(console: Console, what: str) -> Iterator[studies.Progress]:
    """A progress bar on a terminal, nothing elsewhere."""
    columns = (TextColumn(f"{what:18s}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(what, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(_finite(content), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _finite(content: Any) -> Any:
    """The content with None for NaN, which is the mean if no flight arrived."""
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not math.isfinite(content) else content
