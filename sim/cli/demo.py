"""`companion-sim demo`: flies the demonstration and shows it on the terminal."""

import asyncio
import json
import logging
import signal
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.cli.common import note_if_slow, writable
from companion.errors import CompanionError
from companion.web.settings import Settings
from sim.cli.common import AutopilotOption, FormatName, ReportOption, ScenarioOption, SpeedupOption
from sim.demo import DemoOptions, DemoState, fly_demo
from sim.demo_view import DemoView, print_result
from sim.scenario import DEFAULT_SCENARIO, load_scenario


def demo(
    scenario: ScenarioOption = DEFAULT_SCENARIO,
    autopilot: AutopilotOption = "ardupilot",
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
    """Fly a simulated aircraft among traffic, with Companion, over sockets on this computer.

    Exit code 0 if the mission was finished without a near mid-air collision.
    """
    if report is not None:
        writable(report)
    options = DemoOptions(
        scenario=load_scenario(scenario),
        speedup=speedup,
        avoidance=not no_avoidance,
        record=record,
        autopilot=autopilot,
        receiver=None if receiver is None else str(receiver),
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
