"""`companion-sim paper`: flies the paper's experiments and studies."""

import signal
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.common import note_if_slow
from companion.errors import ConfigError, require


class Study(StrEnum):
    """The studies of `paper`."""

    EXPERIMENTS = "experiments"
    TRANSITION = "transition"
    FIELDS = "fields"
    ALL = "all"


def paper(
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for reports, tables and figures.")
    ] = None,
    study: Annotated[
        Study, typer.Option(help="The experiments (twenty seconds), or a study of many fields (minutes).")
    ] = Study.EXPERIMENTS,
    fields: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="Number of random fields in a study; default: all."),
    ] = None,
    table: Annotated[bool, typer.Option("--table", help="Print the strategy table.")] = False,
) -> None:
    """Fly the paper's experiments with the product's avoidance; write reports, tables and figures.

    Exit code 0 only if the two layers arrive in both experiments without collision.
    """
    if out is not None:
        require("matplotlib", "companion-sim paper --out", "sim")
    from sim.paper import command

    console = Console(highlight=False)
    if table:
        command.print_strategy_table(console)
    if out is None:
        if table:
            return
        raise ConfigError("paper: give --out DIR for the results, or --table")
    command.folder(out)
    note_if_slow()
    # A regular exit also ends the worker processes.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    well = True
    if study in (Study.EXPERIMENTS, Study.ALL):
        well = command.run_experiments(out, console)
    if study in (Study.TRANSITION, Study.ALL):
        command.run_transition(out, fields, console)
    if study in (Study.FIELDS, Study.ALL):
        command.run_fields(out, fields, console)
    if not well:
        raise typer.Exit(1)
