"""`companion-sim demo`: flies the demonstration and shows it on the terminal."""

import asyncio
import json
import logging
import signal
from collections.abc import Coroutine
from pathlib import Path
from typing import Annotated, TypeVar

import typer
from rich.console import Console

from companion.cli.common import note_if_slow, writable
from companion.errors import CompanionError
from companion.web.settings import Settings
from sim.cli.common import AnyScenarioOption, FormatName, ReportOption, SpeedupOption
from sim.demo import DemoOptions, DemoState, fly_demo
from sim.demo_view import DemoView, print_result
from sim.members.demo import FormationOptions, FormationState, fly_formation_demo
from sim.members.scenario import FormationScenario, load_any
from sim.members.view import FormationView, print_formation_result
from sim.scenario import DEFAULT_SCENARIO, Autopilot

_State = TypeVar("_State", DemoState, FormationState)


def demo(
    scenario: AnyScenarioOption = DEFAULT_SCENARIO,
    autopilot: Annotated[
        Autopilot | None,
        typer.Option(
            help="The autopilot that the vehicle imitates; px4 is version 1.16. "
            "The scenario of a formation names those of its members.",
            show_default="ardupilot",
        ),
    ] = None,
    speedup: SpeedupOption = 8.0,
    receiver: Annotated[
        FormatName | None,
        typer.Option(help="Traffic comes from a receiver of this format, instead of the autopilot."),
    ] = None,
    no_avoidance: Annotated[
        bool, typer.Option("--no-avoidance", help="Fly without Companion, for comparison.")
    ] = False,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the recording.")] = Path(
        "recordings"
    ),
    report: ReportOption = None,
    no_web: Annotated[bool, typer.Option("--no-web", help="No live display in the browser.")] = False,
) -> None:
    """Fly simulated aircraft among traffic, with Companion, over sockets on this computer.

    Exit code 0 if every mission was finished without a near mid-air collision, and with the members of a
    formation separated.
    """
    if report is not None:
        writable(report)
    chosen = load_any(scenario)
    display = None if no_web else Settings(title=f"Demonstration: {Path(scenario).stem}")
    source = None if receiver is None else str(receiver)
    note_if_slow()
    console = Console(highlight=False)
    state: DemoState | FormationState
    if isinstance(chosen, FormationScenario):
        if autopilot is not None:
            raise typer.BadParameter("the scenario of a formation names its members' autopilots")
        formation = FormationOptions(chosen, speedup, not no_avoidance, record, display, receiver=source)
        with FormationView(console) as many:
            state = _fly(many, fly_formation_demo(formation, many.start))
        print_formation_result(console, state)
    else:
        options = DemoOptions(
            scenario=chosen,
            speedup=speedup,
            avoidance=not no_avoidance,
            record=record,
            autopilot=autopilot or "ardupilot",
            receiver=source,
            display=display,
        )
        with DemoView(console) as view:
            state = _fly(view, fly_demo(options, view.start))
        print_result(console, state)
    if report is not None:
        report.write_text(json.dumps(state.report(), indent=2) + "\n", encoding="utf-8")
    if not state.passed:
        raise typer.Exit(1)


def _fly(view: DemoView | FormationView, flight: Coroutine[None, None, _State]) -> _State:
    """Run a demonstration, with the companion's own log lines in the view."""
    handler = _ViewHandler(view)
    logging.getLogger("companion").addHandler(handler)
    logging.getLogger("companion").setLevel(logging.INFO)
    try:
        return asyncio.run(_until_interrupted(flight))
    finally:
        logging.getLogger("companion").removeHandler(handler)


async def _until_interrupted(flight: Coroutine[None, None, _State]) -> _State:
    """Run the demonstration; Ctrl-C ends it as it ends the service, after releasing the aircraft."""
    running = asyncio.ensure_future(flight)
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, running.cancel)
    try:
        return await running
    except asyncio.CancelledError:
        raise CompanionError("interrupted") from None


class _ViewHandler(logging.Handler):
    """Shows the companion's own log lines in the view."""

    def __init__(self, view: DemoView | FormationView) -> None:
        super().__init__()
        self._view = view

    def emit(self, record: logging.LogRecord) -> None:
        self._view.add_text(record.getMessage())
