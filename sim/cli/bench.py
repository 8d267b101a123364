"""`companion-sim bench`: measures the budgets and prints them."""

import contextlib
import json
import logging

from rich.console import Console
from rich.table import Table

from companion.cli.common import note_if_slow, writable
from sim.bench import run as run_bench
from sim.cli.common import ReportOption


def bench(
    report: ReportOption = None,
) -> None:
    """Measure decision times, latency from datagram to setpoint, and replay speed; about a minute."""
    if report is not None:
        writable(report)
    logging.getLogger("companion").addHandler(logging.NullHandler())
    note_if_slow()
    console = Console(highlight=False)
    status = console.status("starting") if console.is_terminal else contextlib.nullcontext()
    with status as shown:
        figures = run_bench(lambda text: shown.update(text) if shown is not None else None)
    table = Table(title="Milliseconds", title_justify="left")
    for heading in ("what", "p50", "p99"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for count, times in figures["decide_ms"].items():
        table.add_row(
            f"decision with {count} tracks, all in conflict", f"{times['p50']:.2f}", f"{times['p99']:.2f}"
        )
    for count, times in figures["formation_ms"].items():
        table.add_row(f"tick of a member among {count}", f"{times['p50']:.2f}", f"{times['p99']:.2f}")
    wire = figures["wire_latency_ms"]
    table.add_row("ADS-B datagram in to setpoint out", f"{wire['p50']:.2f}", f"{wire['p99']:.2f}")
    console.print(table)
    console.print(
        f"Replay through the engine: {figures['replay_messages_per_s']:,} messages/s, "
        f"{figures['replay_ratio']} times pymavlink's reader; reading only "
        f"{figures['read_messages_per_s']:,}, {figures['read_ratio']} times."
    )
    if report is not None:
        report.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
