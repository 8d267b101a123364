"""`companion-sim relay`: forwards datagrams between two ends, with faults."""

import asyncio
import contextlib
import signal
from dataclasses import asdict
from enum import StrEnum
from typing import Annotated

import typer

from companion.errors import ConfigError, LinkError
from sim.faults import Faults
from sim.relay import Relay


class Direction(StrEnum):
    """The direction of `relay`'s faults: away from the listening side, back to it, or both."""

    FORTH = "forth"
    BACK = "back"
    BOTH = "both"


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
