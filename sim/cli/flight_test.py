"""`companion-sim flight-test`: flies an autopilot through scripted encounters and judges Companion."""

import asyncio
import json
import logging
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from companion.address import parse_address
from companion.cli.common import writable
from companion.errors import ConfigError, LinkError, require
from companion.geodesy import GeoPoint
from companion.signals import handled
from sim.cli.common import AutopilotOption, ReportOption
from sim.clock import ScaledClock
from sim.flight_test.flight import Flight, Options
from sim.flight_test.plan import load_set, set_names
from sim.flight_test.report import comparison_of, lines_of, load_report, report_of, table_of
from sim.flight_test.result import Result
from sim.flight_test.view import FlightView
from sim.scenario import Autopilot
from sim.vehicle import FakePx4, FakeVehicle
from sim.world import kind_of

_HOME = GeoPoint(-35.363262, 149.165237, 584.0)
_PX4_PARAMETERS = {"FW_AIRSPD_TRIM": 15.0}


def flight_test(
    vehicle: Annotated[
        str,
        typer.Option(
            metavar="LINK|fake", help="The autopilot's link, such as tcpout:127.0.0.1:5760; or fake."
        ),
    ],
    flown: Annotated[
        str,
        typer.Option("--set", metavar="NAME|FILE", help=f"One of {', '.join(set_names())}, or a YAML file."),
    ] = "basic",
    autopilot: AutopilotOption = "ardupilot",
    companion: Annotated[
        str | None,
        typer.Option(
            metavar="CONFIG|external",
            help="Companion's configuration (its links are replaced), or external: it is already there.",
        ),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this encounter; may be repeated.")
    ] = None,
    speedup: Annotated[
        float | None,
        typer.Option(min=0.1, max=50.0, help="The vehicle's time against ours; Companion then runs inside."),
    ] = None,
    set_parameters: Annotated[
        bool,
        typer.Option("--set-parameters", help="Set the parameters that the test needs; restored afterwards."),
    ] = False,
    real_aircraft: Annotated[
        bool, typer.Option("--real-aircraft", help="Fly it even if nothing shows that it is a simulation.")
    ] = False,
    simulated_flag: Annotated[
        bool, typer.Option("--simulated-flag", help="Mark the reported traffic as simulated.")
    ] = False,
    seed: Annotated[int, typer.Option(help="For noise and losses.")] = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for log, recording and page.")] = Path(
        "flight-test"
    ),
    report: ReportOption = None,
    compare: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Show an earlier report beside this one.")
    ] = None,
) -> None:
    """Fly an autopilot at a link through scripted encounters, with Companion beside it, and judge.

    Simulated autopilots of ArduPilot and PX4, hardware in the loop, or the bundled fake. The ground station
    is MAVSDK. Exit code 0 if all encounters came out as expected.
    """
    for package in ("mavsdk", "matplotlib"):
        require(package, "companion-sim flight-test", "sim")
    from sim.flight_test.page import page

    test = load_set(flown)
    unknown = set(only or ()) - {encounter.name for encounter in test.encounters}
    if unknown:
        names = ", ".join(encounter.name for encounter in test.encounters)
        raise ConfigError(f"--only {sorted(unknown)[0]}: no such encounter; there are: {names}")
    other = None if compare is None else load_report(compare)
    if report is not None:
        writable(report)
    flies, clock = _vehicle(vehicle, autopilot, speedup)
    folder = _folder(out)
    options = Options(
        test=test,
        vehicle=flies,
        folder=folder,
        clock=clock,
        inside=speedup is not None,
        companion=companion,
        set_parameters=set_parameters or vehicle == "fake",
        real_aircraft=real_aircraft,
        simulated_flag=simulated_flag,
        only=tuple(only or ()),
        seed=seed,
    )
    console = Console(highlight=False)
    logging.getLogger("companion").setLevel(logging.CRITICAL)  # events show its texts
    with FlightView(console) as view:
        flight = Flight(options, view.add_line)
        view.show(flight)
        result = asyncio.run(_until_interrupted(flight))
    figures = report_of(result)
    console.print(table_of(figures))
    if other is not None:
        console.print(comparison_of(figures, other))
    for line in lines_of(figures):
        console.print(line, soft_wrap=True)
    (folder / "flight.html").write_text(page(result, figures), encoding="utf-8")
    (folder / "report.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    console.print(f"Recorded, with a page of figures: {folder}", soft_wrap=True)
    if report is not None:
        report.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    if not result.passed:
        raise typer.Exit(1)


def _vehicle(
    vehicle: str, autopilot: Autopilot, speedup: float | None
) -> tuple[str | FakeVehicle, ScaledClock | None]:
    """The vehicle, and the clock that Companion shares with it; `None`: real time."""
    start_s = float(int(time.time()))
    if vehicle != "fake":
        try:
            parse_address(vehicle)
        except LinkError as error:
            raise ConfigError(f"--vehicle {error}") from error
        return vehicle, None if speedup is None else ScaledClock(speedup, start_s=start_s)
    clock = ScaledClock(speedup or 1.0, start_s=start_s)
    kind, options = kind_of(autopilot)
    parameters = _PX4_PARAMETERS if kind is FakePx4 else {}
    return kind(_HOME, start_s, parameters=parameters, **options), clock


def _folder(out: Path) -> Path:
    """A new folder for this flight inside `out`."""
    folder = out / time.strftime("%Y%m%d-%H%M%S")
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise ConfigError(f"--out {folder}: {error.strerror}") from error
    return folder


async def _until_interrupted(flight: Flight) -> Result:
    """Run the flight; the first signal that would end the program ends it in order, others are ignored."""
    running = asyncio.ensure_future(flight.run())
    interrupted = False

    def stop() -> None:
        nonlocal interrupted
        if not interrupted:
            interrupted = True
            running.cancel()

    with handled(stop):
        return await running
