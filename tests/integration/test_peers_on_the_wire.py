"""Who is answered on a UDP link with more senders than places: always the autopilot."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from contextlib import ExitStack

import pytest

from companion.links import open_link
from companion.links.content import MAX_PEERS
from companion.links.udp import UdpInLink
from companion.mavlink.dialect import Encoder, mavlink
from tests.support.inbox import Inbox, frame

pytestmark = pytest.mark.wire

_COMMAND = frame(7)


def heartbeat(kind: int, autopilot: int, system: int, component: int) -> bytes:
    message = mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3)
    return Encoder().encode(message, system, component)


AUTOPILOT = heartbeat(mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, 1)
OTHERS = {
    "ground stations": heartbeat(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 255, 190),
    "receivers": heartbeat(mavlink.MAV_TYPE_ADSB, mavlink.MAV_AUTOPILOT_GENERIC, 1, 156),
    "vehicles": heartbeat(mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 9, 1),
}


def sender(stack: ExitStack, port: int) -> socket.socket:
    made = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    made.settimeout(3.0)
    made.connect(("127.0.0.1", port))
    return made


@contextlib.asynccontextmanager
async def listening() -> AsyncIterator[tuple[UdpInLink, Inbox, ExitStack]]:
    """A link that runs, what it receives, and the sockets of those that send to it."""
    link = open_link("udpin:127.0.0.1:0")
    assert isinstance(link, UdpInLink)
    await link.open()
    inbox = Inbox()
    running = asyncio.create_task(link.run(inbox))
    with ExitStack() as stack:
        yield link, inbox, stack
    link.close()
    await running


@pytest.mark.parametrize("others", OTHERS)
@pytest.mark.parametrize("last", [True, False], ids=["autopilot last", "autopilot first"])
async def test_the_autopilot_is_answered_among_many(others: str, last: bool) -> None:
    async with listening() as (link, inbox, stack):
        crowd = [sender(stack, link.local_port) for _ in range(2 * MAX_PEERS)]
        autopilot = sender(stack, link.local_port)
        messages = [(one, OTHERS[others]) for one in crowd]
        messages.insert(len(messages) if last else 0, (autopilot, AUTOPILOT))
        link.ours = (1, 1)
        for count, (one, message) in enumerate(messages, 1):
            one.send(message)
            await inbox.until(count)
        link.send(_COMMAND)
        assert await asyncio.to_thread(autopilot.recv, 300) == _COMMAND


async def test_a_source_port_that_changes_often_is_answered_at_its_newest() -> None:
    async with listening() as (link, inbox, stack):
        for count in range(1, 41):
            autopilot = sender(stack, link.local_port)
            autopilot.send(AUTOPILOT)
            await inbox.until(count)
            link.send(_COMMAND)
            assert await asyncio.to_thread(autopilot.recv, 300) == _COMMAND
