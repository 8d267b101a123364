"""The application that holds all commands, and its entry point."""

import sys

import typer

from companion.cli.check import check
from companion.cli.common import VersionFlag, run_app, show_version
from companion.cli.replay import replay
from companion.cli.report import report
from companion.cli.run import run

app = typer.Typer(
    help="Collision-avoidance companion for fixed-wing MAVLink autopilots.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command(epilog="Example: companion run configs/arduplane.yaml")(run)
app.command(epilog="Example: companion check configs/arduplane.yaml --link")(check)
app.command(epilog="Example: companion replay flight.tlog --report replay.json")(replay)
app.command(epilog="Example: companion report companion-20260101-120000.mcap --out report.html")(report)


@app.callback(invoke_without_command=True)
def _root(version: VersionFlag = False) -> None:
    if version:
        show_version("companion")


def main() -> None:
    """Entry point of `companion`."""
    sys.exit(run_app(app))
