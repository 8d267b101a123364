"""`companion report`: writes a page about a flight."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.common import ProgressBar, writable
from companion.config import load_config, load_obstacles
from companion.engine import Engine
from companion.errors import CompanionError, require


def report(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="FLIGHT.mcap|LOG.tlog", help="A recording, or any telemetry log.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="FILE.html", help="Where the page is written.")] = Path(
        "report.html"
    ),
    config_file: Annotated[
        Path | None,
        typer.Option("--config", metavar="CONFIG", help="Configuration to replay a tlog with."),
    ] = None,
) -> None:
    """Write a page about a flight: path, encounters, decisions with reasons, operator texts, and the link.

    An MCAP recording has the decisions made in flight; the tlog beside it adds what came over the link.
    Any other tlog is replayed through the engine. Later parts of the same recording are read too.
    """
    require("matplotlib", "companion report", "report")
    # Drawing takes longer to import than the other commands take to start.
    from companion.report.page import page_of
    from companion.report.reading import files_of, read_log

    config = None if config_file is None else load_config(config_file)
    writable(out)

    def engine() -> Engine:
        return Engine(None if config is None else config.for_engine(load_obstacles(config)))

    console = Console(highlight=False, soft_wrap=True)
    with ProgressBar(console, *files_of(log)) as on_progress:
        found = read_log(log, engine, on_progress)
        text = page_of(found)
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CompanionError(f"{out}: cannot be written: {error.strerror}") from error
    for note in found.flight.notes:
        console.print(note, markup=False, style="yellow")
    console.print(f"{out}: {len(text) / 1000:.0f} kB", markup=False)
