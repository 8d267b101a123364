"""`companion check`: shows the values of a configuration, and the autopilot at the other end of its links."""

import asyncio
import logging
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.common import note_if_slow
from companion.cli.display import display_settings
from companion.cli.storage import storage_problems
from companion.config import (
    Config,
    apply_saved,
    describe,
    describe_saved,
    example,
    example_names,
    load_config,
    load_obstacles,
    load_saved,
    reference,
)
from companion.control.context import printed_claims
from companion.control.state_machine import printed, printed_data
from companion.errors import CompanionError, ConfigError
from companion.links import open_links
from companion.preflight import DEFAULT_SECONDS, Finding, run_preflight


def check(
    config_file: Annotated[
        Path | None, typer.Argument(metavar="CONFIG", help="Configuration file, YAML.", show_default=False)
    ] = None,
    link: Annotated[
        bool, typer.Option("--link", help="Connect, list what is found, and say whether it would fly.")
    ] = False,
    seconds: Annotated[
        float, typer.Option(min=3.0, max=600.0, help="How long to listen, with --link.")
    ] = DEFAULT_SECONDS,
    table: Annotated[
        bool, typer.Option("--table", help="Print the state machine: states, events, and what is remembered.")
    ] = False,
    all_keys: Annotated[
        bool, typer.Option("--reference", help="Print every key, its default and its range.")
    ] = False,
    example_name: Annotated[
        str | None,
        typer.Option("--example", metavar="NAME", help=f"Print an example: {', '.join(example_names())}."),
    ] = None,
) -> None:
    """Read a configuration and show the values in effect, defaults included.

    With --link the autopilot is queried but never commanded; exit code 1 if no autopilot is heard. Exit code
    2 if a file of the flight cannot be written.
    """
    if all_keys:
        sys.stdout.write(reference())
        return
    if example_name is not None:
        sys.stdout.write(example(example_name))
        return
    if table:
        sys.stdout.write(f"{printed()}\n\nWhat each state remembers:\n{printed_data()}\n\n")
        sys.stdout.write(f"What ends our control, and what keeps us from taking it:\n{printed_claims()}\n")
        return
    if config_file is None:
        raise ConfigError("CONFIG is missing: the configuration file")
    config = load_config(config_file)
    display_settings(config)
    obstacles = load_obstacles(config)
    note_if_slow()
    console = Console(highlight=False, soft_wrap=True)
    saved = load_saved(config)
    if link:
        _check_link(console, apply_saved(config, saved), seconds, config_file)
    else:
        console.print(describe(config), markup=False, end="")
        if config.obstacle_files:
            console.print(f"# obstacle_files: {len(obstacles)} obstacles", markup=False)
        for line in describe_saved(config, saved):
            console.print(f"# {config.settings_file}: {line}", markup=False, style="yellow")
        if saved.problem is not None:
            console.print(f"# {saved.problem}", markup=False, style="yellow")
        _refuse_storage(config, config_file)
        console.print(f"{config_file}: good to fly with", markup=False, style="green")


def _refuse_storage(config: Config, config_file: Path) -> None:
    """`ConfigError` if a file of the flight cannot be written; one line for each on stderr."""
    lines = [problem.in_file(config_file) for problem in storage_problems(config)]
    if lines:
        raise ConfigError("\n".join(lines))


def _check_link(console: Console, config: Config, seconds: float, config_file: Path) -> None:
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(message)s", stream=sys.stderr)
    # The findings include what the runtime logs, but not why a link does not open.
    logging.getLogger("companion").addFilter(lambda record: record.module != "runtime")
    links, receivers = open_links(config.links)
    found = asyncio.run(run_preflight(config, links, seconds, receivers=receivers))
    problems = list(storage_problems(config))
    storage = [Finding("storage", problem.in_file(config_file), good=False) for problem in problems]
    findings = [*found.findings, *storage]
    width = max(len(finding.topic) for finding in findings)
    for finding in findings:
        style = "" if finding.good else "yellow"
        console.print(f"{finding.topic:{width}}  {finding.text}", markup=False, style=style)
    if not found.heard:
        raise CompanionError("would not fly: no autopilot heard")
    if found.reasons_not_to_fly:
        console.print(
            f"would not fly now: {'; '.join(found.reasons_not_to_fly)}", markup=False, style="yellow"
        )
    else:
        console.print("would fly: in a conflict it takes over the aircraft", markup=False, style="green")
    if problems:
        keys = ", ".join(problem.key for problem in problems)
        raise ConfigError(f"{config_file}: cannot be written: {keys}")
