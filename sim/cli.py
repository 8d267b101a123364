"""The command line: `companion-sim demo`, `vehicle`, `relay`, `bench`, `paper`, `campaign`, `encounter`."""

import asyncio
import contextlib
import json
import logging
import signal
import sys
import time
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.cli.common import VersionFlag, note_if_slow, run_app, show_version, writable
from companion.errors import CompanionError, ConfigError, LinkError, require, ungrouped
from companion.links import open_link
from companion.web.settings import Settings
from sim.bench import run as run_bench
from sim.campaign.plan import Part, Plan
from sim.clock import ScaledClock
from sim.demo import DemoOptions, DemoState, fly_demo
from sim.demo_view import DemoView, print_result
from sim.faults import Faults
from sim.relay import Relay
from sim.scenario import DEFAULT_SCENARIO, load_scenario, scenario_names
from sim.server import VehicleServer
from sim.world import build_world

app = typer.Typer(
    help="Simulated aircraft and traffic for Companion: demonstrations, experiments and campaigns.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


@app.callback(invoke_without_command=True)
def _root(version: VersionFlag = False) -> None:
    if version:
        show_version("companion-sim")


class Autopilot(StrEnum):
    """The autopilot that the fake vehicle imitates."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


class Direction(StrEnum):
    """The direction of `relay`'s faults: away from the listening side, back to it, or both."""

    FORTH = "forth"
    BACK = "back"
    BOTH = "both"


class Study(StrEnum):
    """The studies of `paper`."""

    EXPERIMENTS = "experiments"
    TRANSITION = "transition"
    FIELDS = "fields"
    ALL = "all"


ScenarioOption = Annotated[
    str, typer.Option(metavar="NAME|FILE", help=f"One of {', '.join(scenario_names())}, or a YAML file.")
]
AutopilotOption = Annotated[Autopilot, typer.Option(help="The autopilot that the vehicle imitates.")]
SpeedupOption = Annotated[float, typer.Option(min=0.1, max=100.0, help="Simulated time against real time.")]


@app.command(epilog="Example: companion-sim demo --scenario head-on --speedup 4")
def demo(
    scenario: ScenarioOption = DEFAULT_SCENARIO,
    autopilot: AutopilotOption = Autopilot.ARDUPILOT,
    speedup: SpeedupOption = 8.0,
    no_avoidance: Annotated[
        bool, typer.Option("--no-avoidance", help="Fly without Companion, for comparison.")
    ] = False,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the recording.")] = Path(
        "recordings"
    ),
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the figures as JSON.")
    ] = None,
    no_web: Annotated[bool, typer.Option("--no-web", help="No live display in the browser.")] = False,
) -> None:
    """Fly a simulated aircraft among traffic, with Companion, over UDP on this computer.

    Exit code 0 if the mission was finished without a near mid-air collision.
    """
    if report is not None:
        writable(report)
    options = DemoOptions(
        scenario=load_scenario(scenario),
        speedup=speedup,
        avoidance=not no_avoidance,
        record=record,
        autopilot=autopilot.value,
        display=None if no_web else Settings(title=f"Demonstration: {Path(scenario).stem}"),
    )
    note_if_slow()
    console = Console(highlight=False)
    with DemoView(console) as view:
        handler = _ViewHandler(view)
        logging.getLogger("companion").addHandler(handler)
        logging.getLogger("companion").setLevel(logging.INFO)
        try:
            state = asyncio.run(_until_interrupted(options, view))
        finally:
            logging.getLogger("companion").removeHandler(handler)
    print_result(console, state)
    if report is not None:
        report.write_text(json.dumps(state.report(), indent=2) + "\n", encoding="utf-8")
    if not state.passed:
        raise typer.Exit(1)


async def _until_interrupted(options: DemoOptions, view: DemoView) -> DemoState:
    """Run the demonstration; Ctrl-C ends it as it ends the service, after releasing the aircraft."""
    running = asyncio.ensure_future(fly_demo(options, view.start))
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, running.cancel)
    try:
        return await running
    except asyncio.CancelledError:
        raise CompanionError("interrupted") from None


class _ViewHandler(logging.Handler):
    """Shows the companion's own log lines in the view."""

    def __init__(self, view: DemoView) -> None:
        super().__init__()
        self._view = view

    def emit(self, record: logging.LogRecord) -> None:
        self._view.add_text(record.getMessage())


@app.command(epilog="Example: companion-sim vehicle --link udpout:127.0.0.1:14550 --scenario head-on")
def vehicle(
    link: Annotated[
        list[str],
        typer.Option(
            metavar="ADDRESS",
            help="udpin, udpout, tcpin or tcpout:HOST:PORT, or serial:DEVICE:BAUD; may be repeated.",
        ),
    ],
    scenario: ScenarioOption = DEFAULT_SCENARIO,
    autopilot: AutopilotOption = Autopilot.ARDUPILOT,
    speedup: SpeedupOption = 1.0,
) -> None:
    """Simulate an aircraft and its traffic on MAVLink links, without Companion, until Ctrl-C."""
    chosen = load_scenario(scenario)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    try:
        links = [open_link(address) for address in link]
    except LinkError as error:
        raise ConfigError(f"--link {error}") from error
    note_if_slow()
    start_s = float(int(time.time()))
    world = build_world(chosen, start_s, autopilot=autopilot.value)
    clock = ScaledClock(speedup, start_s=start_s)
    server = VehicleServer(world.vehicle, links, clock, receiver=world.receiver)
    logging.getLogger("sim").info(
        "%s, system 1, on %s: %s", world.vehicle.name, ", ".join(link), chosen.description
    )
    asyncio.run(_serve(server))


@app.command(epilog="Example: companion-sim bench --report bench.json")
def bench(
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the figures as JSON.")
    ] = None,
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


@app.command(epilog="Example: companion-sim paper --out paper-results")
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


EncountersOption = Annotated[
    int, typer.Option("--encounters", min=1, max=10_000_000, help="Number of encounters.")
]
SeedOption = Annotated[int, typer.Option(min=0, help="Random seed: the same seed gives the same campaign.")]
AvoiderOption = Annotated[
    list[str] | None,
    typer.Option(
        "--avoider", metavar="NAME", help="companion (default), none, ardupilot, ardupilot-610, mvp, orca."
    ),
]
ModelOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--model", metavar="FILE", help="MIT Lincoln Laboratory model (.txt), or encounters (.csv, .daa)."
    ),
]
SurveillanceOption = Annotated[
    list[str] | None,
    typer.Option("--surveillance", metavar="PRESET", help="perfect (default), adsb-out or poor."),
]
IntrudersOption = Annotated[int, typer.Option(min=1, max=4, help="Intruders per encounter of a model.")]
LockOption = Annotated[
    bool, typer.Option("--lock-height", help="Ceiling just above the mission's height, floor just below.")
]


@app.command(
    epilog="Example: companion-sim campaign --encounters 500 --avoider companion --avoider ardupilot"
)
def campaign(
    encounters: EncountersOption = 1000,
    seed: SeedOption = 0,
    avoider: AvoiderOption = None,
    model: ModelOption = None,
    surveillance: SurveillanceOption = None,
    intruders: IntrudersOption = 1,
    lock_height: LockOption = False,
    part: Annotated[
        Part, typer.Option(help="Half of the encounters: tune on one, quote the other.")
    ] = Part.ALL,
    results: Annotated[
        Path,
        typer.Option(metavar="FILE.ndjson", help="Results; an interrupted campaign continues."),
    ] = Path("campaign.ndjson"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes; default: one per core.")
    ] = None,
    scheduler: Annotated[
        str,
        typer.Option(metavar="local|ADDRESS", help="A dask scheduler, as tcp://192.168.1.7:8786."),
    ] = "local",
    page: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write a page with the worst encounters drawn.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the figures as JSON.")
    ] = None,
) -> None:
    """Fly thousands of encounters through the product's engine, and report the remaining risk."""
    if page is not None:
        require("matplotlib", "companion-sim campaign --page", "sim")
    from sim.campaign import command

    for path in (page, report):
        if path is not None:
            writable(path)
    plan = Plan(
        encounters, seed, tuple(dict.fromkeys(avoider or ["companion"])), tuple(map(str, model or ())),
        tuple(dict.fromkeys(surveillance or ["perfect"])), intruders, lock_height, part,
    )  # fmt: skip
    note_if_slow()
    console = Console(highlight=False)
    figures = command.run(plan, results, console, workers=workers, scheduler=scheduler)
    command.print_figures(console, figures)
    if report is not None:
        command.write_report(report, figures)
    if page is not None:
        page.write_text(command.page_of(plan, results, figures), encoding="utf-8")


@app.command(epilog="Example: companion-sim encounter 17 --seed 1 --out encounter-17.png")
def encounter(
    number: Annotated[
        int, typer.Argument(metavar="NUMBER", min=0, help="Its number in the results of the campaign.")
    ],
    seed: SeedOption = 0,
    avoider: Annotated[str, typer.Option(metavar="NAME", help="As in the campaign.")] = "companion",
    model: ModelOption = None,
    surveillance: Annotated[str, typer.Option(metavar="PRESET", help="As in the campaign.")] = "perfect",
    intruders: IntrudersOption = 1,
    lock_height: LockOption = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw paths, heights and separation.")
    ] = None,
) -> None:
    """Fly one encounter of a campaign again, and list its decisions."""
    from sim.campaign import command

    if out is not None:
        require("matplotlib", "companion-sim encounter --out", "sim")
        writable(out)
    models = tuple(map(str, model or ()))
    plan = Plan(number + 1, seed, (avoider,), models, (surveillance,), intruders, lock_height)
    note_if_slow()
    command.show_encounter(plan, number, Console(highlight=False), out)


@app.command(
    epilog="Example: companion-sim relay --listen udpin:0.0.0.0:14560 --to udpout:127.0.0.1:14550 --loss 0.1"
)
def relay(
    listen: Annotated[str, typer.Option(metavar="udpin:HOST:PORT", help="Address that one end sends to.")],
    to: Annotated[str, typer.Option(metavar="udpout:HOST:PORT", help="Address of the other end.")],
    loss: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of datagrams lost.")] = 0.0,
    duplication: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of datagrams duplicated.")
    ] = 0.0,
    delay: Annotated[
        float, typer.Option(min=0.0, max=3600.0, help="Delay of each datagram, in seconds.")
    ] = 0.0,
    jitter: Annotated[
        float,
        typer.Option(min=0.0, max=3600.0, help="Largest random extra delay, in seconds; it reorders."),
    ] = 0.0,
    direction: Annotated[
        Direction, typer.Option(help="Direction with faults; forth is from --listen to --to.")
    ] = Direction.BOTH,
    seed: Annotated[int, typer.Option(help="Random seed.")] = 0,
) -> None:
    """Forward datagrams between two ends, with faults, until Ctrl-C."""
    faults, none = Faults(loss, duplication, delay, jitter), Faults()
    try:
        between = Relay(
            listen,
            to,
            forth=none if direction is Direction.BACK else faults,
            back=none if direction is Direction.FORTH else faults,
            seed=seed,
        )
    except LinkError as error:
        raise ConfigError(f"relay: {error}") from error
    asyncio.run(_relay_until_interrupted(between))
    for name, line in (("forth", between.forth), ("back", between.back)):
        figures = ", ".join(f"{count} {what}" for what, count in asdict(line.counters).items())
        typer.echo(f"{name}: {figures}")


async def _relay_until_interrupted(between: Relay) -> None:
    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    with contextlib.closing(between):
        await between.open()
        await ended.wait()


async def _serve(server: VehicleServer) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, server.close)
    with ungrouped():
        await server.run()


def main() -> None:
    """Entry point."""
    sys.exit(run_app(app))
