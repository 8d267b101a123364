"""`companion replay`: drives the engine by a recorded flight."""

import asyncio
import json
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer
from rich.console import Console

from companion.cli.common import ProgressBar, note_if_slow, writable
from companion.cli.display import replay_display_settings
from companion.config import Config, load_config, load_obstacles, load_saved
from companion.engine import Engine
from companion.errors import ConfigError
from companion.model import Layer
from companion.replay import RecordedReceivers, Replay
from companion.replay import replay as replay_log
from companion.web.settings import Settings

if TYPE_CHECKING:
    from companion.web.replay_server import ReplayServer


def replay(
    log: Annotated[Path, typer.Argument(metavar="LOG.tlog", help="A telemetry log.", show_default=False)],
    config_file: Annotated[
        Path | None, typer.Option("--config", metavar="CONFIG", help="Decide with this configuration.")
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option("--settings", metavar="FILE", help="Use these settings, as saved by a flight."),
    ] = None,
    decisions: Annotated[
        Path | None,
        typer.Option("--decisions", metavar="OUT.jsonl", help="Write every decision, one JSON line each."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE.json", help="Write the figures as JSON.")
    ] = None,
    web: Annotated[
        bool, typer.Option("--web", help="Afterwards show the flight in the browser, until Ctrl-C.")
    ] = False,
    listen: Annotated[
        str | None, typer.Option("--listen", metavar="HOST:PORT", help="Where to show it, with --web.")
    ] = None,
) -> None:
    """Run the engine on a recorded flight and list what it decides. Nothing is sent."""
    config = None if config_file is None else load_config(config_file)
    saved = None if settings is None else _saved_values(settings, config or Config(links=()))
    engine = Engine(None if config is None else config.for_engine(load_obstacles(config)), saved=saved)
    receivers = RecordedReceivers()
    server = None
    if web:
        server = _replay_server(engine, replay_display_settings(log, config, listen), receivers)
    for path in (decisions, report):
        if path is not None:
            writable(path)
    note_if_slow()
    console = Console(highlight=False)
    with ExitStack() as stack:
        file = None if decisions is None else stack.enter_context(decisions.open("w", encoding="utf-8"))
        result = replay_log(
            log,
            engine,
            on_decision=None if file is None else _line_writer(file),
            on_moment=_ignore if server is None else server.take,
            on_progress=stack.enter_context(ProgressBar(console, log)),
            receivers=receivers,
        )
    _print_result(console, log, result)
    if report is not None:
        report.write_text(json.dumps(result.report(), indent=2) + "\n", encoding="utf-8")
    if server is not None:
        console.print(f"{server.settings.url}  (Ctrl-C ends)", markup=False)
        with suppress(KeyboardInterrupt):
            asyncio.run(server.show())


def _saved_values(settings: Path, config: Config) -> Mapping[str, float]:
    """The values in a settings file that the user named: unlike in flight, each of them must be usable."""
    saved = load_saved(config, settings)
    if saved.problem is not None or not settings.exists():
        raise ConfigError(saved.problem or f"{settings}: there is no such file")
    return saved.values


def _replay_server(engine: Engine, settings: Settings, receivers: RecordedReceivers) -> "ReplayServer":
    """The server that shows the replay; imported here because `companion run` starts without a web server."""
    from companion.web.replay_server import ReplayServer

    return ReplayServer(engine, settings, lambda: receivers.by_address.values())


def _line_writer(file: TextIO) -> Callable[[str], object]:
    return lambda line: file.write(f"{line}\n")


def _ignore(_since_s: float, _now_s: float) -> None:
    return None


def _print_result(console: Console, log: Path, result: Replay) -> None:
    for since_s, layer, words in result.events:
        console.print(f"{since_s:8.1f} s  {layer:<5}  {words}", markup=False, soft_wrap=True)
    for line in result.sightings.lines():
        console.print(line, markup=False, soft_wrap=True)
    for receiver in result.receivers:
        counted = receiver.counters
        console.print(
            f"{receiver.address}: {counted.messages} messages, {counted.reports} reports, "
            f"{counted.bad.total()} bad",
            markup=False,
            soft_wrap=True,
        )
    if result.lost_pieces:
        console.print(f"{result.lost_pieces} pieces of what receivers sent are lost", markup=False)
    layers = ", ".join(f"{layer} {result.layers[layer]}" for layer in Layer)
    console.print(
        f"{log.name}: {result.messages} messages ({result.bad_bytes} bad bytes), "
        f"{result.duration_s:.0f} s in {result.elapsed_s:.1f} s; {result.layers.total()} decisions: {layers}",
        markup=False,
        soft_wrap=True,
    )
