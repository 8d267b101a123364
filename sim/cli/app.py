"""The application that holds all commands, and its entry point."""

import sys

import typer

from companion.cli.common import VersionFlag, run_app, show_version
from sim.cli.bench import bench
from sim.cli.campaign import campaign, encounter
from sim.cli.demo import demo
from sim.cli.evidence import evidence
from sim.cli.flight_test import flight_test
from sim.cli.paper import paper
from sim.cli.receiver import receiver
from sim.cli.relay import relay
from sim.cli.vehicle import vehicle

app = typer.Typer(
    help="Simulated aircraft and traffic for Companion: demonstrations, experiments and campaigns.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command(epilog="Example: companion-sim demo --scenario head-on --speedup 4")(demo)
app.command(epilog="Example: companion-sim vehicle --link udpout:127.0.0.1:14550 --scenario head-on")(vehicle)
app.command(
    epilog="Example: companion-sim receiver --format gdl90 --link udpout:127.0.0.1:4000 --scenario head-on"
)(receiver)
app.command(
    "flight-test",
    epilog="Example: companion-sim flight-test --vehicle tcpout:127.0.0.1:5760 --set basic --set-parameters",
)(flight_test)
app.command(epilog="Example: companion-sim bench --report bench.json")(bench)
app.command(epilog="Example: companion-sim paper --out paper-results")(paper)
app.command(
    epilog="Example: companion-sim campaign --encounters 500 --avoider companion --avoider ardupilot"
)(campaign)
app.command(epilog="Example: companion-sim encounter 17 --seed 1 --out encounter-17.png")(encounter)
app.command(epilog="Example: companion-sim evidence --out evidence --encounters 10000")(evidence)
app.command(
    epilog="Example: companion-sim relay --listen udpin:0.0.0.0:14560 --to udpout:127.0.0.1:14550 --loss 0.1"
)(relay)


@app.callback(invoke_without_command=True)
def _root(version: VersionFlag = False) -> None:
    if version:
        show_version("companion-sim")


def main() -> None:
    """Entry point of `companion-sim`."""
    sys.exit(run_app(app))
