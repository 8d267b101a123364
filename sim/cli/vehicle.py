"""`companion-sim vehicle`: runs the fake vehicle on links, without the companion."""

import asyncio
import logging
import signal
import sys
import time
from typing import Annotated

import typer

from companion.cli.common import note_if_slow
from companion.errors import ConfigError, LinkError, ungrouped
from companion.links import open_link
from sim.cli.common import AutopilotOption, ScenarioOption, SpeedupOption
from sim.clock import ScaledClock
from sim.receiver_output import ReceiverOutput, named_output
from sim.receivers import FORMATS
from sim.scenario import DEFAULT_SCENARIO, load_scenario
from sim.server import VehicleServer
from sim.world import build_world


def vehicle(
    link: Annotated[
        list[str],
        typer.Option(
            metavar="ADDRESS",
            help="udpin, udpout, tcpin or tcpout:HOST:PORT, or serial:DEVICE:BAUD; may be repeated.",
        ),
    ],
    scenario: ScenarioOption = DEFAULT_SCENARIO,
    autopilot: AutopilotOption = "ardupilot",
    speedup: SpeedupOption = 1.0,
    receiver: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FORMAT:ADDRESS",
            help="A receiver on the aircraft, instead of the autopilot's: its format, of "
            f"{', '.join(FORMATS)}, and its link, as in gdl90:udpout:127.0.0.1:4000; may be repeated.",
        ),
    ] = None,
    no_adsb: Annotated[
        bool,
        typer.Option("--no-adsb", help="The autopilot receives no traffic, as companion-sim receiver does."),
    ] = False,
) -> None:
    """Simulate an aircraft and its traffic on MAVLink links, without Companion, until Ctrl-C."""
    chosen = load_scenario(scenario)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    try:
        links = [open_link(address) for address in link]
    except LinkError as error:
        raise ConfigError(f"--link {error}") from error
    try:
        outputs = [ReceiverOutput(*named_output(text)) for text in receiver or []]
    except LinkError as error:
        raise ConfigError(f"--receiver {error}") from error
    note_if_slow()
    start_s = float(int(time.time()))
    world = build_world(chosen, start_s, autopilot=autopilot)
    clock = ScaledClock(speedup, start_s=start_s)
    for output in outputs:
        output.switch_on(world.receiver_of(output.name))
    hears_traffic = not (no_adsb or outputs)
    server = VehicleServer(
        world.vehicle, links, clock, receiver=world.receiver if hears_traffic else None, beside=outputs
    )
    logging.getLogger("sim").info(
        "%s, system 1, on %s: %s", world.vehicle.name, ", ".join(link), chosen.description
    )
    asyncio.run(_serve(server))


async def _serve(server: VehicleServer) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, server.close)
    with ungrouped():
        await server.run()
