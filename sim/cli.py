"""The command line: `companion-sim demo`, `vehicle`, `relay`, `bench`, `paper` and campaigns."""

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

from companion.cli import guarded, writable
from companion.errors import CompanionError, ConfigError, LinkError, alone
from companion.links import open_link
from companion.web.settings import Settings
from sim.bench import run as run_bench
from sim.campaign.plan import Part, Plan
from sim.clock import ScaledClock
from sim.demo import DemoOptions, DemoState, fly_demo
from sim.demo_view import DemoView, print_result
from sim.faults import Faults
from sim.relay import Relay
from sim.scenario import DEFAULT_SCENARIO, build_world, load_scenario, scenario_names
from sim.server import VehicleServer

app = typer.Typer(
    help="A fake fixed wing that speaks MAVLink, traffic, and demonstrations of the companion.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


class Autopilot(StrEnum):
    """Which autopilot's manners the fake vehicle has."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


class Direction(StrEnum):
    """Where `relay` has faults: away from the side that listens, back to it, or both."""

    FORTH = "forth"
    BACK = "back"
    BOTH = "both"


class Study(StrEnum):
    """What `paper` flies."""

    EXPERIMENTS = "experiments"
    TRANSITION = "transition"
    FIELDS = "fields"
    ALL = "all"


ScenarioOption = Annotated[
    str, typer.Option(metavar="NAME|FILE", help=f"One of {', '.join(scenario_names())}, or a YAML file.")
]
AutopilotOption = Annotated[Autopilot, typer.Option(help="Whose manners the vehicle has.")]
SpeedupOption = Annotated[float, typer.Option(min=0.1, max=100.0, help="How much faster than real time.")]


@app.command(epilog="Example: companion-sim demo --scenario head-on --speedup 4")
def demo(
    scenario: ScenarioOption = DEFAULT_SCENARIO,
    autopilot: AutopilotOption = Autopilot.ARDUPILOT,
    speedup: SpeedupOption = 8.0,
    no_avoidance: Annotated[
        bool, typer.Option("--no-avoidance", help="Leave the companion out: what would have happened.")
    ] = False,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where the flight is recorded.")] = Path(
        "recordings"
    ),
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the figures as JSON.")
    ] = None,
    no_web: Annotated[bool, typer.Option("--no-web", help="No live display in the browser.")] = False,
) -> None:
    """Fly a mission among traffic, over real sockets.

    Exit code 0 only if no near mid-air collision happened and the mission was finished.
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
    """Ctrl-C ends the demonstration as it ends the service: the aircraft is given back first."""
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
        self._view.tell(record.getMessage())


@app.command(epilog="Example: companion-sim vehicle --link udpout:127.0.0.1:14550 --scenario head-on")
def vehicle(
    link: Annotated[
        list[str],
        typer.Option(
            metavar="ADDRESS",
            help="udpin, udpout, tcpin or tcpout:HOST:PORT, or serial:DEVICE:BAUD; as often as wanted.",
        ),
    ],
    scenario: ScenarioOption = DEFAULT_SCENARIO,
    autopilot: AutopilotOption = Autopilot.ARDUPILOT,
    speedup: SpeedupOption = 1.0,
) -> None:
    """Run the fake vehicle on its own, its traffic included, until Ctrl-C."""
    chosen = load_scenario(scenario)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    try:
        links = [open_link(address) for address in link]
    except LinkError as error:
        raise ConfigError(f"--link {error}") from error
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
    """Measure what a decision costs, from datagram to setpoint, and replay; about a minute."""
    if report is not None:
        writable(report)
    logging.getLogger("companion").addHandler(logging.NullHandler())
    console = Console(highlight=False)
    status = console.status("starting") if console.is_terminal else contextlib.nullcontext()
    with status as shown:
        figures = run_bench(lambda text: shown.update(text) if shown is not None else None)
    table = Table(title="Milliseconds", title_justify="left")
    for heading in ("what", "p50", "p99"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for count, times in figures["decide_ms"].items():
        table.add_row(
            f"a decision among {count}, all in conflict", f"{times['p50']:.2f}", f"{times['p99']:.2f}"
        )
    wire = figures["wire_latency_ms"]
    table.add_row("ADS-B datagram in to setpoint out", f"{wire['p50']:.2f}", f"{wire['p99']:.2f}")
    console.print(table)
    console.print(
        f"Replay through the engine: {figures['replay_messages_per_s']:,} messages/s, "
        f"{figures['replay_ratio']} times pymavlink's reader; reading alone "
        f"{figures['read_messages_per_s']:,}, {figures['read_ratio']} times."
    )
    if report is not None:
        report.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


@app.command(epilog="Example: companion-sim paper --out paper-results")
def paper(
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where reports, tables and figures are written.")
    ] = None,
    study: Annotated[
        Study, typer.Option(help="The experiments (within a minute), or a study of many fields (minutes).")
    ] = Study.EXPERIMENTS,
    fields: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="How many random fields a study flies, instead of all."),
    ] = None,
    table: Annotated[bool, typer.Option("--table", help="Print the strategy table that flies.")] = False,
) -> None:
    """Fly the paper's experiments with the avoidance that flies; reports, tables and figures.

    Exit code 0 only if the two layers arrive in both experiments without collision.
    """
    # Drawing takes longer to import than the other commands take to start.
    from sim.paper import command

    console = Console(highlight=False)
    if table:
        command.print_strategy_table(console)
    if out is None:
        if table:
            return
        raise ConfigError("paper: say where to write to with --out DIR, or --table")
    command.folder(out)
    # Leave by the front door, so that the processes of the flights end with this one.
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


EncountersOption = Annotated[int, typer.Option("--encounters", min=1, max=10_000_000, help="How many.")]
SeedOption = Annotated[int, typer.Option(min=0, help="Of all chances: the same seed, the same campaign.")]
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
IntrudersOption = Annotated[int, typer.Option(min=1, max=4, help="At once, from the models.")]
LockOption = Annotated[
    bool, typer.Option("--lock-height", help="A ceiling just above the mission's height, a floor just below.")
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
        Part, typer.Option(help="One half of the encounters: look at tuning, quote evaluation.")
    ] = Part.ALL,
    results: Annotated[
        Path, typer.Option(metavar="FILE.ndjson", help="Kept as they come; an interrupted campaign goes on.")
    ] = Path("campaign.ndjson"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Processes; default: all cores.")
    ] = None,
    scheduler: Annotated[
        str,
        typer.Option(metavar="local|ADDRESS", help="Of dask, as tcp://192.168.1.7:8786: its workers fly."),
    ] = "local",
    page: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write a page, with the worst encounters drawn.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write the figures as JSON.")
    ] = None,
) -> None:
    """Fly encounters by the thousand through the engine that flies, and say how safe it is."""
    # Figures take longer to import than the other commands take to start.
    from sim.campaign import command

    for path in (page, report):
        if path is not None:
            writable(path)
    plan = Plan(
        encounters, seed, tuple(dict.fromkeys(avoider or ["companion"])), tuple(map(str, model or ())),
        tuple(dict.fromkeys(surveillance or ["perfect"])), intruders, lock_height, part,
    )  # fmt: skip
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
        int, typer.Argument(metavar="NUMBER", min=0, help="As in the results of its campaign.")
    ],
    seed: SeedOption = 0,
    avoider: Annotated[str, typer.Option(metavar="NAME", help="As of the campaign.")] = "companion",
    model: ModelOption = None,
    surveillance: Annotated[str, typer.Option(metavar="PRESET", help="As of the campaign.")] = "perfect",
    intruders: IntrudersOption = 1,
    lock_height: LockOption = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw it: paths, heights and separation.")
    ] = None,
) -> None:
    """Fly one encounter of a campaign again, and say what was decided when."""
    from sim.campaign import command

    if out is not None:
        writable(out)
    models = tuple(map(str, model or ()))
    plan = Plan(number + 1, seed, (avoider,), models, (surveillance,), intruders, lock_height)
    command.show_encounter(plan, number, Console(highlight=False), out)


@app.command(
    epilog="Example: companion-sim relay --listen udpin:0.0.0.0:14560 --to udpout:127.0.0.1:14550 --loss 0.1"
)
def relay(
    listen: Annotated[str, typer.Option(metavar="udpin:HOST:PORT", help="Where one end sends to.")],
    to: Annotated[str, typer.Option(metavar="udpout:HOST:PORT", help="Where the other end listens.")],
    loss: Annotated[float, typer.Option(min=0.0, max=1.0, help="Share of datagrams that get lost.")] = 0.0,
    duplication: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of datagrams that come twice.")
    ] = 0.0,
    delay: Annotated[float, typer.Option(min=0.0, max=3600.0, help="Seconds that each takes.")] = 0.0,
    jitter: Annotated[
        float, typer.Option(min=0.0, max=3600.0, help="Up to so many seconds more, which reorders them.")
    ] = 0.0,
    direction: Annotated[
        Direction, typer.Option(help="Which way has faults; forth is from --listen to --to.")
    ] = Direction.BOTH,
    seed: Annotated[int, typer.Option(help="Of the chances.")] = 0,
) -> None:
    """Pass datagrams on between two ends, with faults, until Ctrl-C: what does the companion make of them?"""
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
    with alone():
        await server.run()


def main() -> None:
    """Entry point."""
    sys.exit(guarded(app))
