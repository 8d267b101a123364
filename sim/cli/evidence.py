"""`companion-sim evidence`: the campaigns that an application needs, with one page and one document."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.common import note_if_slow
from companion.errors import require
from sim.campaign.plan import Part
from sim.cli.campaign import ModelOption, SeedOption


def evidence(
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR", help="Folder for evidence.html, .pdf, .json, and results to continue from."
        ),
    ],
    encounters: Annotated[
        int,
        typer.Option(
            min=1, max=1_000_000, help="Encounters with perfect reports; the other parts are shares of it."
        ),
    ] = 1000,
    seed: SeedOption = 0,
    model: ModelOption = None,
    avoider: Annotated[
        list[str] | None,
        typer.Option(
            "--avoider", metavar="NAME", help="Peers to compare with; default: all that are installed."
        ),
    ] = None,
    part: Annotated[Part, typer.Option(help="Half of the encounters.")] = Part.EVALUATION,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes; default: one per core.")
    ] = None,
    scheduler: Annotated[
        str, typer.Option(metavar="local|ADDRESS", help="A dask scheduler, as tcp://192.168.1.7:8786.")
    ] = "local",
) -> None:
    """Fly the campaigns that an application needs; write one page, one PDF and the figures as JSON.

    An interrupted run continues: start it again with the same options.
    """
    require("matplotlib", "companion-sim evidence", "sim")
    from sim.evidence import command
    from sim.evidence.plan import EvidencePlan

    console = Console(highlight=False)
    note_if_slow()
    peers = command.available(avoider or [], console)
    plan = EvidencePlan(encounters, seed, peers, tuple(map(str, model or ())), part)
    report = command.run(plan, out, console, workers=workers, scheduler=scheduler)
    command.print_figures(console, report)
    if len(report["configuration"]["flown_by"]) > 1:
        console.print("Several versions flew these results: use another --out for figures of one version.")
    console.print(f"\n{out / 'evidence.html'}, evidence.pdf and evidence.json are written", soft_wrap=True)
