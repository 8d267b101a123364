"""The relay between real sockets: both ways, several sources, cuts, and the command."""

import asyncio
import contextlib
import signal
import socket
import sys
import time
from collections.abc import AsyncIterator

import pytest

from companion.errors import LinkError
from companion.links import Link, OnFrames, open_link
from companion.links.udp import UdpInLink
from sim.faults import Faults
from sim.relay import MAX_SOURCES, Relay
from tests.support.faulty_flight import free_ports
from tests.support.inbox import Inbox, frame, until

pytestmark = pytest.mark.wire


@contextlib.asynccontextmanager
async def running(link: Link, on_frames: OnFrames) -> AsyncIterator[None]:
    await link.open()
    task = asyncio.create_task(link.run(on_frames))
    try:
        yield
    finally:
        link.close()
        await task


class Ends:
    """A companion that listens, a relay, and a vehicle that talks to it."""

    def __init__(self, companion: UdpInLink, relay: Relay, vehicle: Link) -> None:
        self.companion = companion
        self.relay = relay
        self.vehicle = vehicle
        self.at_companion = Inbox()
        self.at_vehicle = Inbox()


@contextlib.asynccontextmanager
async def ends(forth: Faults | None = None, back: Faults | None = None) -> AsyncIterator[Ends]:
    companion = open_link("udpin:127.0.0.1:0")
    assert isinstance(companion, UdpInLink)
    await companion.open()
    to = f"udpout:127.0.0.1:{companion.local_port}"
    relay = Relay("udpin:127.0.0.1:0", to, forth=forth, back=back, seed=1)
    await relay.open()
    vehicle = open_link(f"udpout:127.0.0.1:{relay.local_port}")
    both = Ends(companion, relay, vehicle)
    async with running(companion, both.at_companion), running(vehicle, both.at_vehicle):
        with contextlib.closing(relay):
            yield both


async def test_both_ways_between_the_ends() -> None:
    async with ends() as both:
        question, answer = frame(1), frame(2)
        both.vehicle.send(question)
        await both.at_companion.until(1)
        both.companion.send(answer)
        await both.at_vehicle.until(1)
        assert (both.at_companion.raws, both.at_vehicle.raws) == ([question], [answer])
        assert both.relay.forth.counters.delivered == both.relay.back.counters.delivered == 1


async def test_each_direction_has_its_own_faults() -> None:
    async with ends(forth=Faults(duplication=1.0), back=Faults(loss=1.0)) as both:
        both.vehicle.send(frame(1))
        await both.at_companion.until(2)
        both.companion.send(frame(2))
        await until(lambda: both.relay.back.counters.lost == 1)
        assert both.at_vehicle.raws == []


async def test_delayed_datagrams_come_later_and_in_another_order() -> None:
    async with ends(forth=Faults(delay_s=0.05, jitter_s=0.1)) as both:
        sent, began_s = [frame(number) for number in range(40)], time.monotonic()
        for raw in sent:
            both.vehicle.send(raw)
        await both.at_companion.until(1)
        assert time.monotonic() - began_s >= 0.05
        await both.at_companion.until(40)
        assert both.at_companion.raws != sent
        assert sorted(both.at_companion.raws) == sorted(sent)


async def test_cut_and_mended() -> None:
    async with ends() as both:
        both.relay.cut()
        both.vehicle.send(frame(1))
        await until(lambda: both.relay.forth.counters.cut == 1)
        both.relay.mend()
        second = frame(2)
        both.vehicle.send(second)
        await both.at_companion.until(1)
        assert both.at_companion.raws == [second]


async def test_answers_return_to_their_source() -> None:
    async with ends() as both:
        other, at_other = open_link(both.vehicle.address), Inbox()
        async with running(other, at_other):
            both.vehicle.send(frame(1))
            other.send(frame(2))
            await both.at_companion.until(2)
            assert len(both.companion.peers.present()) == 2, "two sources for the companion"
            answer = frame(3)
            both.companion.send(answer)
            await both.at_vehicle.until(1)
            await at_other.until(1)
            assert both.at_vehicle.raws == at_other.raws == [answer]


async def test_many_sources_come_and_go() -> None:
    async with ends() as both:
        for number in range(MAX_SOURCES + 10):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as passer_by:
                passer_by.sendto(frame(), ("127.0.0.1", both.relay.local_port))
            await both.at_companion.until(number + 1)
        assert len(both.relay._sources) == MAX_SOURCES
        both.vehicle.send(frame())
        await both.at_companion.until(MAX_SOURCES + 11)


async def test_a_missing_end_is_counted() -> None:
    async with ends() as both:
        both.companion.close()
        for _ in range(1000):
            both.vehicle.send(frame())
            if both.relay.send_errors:
                break
            await asyncio.sleep(0.002)
        assert both.relay.send_errors


@pytest.mark.parametrize(
    ("listen", "to"),
    [
        ("udpout:127.0.0.1:1", "udpout:127.0.0.1:1"),
        ("udpin:127.0.0.1:0", "udpin:127.0.0.1:1"),
        ("udpin:127.0.0.1:0?listen", "udpout:127.0.0.1:1"),
        ("udpin:127.0.0.1:0", "tcpout:127.0.0.1:1"),
        ("serial:/dev/ttyACM0", "udpout:127.0.0.1:1"),
        ("pigeon", "udpout:127.0.0.1:1"),
    ],
)
def test_other_addresses_are_refused(listen: str, to: str) -> None:
    with pytest.raises(LinkError):
        Relay(listen, to)


async def test_a_port_in_use_is_named() -> None:
    async with ends() as both:
        listen = f"udpin:127.0.0.1:{both.relay.local_port}"
        with pytest.raises(LinkError, match=f"^{listen}: .*in use"):
            await Relay(listen, "udpout:127.0.0.1:1").open()


async def test_the_command_relays_until_sigterm() -> None:
    companion = open_link("udpin:127.0.0.1:0")
    assert isinstance(companion, UdpInLink)
    heard = Inbox()
    async with running(companion, heard):
        (port,) = free_ports(1)
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", "from sim.cli import main; main()", "relay",
            "--listen", f"udpin:127.0.0.1:{port}", "--to", f"udpout:127.0.0.1:{companion.local_port}",
            "--delay", "0.01", "--direction", "forth", stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip
        async with running(vehicle := open_link(f"udpout:127.0.0.1:{port}"), Inbox()):
            async with asyncio.timeout(30.0):
                while not heard.raws:
                    vehicle.send(frame())
                    await asyncio.sleep(0.05)
            process.send_signal(signal.SIGTERM)
            shown, _ = await asyncio.wait_for(process.communicate(), 10.0)
    assert process.returncode == 0
    assert b"forth: " in shown
    assert b" 0 lost" in shown
