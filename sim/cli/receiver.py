"""`companion-sim receiver`: sends the traffic of a scenario as a receiver of traffic does."""

import asyncio
import logging
import signal
import sys
import time
from typing import Annotated

import typer

from companion.errors import ConfigError, LinkError, ungrouped
from companion.links import open_link
from sim.cli.common import AutopilotOption, FormatName, ScenarioOption, SpeedupOption
from sim.clock import ScaledClock
from sim.follower import Follower
from sim.receiver_output import ReceiverOutput, heard_at
from sim.scenario import DEFAULT_SCENARIO, Autopilot, Scenario, load_scenario
from sim.server import VehicleServer
from sim.world import build_world

_log = logging.getLogger("sim")


def receiver(
    format_: Annotated[FormatName, typer.Option("--format", help="What the receiver sends.")],
    link: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Where it sends to: udpout or tcpout:HOST:PORT, tcpin:HOST:PORT to serve clients, or "
            "serial:DEVICE:BAUD. For readsb the URL http://HOST:PORT/PATH that it serves, or file:/PATH.",
        ),
    ],
    scenario: ScenarioOption = DEFAULT_SCENARIO,
    vehicle: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="MAVLink link to companion-sim vehicle with the same scenario and --no-adsb: the receiver "
            "is on that aircraft. Without it, on one of its own that flies the mission.",
        ),
    ] = None,
    autopilot: AutopilotOption = "ardupilot",
    speedup: SpeedupOption = 1.0,
) -> None:
    """Simulate a receiver of traffic, in one of its formats, until Ctrl-C.

    The errors of the receiver are those of the scenario. FLARM reaches 5 km, Remote ID 1 km.
    """
    chosen = load_scenario(scenario)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    name = str(format_)
    try:
        output = ReceiverOutput(name, link)
    except LinkError as error:
        raise ConfigError(f"--link {error}") from error
    runner = (
        _alone(chosen, autopilot, speedup, output)
        if vehicle is None
        else _beside(vehicle, chosen, autopilot, output)
    )
    _log.info("%s on %s; a link of Companion that hears it: %s", name, link, heard_at(name, link))
    asyncio.run(_run(runner))


def _alone(scenario: Scenario, autopilot: Autopilot, speedup: float, output: ReceiverOutput) -> VehicleServer:
    """The receiver on a vehicle of its own, which has no links."""
    start_s = float(int(time.time()))
    world = build_world(scenario, start_s, autopilot=autopilot)
    output.switch_on(world.receiver_of(output.name))
    return VehicleServer(world.vehicle, [], ScaledClock(speedup, start_s=start_s), beside=[output])


def _beside(vehicle: str, scenario: Scenario, autopilot: Autopilot, output: ReceiverOutput) -> Follower:
    try:
        link = open_link(vehicle)
    except LinkError as error:
        raise ConfigError(f"--vehicle {error}") from error
    return Follower(link, [output], lambda start_s: build_world(scenario, start_s, autopilot=autopilot))


async def _run(runner: VehicleServer | Follower) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, runner.close)
    with ungrouped():
        await runner.run()
