"""Simulated receivers at their links: addresses, sockets, documents, and a vehicle of another process."""

import asyncio
import contextlib
import random
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from companion.address import is_of_receiver, parse_receiver_address
from companion.errors import LinkDownError, LinkError
from companion.links import Link, MemoryLink, ReceiverLink, memory_pair, open_link
from companion.sources.receiver import Piece
from companion.sources.registry import new_decoder
from sim.clock import ScaledClock
from sim.document_output import DocumentServer
from sim.follower import Follower
from sim.receiver_output import ReceiverOutput, heard_at, local_address, named_output, open_output
from sim.receivers import FORMATS
from sim.scenario import load_scenario
from sim.server import VehicleServer
from sim.world import World, build_world
from tests.support.faulty_flight import free_ports
from tests.support.virtual_time import in_virtual_time

SCENARIO = load_scenario("head-on")
START_S = 1_700_000_000.0
NOT_MAVLINK = [name for name, each in FORMATS.items() if each.sent_as != "mavlink"]


@pytest.mark.parametrize(
    ("name", "address", "heard"),
    [
        ("gdl90", "udpout:127.0.0.1:4000", "gdl90:udpin:127.0.0.1:4000"),
        ("sbs", "tcpin:0.0.0.0:30003", "sbs:tcpout:127.0.0.1:30003"),
        ("beast", "tcpout:10.0.0.2:30005", "beast:tcpin:10.0.0.2:30005"),
        ("flarm", "serial:/dev/ttyUSB0", "flarm:serial:/dev/NAME:57600"),
        ("flarm", "tcpin:[::]:2000", "flarm:tcpout:127.0.0.1:2000"),
        ("readsb", "http://127.0.0.1:8080/data/aircraft.json", "readsb:http://127.0.0.1:8080/data/aircraft.json"),
        ("readsb", "file:/run/readsb/aircraft.json", "readsb:file:/run/readsb/aircraft.json"),
        ("mavlink", "udpout:127.0.0.1:14550", "udpin:127.0.0.1:14550"),
        ("remoteid", "udpin:127.0.0.1:14551", "udpout:127.0.0.1:14551"),
    ],
)  # fmt: skip
def test_companion_hears_at_the_other_end(name: str, address: str, heard: str) -> None:
    assert heard_at(name, address) == heard
    if is_of_receiver(heard):
        parse_receiver_address(heard)
    else:
        open_link(heard)


@pytest.mark.parametrize("name", FORMATS)
def test_the_usual_address_of_a_format_can_be_opened_and_heard(name: str) -> None:
    address = local_address(name, 4000)
    open_output(name, address)
    assert is_of_receiver(heard_at(name, address)) == (name in NOT_MAVLINK)


@pytest.mark.parametrize(
    ("name", "address", "words"),
    [
        ("gdl90", "udpin:0.0.0.0:4000", "a receiver sends: use udpout, tcpin or tcpout"),
        ("sbs", "tcpin:0.0.0.0:30003?listen", "a receiver sends"),
        ("sbs", "gdl90:udpout:127.0.0.1:4000", "a MAVLink link is needed here"),
        ("readsb", "tcpin:127.0.0.1:30003", "readsb is a document"),
        ("readsb", "https://127.0.0.1/a.json", "only http can be served here"),
    ],
)
def test_a_wrong_address_says_what_to_use(name: str, address: str, words: str) -> None:
    with pytest.raises(LinkError, match=words):
        open_output(name, address)


@pytest.mark.parametrize(
    "text", ["gdl90", "gdl90:", "asterix:udpout:127.0.0.1:8600", "udpout:127.0.0.1:4000"]
)
def test_a_receiver_without_format_or_address_is_refused(text: str) -> None:
    with pytest.raises(LinkError, match="use FORMAT:ADDRESS, with one of gdl90"):
        named_output(text)


def test_a_format_and_its_address() -> None:
    assert named_output("gdl90:udpout:127.0.0.1:4000") == ("gdl90", "udpout:127.0.0.1:4000")


@contextlib.asynccontextmanager
async def running(link: Link) -> AsyncIterator[None]:
    task = asyncio.create_task(link.run(lambda _frames, _link: None))
    try:
        await link.open()
        yield
    finally:
        link.close()
        await task


def answer(url: str, method: str = "GET") -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, method=method), timeout=10.0) as got:
            return got.status, got.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, b""


@pytest.mark.wire
async def test_a_document_is_served_at_its_path_when_there_is_one() -> None:
    (port,) = free_ports(1)
    url = f"http://127.0.0.1:{port}/data/aircraft.json"
    link = open_output("readsb", url)
    async with running(link):
        assert await asyncio.to_thread(answer, url) == (503, b"")
        link.send(b"one")
        link.send(b"two")
        assert await asyncio.to_thread(answer, url) == (200, b"two")
        assert await asyncio.to_thread(answer, f"{url}?_=17") == (200, b"two")
        assert await asyncio.to_thread(answer, url, "HEAD") == (200, b"")
        assert (await asyncio.to_thread(answer, f"http://127.0.0.1:{port}/"))[0] == 404
        assert (await asyncio.to_thread(answer, url, "DELETE"))[0] == 405
    assert link.counters.sent_frames == 2


@pytest.mark.wire
async def test_a_server_survives_what_is_no_request_and_refuses_a_port_in_use() -> None:
    (port,) = free_ports(1)
    url = f"http://127.0.0.1:{port}/a.json"
    link = open_output("readsb", url)
    async with running(link):
        for junk in (b"", b"\0" * 20_000, b"GET\r\n\r\n"):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(junk)
            writer.write_eof()
            with contextlib.suppress(OSError):
                await reader.read()
            writer.close()
        link.send(b"[]")
        assert await asyncio.to_thread(answer, url) == (200, b"[]")
        with pytest.raises(LinkError, match="in use"):
            await DocumentServer("readsb", url).open()


def test_a_document_in_a_file_is_replaced_whole(tmp_path: Path) -> None:
    path = tmp_path / "aircraft.json"
    link = open_output("readsb", f"file:{path}")
    link.send(b"one")
    link.send(b"two")
    assert path.read_bytes() == b"two"
    assert list(tmp_path.iterdir()) == [path]
    assert link.counters.sent_frames == 2
    gone = tmp_path / "gone"
    gone.mkdir()
    link = open_output("readsb", f"file:{gone}/aircraft.json")
    gone.rmdir()
    link.send(b"three")
    assert link.counters.send_errors == 1
    with pytest.raises(LinkDownError, match="no folder"):
        asyncio.run(open_output("readsb", f"file:{gone}/aircraft.json").open())


@pytest.mark.wire
@pytest.mark.parametrize("name", NOT_MAVLINK)
async def test_companion_hears_a_vehicles_receiver_over_its_sockets(name: str) -> None:
    (port,) = free_ports(1)
    output = ReceiverOutput(name, local_address(name, port))
    world = build_world(SCENARIO, START_S)
    output.switch_on(world.receiver_of(name))
    clock = ScaledClock(10.0, start_s=START_S)
    server = VehicleServer(world.vehicle, [], clock, beside=[output])
    heard: list[Piece] = []
    text = heard_at(name, output.link.address)
    link = ReceiverLink(text, parse_receiver_address(text), document_period_s=0.05)
    flying = asyncio.create_task(server.run())
    hearing = asyncio.create_task(link.run(lambda _, piece: heard.append(piece)))
    try:
        await until(lambda: len(heard) >= 5)
    finally:
        server.close()
        link.link.close()
        await asyncio.gather(flying, hearing)
    for piece in heard:
        link.receiver.take(piece, START_S)
    assert link.receiver.counters.messages >= 5
    assert not link.receiver.counters.bad


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(60.0):
        while not condition():  # noqa: ASYNC110 - a simulated receiver sets no events
            await asyncio.sleep(0.01)


class Kept(MemoryLink):
    """A link whose other end is not read; `sent` are the datagrams with the time they were sent."""

    def __init__(self) -> None:
        super().__init__("memory:kept", random.Random(0), 0.0, 0.0, 0.0)
        self.sent: list[tuple[float, bytes]] = []

    def _send(self, data: bytes) -> None:
        self.sent.append((asyncio.get_running_loop().time(), data))


@contextlib.asynccontextmanager
async def followed(
    name: str, flown_s: float, speedup: float = 1.0
) -> AsyncIterator[tuple[VehicleServer, Kept, list[float]]]:
    """A receiver that follows a vehicle in flight, and the starts of the worlds that it built."""
    near, far = memory_pair()
    world = build_world(SCENARIO, START_S)
    world.vehicle.step(START_S + flown_s)
    clock = ScaledClock(speedup, start_s=START_S + flown_s, monotonic_s=asyncio.get_running_loop().time)
    server = VehicleServer(world.vehicle, [near], clock, stream_rate_hz=0.0)
    built: list[float] = []
    output = ReceiverOutput(name, local_address(name, 4000))
    output.link = kept = Kept()

    def build(start_s: float) -> World:
        built.append(start_s)
        return build_world(SCENARIO, start_s)

    follower = Follower(far, [output], build, lambda: 5_000.0)
    tasks = [asyncio.create_task(server.run()), asyncio.create_task(follower.run())]
    try:
        yield server, kept, built
    finally:
        follower.close()
        server.close()
        await asyncio.gather(*tasks)


@in_virtual_time
async def test_a_receiver_follows_the_clock_and_the_place_of_a_vehicle_in_flight() -> None:
    async with followed("flarm", 70.0) as (_, kept, built):
        await asyncio.sleep(5.0)
    assert built == [pytest.approx(5_000.0 - 70.0, abs=2.0)]
    decoder = new_decoder("flarm")
    reports = [fact.report for _, data in kept.sent for fact in decoder.feed(data, 0.0)]
    ahead = [report.relative_m for report in reports if report.relative_m is not None]
    assert len(ahead) >= 4
    # They meet at 100 s; the aircraft comes head-on at 60 m/s, and we fly at about 22 m/s.
    assert ahead[0][0] == pytest.approx(82.0 * 29.0, rel=0.1)
    assert abs(ahead[0][1]) < 60.0
    assert abs(ahead[0][2]) < 30.0


@in_virtual_time
async def test_it_follows_a_vehicle_that_flies_faster_than_real_time() -> None:
    async with followed("readsb", 0.0, speedup=10.0) as (_, kept, built):
        await asyncio.sleep(3.0)
    assert len(built) == 1
    assert len(kept.sent) >= 25, "a document for each simulated second"


@in_virtual_time
async def test_the_scenario_starts_again_with_the_vehicles_clock() -> None:
    async with followed("sbs", 40.0) as (server, _, built):
        await asyncio.sleep(2.0)
        server._vehicle.reboot(server._vehicle.time_s)
        await asyncio.sleep(3.0)
    assert len(built) == 2
