"""The command line: `companion run`, `check`, `replay` and `report`."""

import asyncio
import json
import logging
import os
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from companion import __version__
from companion.address import host_and_port
from companion.airspace.obstacles import Obstacle
from companion.config import (
    Config,
    WebParams,
    describe,
    describe_saved,
    example,
    example_names,
    load_config,
    load_obstacles,
    load_saved,
    reference,
    tuned,
)
from companion.control.state_machine import printed
from companion.engine import Engine
from companion.errors import CompanionError, ConfigError, LogError, require
from companion.links import open_at_start, open_link
from companion.model import Layer
from companion.preflight import DEFAULT_SECONDS, look
from companion.recording.recorder import MB, Recorder
from companion.recording.state_file import DurableStateFile, StateFile
from companion.replay import Replay, replay
from companion.runtime import Runtime
from companion.watchdog import Watchdog
from companion.web import Display
from companion.web.settings import SHORTEST_TOKEN, Settings

if TYPE_CHECKING:
    from companion.web.replay_server import ReplayServer

app = typer.Typer(
    help="Collision-avoidance companion for fixed-wing MAVLink autopilots.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)

ConfigFile = Annotated[
    Path, typer.Argument(metavar="CONFIG", help="Configuration file, YAML.", show_default=False)
]
ReportFile = Annotated[
    Path | None, typer.Option("--report", metavar="FILE.json", help="Write the figures as JSON.")
]


@app.command(epilog="Example: companion run configs/arduplane.yaml")
def run(
    config_file: ConfigFile,
    no_web: Annotated[bool, typer.Option("--no-web", help="No live display in the browser.")] = False,
) -> None:
    """Fly: listen to the autopilot, avoid traffic, give the aircraft back. Ends on Ctrl-C or SIGTERM.

    The links of CONFIG are udpin:HOST:PORT, udpout:HOST:PORT, tcpin:HOST:PORT, tcpout:HOST:PORT or
    serial:DEVICE:BAUD; nothing is sent on one that ends in ?listen. A link that fails is opened again.
    """
    config = load_config(config_file)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    display = None if no_web or not config.web.enabled else Display(_display_in_flight(config))
    asyncio.run(_run(config, load_obstacles(config), display))


def _display_in_flight(config: Config) -> Settings:
    """The same, read-only where the token is no good: whoever starts again in flight must not fail for it."""
    try:
        return _display_settings(config)
    except ConfigError as error:
        logging.getLogger("companion").error("%s; the display is read-only", error)
        return _display_settings(replace(config, web=replace(config.web, token_file=None)))


def _display_settings(config: Config) -> Settings:
    """Where the display listens, and who gives orders by it; `ConfigError` when the token cannot be read."""
    host, port = host_and_port(config.web.listen)
    token_file, token = config.web.token_file, None
    if token_file is not None:
        try:
            token = token_file.read_text(encoding="utf-8").partition("\n")[0].strip()
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"web.token_file {token_file}: cannot be read: {error}") from error
        if len(token) < SHORTEST_TOKEN:
            raise ConfigError(f"web.token_file {token_file}: must have at least {SHORTEST_TOKEN} characters")
    in_feet = config.engine.text_units == "aviation"
    return Settings(host, port, token, config.web.origins, feet=in_feet)


async def _run(config: Config, obstacles: tuple[Obstacle, ...], display: Display | None) -> None:
    log = logging.getLogger("companion")
    links = [open_link(address) for address in config.links]
    await open_at_start(links)
    log.info("companion %s on %s", __version__, ", ".join(config.links))
    recorder, not_recorded = _recorder(config, log)
    saved = load_saved(config)
    if saved.problem is not None:
        log.warning(saved.problem)
    for line in describe_saved(config, saved):
        log.info("%s: %s", config.settings_file, line)
    runtime = Runtime(
        Engine(config.for_engine(obstacles), saved=saved.values),
        links,
        recorder=recorder,
        not_recorded=not_recorded,
        watchdog=Watchdog(os.environ),
        keeper=StateFile(config.state_file),
        settings=DurableStateFile(config.settings_file),
        display=display,
    )
    await runtime.run(on_signals=True)


def _recorder(config: Config, log: logging.Logger) -> tuple[Recorder | None, str | None]:
    """The recorder, or why there is none: a card that cannot be written to must not keep us from flying."""
    recording = config.recording
    if not recording.enabled:
        return None, None
    try:
        recorder = Recorder(
            recording.directory,
            time.time(),
            max_file_bytes=recording.max_file_mb * MB,
            max_total_bytes=recording.max_total_mb * MB,
        )
    except LogError as error:
        log.error("%s; flying without a recording", error)
        return None, str(error)
    log.info("recording %s", recorder.tlog_path)
    return recorder, None


@app.command(epilog="Example: companion check configs/arduplane.yaml --link")
def check(
    config_file: Annotated[
        Path | None, typer.Argument(metavar="CONFIG", help="Configuration file, YAML.", show_default=False)
    ] = None,
    link: Annotated[
        bool, typer.Option("--link", help="Connect, list what is found, say whether it would fly.")
    ] = False,
    seconds: Annotated[
        float, typer.Option(min=3.0, max=600.0, help="How long to listen, with --link.")
    ] = DEFAULT_SECONDS,
    table: Annotated[
        bool, typer.Option("--table", help="Print the supervisor's table: who may fly, and when.")
    ] = False,
    all_keys: Annotated[
        bool, typer.Option("--reference", help="Print every key that there is, its default and range.")
    ] = False,
    example_name: Annotated[
        str | None,
        typer.Option("--example", metavar="NAME", help=f"Print an example: {', '.join(example_names())}."),
    ] = None,
) -> None:
    """Read a configuration and show it as it would be used, every default included.

    With --link the autopilot is asked many questions and commanded nothing; exit code 1 when none is heard.
    """
    if all_keys:
        sys.stdout.write(reference())
        return
    if example_name is not None:
        sys.stdout.write(example(example_name))
        return
    if config_file is None:
        raise ConfigError("CONFIG is missing: the configuration file")
    config = load_config(config_file)
    _display_settings(config)
    obstacles = load_obstacles(config)
    console = Console(highlight=False, soft_wrap=True)
    saved = load_saved(config)
    if table:
        console.print(printed(), markup=False)
    elif link:
        _check_link(console, tuned(config, saved), seconds)
    else:
        console.print(describe(config), markup=False, end="")
        if config.obstacle_files:
            console.print(f"# obstacle_files: {len(obstacles)} obstacles", markup=False)
        for line in describe_saved(config, saved):
            console.print(f"# {config.settings_file}: {line}", markup=False, style="yellow")
        if saved.problem is not None:
            console.print(f"# {saved.problem}", markup=False, style="yellow")
        console.print(f"{config_file}: good to fly with", markup=False, style="green")


def _check_link(console: Console, config: Config, seconds: float) -> None:
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(message)s", stream=sys.stderr)
    # What the runtime has to say is among the findings; why a link does not open is not.
    logging.getLogger("companion").addFilter(lambda record: record.module != "runtime")
    links = [open_link(address) for address in config.links]
    found = asyncio.run(look(config, links, seconds))
    width = max(len(finding.topic) for finding in found.findings)
    for finding in found.findings:
        style = "" if finding.good else "yellow"
        console.print(f"{finding.topic:{width}}  {finding.words}", markup=False, style=style)
    if not found.heard:
        raise CompanionError("would not fly: no autopilot is heard")
    if found.hindrances:
        console.print(f"would not fly now: {'; '.join(found.hindrances)}", markup=False, style="yellow")
    else:
        console.print("would fly: in a conflict it takes the aircraft over", markup=False, style="green")


@app.command("replay", epilog="Example: companion replay flight.tlog --report replay.json")
def replay_command(
    log: Annotated[Path, typer.Argument(metavar="LOG.tlog", help="A telemetry log.", show_default=False)],
    config_file: Annotated[
        Path | None, typer.Option("--config", metavar="CONFIG", help="Decide with this configuration.")
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option("--settings", metavar="FILE", help="With these settings, as a flight had saved them."),
    ] = None,
    decisions: Annotated[
        Path | None,
        typer.Option("--decisions", metavar="OUT.jsonl", help="Write every decision, one JSON line each."),
    ] = None,
    report: ReportFile = None,
    web: Annotated[
        bool, typer.Option("--web", help="Then show it in the browser, until Ctrl-C: play, pause, scrub.")
    ] = False,
    listen_at: Annotated[
        str | None, typer.Option("--listen", metavar="HOST:PORT", help="Where, with --web.")
    ] = None,
) -> None:
    """Drive the engine by a recorded flight: what would it have decided? Nothing is sent."""
    config = None if config_file is None else load_config(config_file)
    saved = None if settings is None else _values_in(settings, config or Config(links=()))
    engine = Engine(None if config is None else config.for_engine(load_obstacles(config)), saved=saved)
    cinema = _cinema(engine, _replay_settings(log, config, listen_at)) if web else None
    console = Console(highlight=False)
    with ExitStack() as stack:
        on_decision: Callable[[str], object] | None = None
        if decisions is not None:
            on_decision = _LineWriter(stack.enter_context(writable(decisions).open("w", encoding="utf-8")))
        on_progress: Callable[[int], object] = _ignore
        if console.is_terminal:
            on_progress = stack.enter_context(_ProgressBar(console, log))
        on_moment = _ignore_both if cinema is None else cinema.take
        result = replay(log, engine, on_decision=on_decision, on_moment=on_moment, on_progress=on_progress)
    _print_replay(console, log, result)
    if report is not None:
        writable(report).write_text(json.dumps(result.report(), indent=2) + "\n", encoding="utf-8")
    if cinema is not None:
        console.print(f"{cinema.settings.url}  (Ctrl-C ends)", markup=False)
        with suppress(KeyboardInterrupt):
            asyncio.run(cinema.show())


def _cinema(engine: Engine, settings: Settings) -> "ReplayServer":
    """Where a replay is shown. A companion that starts in flight must not wait for a web server's imports."""
    from companion.web.replay_server import ReplayServer

    return ReplayServer(engine, settings)


def _replay_settings(log: Path, config: Config | None, listen_at: str | None) -> Settings:
    where = listen_at or (WebParams() if config is None else config.web).listen
    try:
        host, port = host_and_port(where)
    except ValueError as error:
        raise ConfigError(f"--listen {where}: {error}") from error
    return Settings(host, port, title=log.name)


def _ignore_both(_: float, __: float) -> None:
    return None


@app.command("report", epilog="Example: companion report companion-20260101-120000.mcap --out report.html")
def report_command(
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
        Path | None, typer.Option("--config", metavar="CONFIG", help="Decide about a tlog with this one.")
    ] = None,
) -> None:
    """Write a page about a flight: path, encounters, what was decided and why, what was told, the link.

    An MCAP recording tells what was decided in flight, with the tlog beside it also what came over the link.
    A tlog is driven through the engine, as by replay. Later parts of the same recording are read too.
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
    with ExitStack() as stack:
        on_progress: Callable[[int], object] = _ignore
        if console.is_terminal:
            on_progress = stack.enter_context(_ProgressBar(console, *files_of(log)))
        found = read_log(log, engine, on_progress)
        text = page_of(found)
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CompanionError(f"{out}: cannot be written: {error.strerror}") from error
    for note in found.flight.notes:
        console.print(note, markup=False, style="yellow")
    console.print(f"{out}: {len(text) / 1000:.0f} kB", markup=False)


def _values_in(settings: Path, config: Config) -> Mapping[str, float]:
    """What was saved in a file that somebody named: then all of it has to be used."""
    saved = load_saved(config, settings)
    if saved.problem is not None or not settings.exists():
        raise ConfigError(saved.problem or f"{settings}: there is no such file")
    return saved.values


def _ignore(_: object) -> None:
    return None


class _LineWriter:
    """Writes lines to an open file."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def __call__(self, line: str) -> None:
        self._file.write(line + "\n")


class _ProgressBar:
    """A bar over the bytes of a log and its later parts, on a terminal."""

    def __init__(self, console: Console, *logs: Path) -> None:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("kB"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        size = sum(log.stat().st_size for log in logs if log.is_file())
        self._task = self._bar.add_task(logs[0].name, total=size // 1000)

    def __enter__(self) -> Callable[[int], None]:
        self._bar.start()
        return lambda read_bytes: self._bar.update(self._task, completed=read_bytes // 1000)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


def _print_replay(console: Console, log: Path, result: Replay) -> None:
    for since_s, layer, because in result.events:
        console.print(f"{since_s:8.1f} s  {layer:<5}  {because}", markup=False)
    layers = ", ".join(f"{layer} {result.layers[layer]}" for layer in Layer)
    console.print(
        f"{log.name}: {result.messages} messages ({result.bad_bytes} bad bytes), "
        f"{result.duration_s:.0f} s in {result.elapsed_s:.1f} s; {result.layers.total()} decisions: {layers}",
        markup=False,
        soft_wrap=True,
    )


def writable(path: Path) -> Path:
    """The same path, when a file can be written there."""
    if not path.parent.is_dir():
        raise ConfigError(f"{path}: there is no folder {path.parent}")
    if path.is_dir():
        raise ConfigError(f"{path}: this is a folder, not a file")
    return path


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    if version:
        typer.echo(__version__)
        raise typer.Exit


def guarded(application: typer.Typer) -> int:
    """Run an application: 0 done, 1 failed, 2 bad usage or configuration; errors in one line."""
    try:
        application()
    except ConfigError as error:
        return _say(error, 2)
    except CompanionError as error:
        return _say(error, 1)
    except SystemExit as leave:
        return leave.code if isinstance(leave.code, int) else 1
    return 0


def _say(error: Exception, code: int) -> int:
    sys.stderr.write(f"{error}\n")
    return code


def main() -> None:
    """Entry point."""
    sys.exit(guarded(app))
