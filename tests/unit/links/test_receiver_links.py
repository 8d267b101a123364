"""Receivers at the links of their addresses: real sockets, a serial port, HTTP and files."""

import asyncio
import contextlib
import os
import socket
import tty
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from companion.address import DocumentAddress, parse_receiver_address
from companion.errors import LinkDownError
from companion.links import Link, ReceiverLink
from companion.links.content import Content
from companion.links.document import DocumentLink
from companion.links.receiver_link import conditions_of
from companion.mavlink.framing import Frame
from companion.sources.receiver import INTERNAL_ERROR, Piece, Receiver
from tests.support.line_decoder import LineDecoder, line_formats, traffic_line

A, B = traffic_line(0xA00001, 48.0, 11.0), traffic_line(0xA00002, 48.1, 11.1)


@pytest.fixture(autouse=True)
def _lines() -> Iterator[None]:
    with line_formats():
        yield


class Listener:
    """Decodes what a receiver sends, by a clock that the test sets."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.pieces: list[Piece] = []
        self.keys: list[str] = []
        self._changed = asyncio.Event()

    def take(self, receiver: Receiver, piece: Piece) -> None:
        self.pieces.append(piece)
        self.keys += [fact.report.key for fact in receiver.take(piece, self.now_s)]
        self._changed.set()

    async def until(self, done: Callable[[], bool]) -> None:
        async with asyncio.timeout(10.0):
            while not done():
                self._changed.clear()
                await self._changed.wait()


def receiver_at(text: str) -> ReceiverLink:
    return ReceiverLink(text, parse_receiver_address(text))


@contextlib.asynccontextmanager
async def running(one: ReceiverLink) -> AsyncIterator[Listener]:
    heard = Listener()
    task = asyncio.create_task(one.run(heard.take))
    try:
        yield heard
    finally:
        one.link.close()
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


def local_port(link: Link) -> int:
    port: int = link.local_port  # type: ignore[attr-defined]
    return port


async def test_udp_whoever_sends_and_nothing_is_sent_back() -> None:
    one = receiver_at("gdl90:udpin:127.0.0.1:0")
    await one.link.open()
    async with running(one) as heard:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
            station.bind(("127.0.0.1", 0))
            station.sendto(A[:10], ("127.0.0.1", local_port(one.link)))
            station.sendto(A[10:] + B, ("127.0.0.1", local_port(one.link)))
            await heard.until(lambda: len(heard.keys) == 2)
            one.link.send(b"something")
            station.setblocking(False)
            with pytest.raises(BlockingIOError):
                station.recv(100)
        assert heard.keys == ["A00001", "A00002"]
        assert one.receiver.counters.messages == one.receiver.aircraft(heard.now_s) == 2
        assert one.receiver.aircraft(heard.now_s + 61.0) == 0


async def test_the_receiver_is_named_in_its_reports() -> None:
    receiver = Receiver.of("gdl90:udpin:0.0.0.0:4000", "gdl90")
    (fact,) = receiver.take(Piece(receiver.address, A), 100.0)
    assert fact.report.heard_by == "gdl90:udpin:0.0.0.0:4000"


async def test_tcp_is_connected_again_and_the_rest_of_a_stream_forgotten() -> None:
    connected: asyncio.Queue[asyncio.StreamWriter] = asyncio.Queue()
    server = await asyncio.start_server(lambda _r, writer: connected.put_nowait(writer), "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    async with server, running(receiver_at(f"gdl90:tcp:127.0.0.1:{port}")) as heard:
        first = await connected.get()
        first.write(A + B[:20])
        await first.drain()
        await heard.until(lambda: heard.keys == ["A00001"])
        first.close()
        async with asyncio.timeout(10.0):
            second = await connected.get()
        second.write(B + A[:5])
        await heard.until(lambda: len(heard.keys) == 2)
        assert heard.keys == ["A00001", "A00002"], "not the rest of the first connection before the second"
        assert [piece.begins for piece in heard.pieces] == [True, True]
        second.close()


async def test_the_newest_client_of_a_listening_link_is_the_receiver() -> None:
    one = receiver_at("gdl90:tcpin:127.0.0.1:0")
    await one.link.open()
    async with running(one) as heard:
        _, first = await asyncio.open_connection("127.0.0.1", local_port(one.link))
        first.write(A[:7])
        await heard.until(lambda: len(heard.pieces) == 1)
        reader, second = await asyncio.open_connection("127.0.0.1", local_port(one.link))
        second.write(B)
        await heard.until(lambda: heard.keys == ["A00002"])
        assert one.link.clients == 1  # type: ignore[attr-defined]
        first.close()
        second.close()
        assert await reader.read(100) == b"", "it is never talked to"


async def test_serial(tmp_path: Path) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    device = tmp_path / "ttyUSB0"
    device.symlink_to(os.ttyname(slave))
    one = receiver_at(f"gdl90:serial:{device}:57600")
    await one.link.open()
    async with running(one) as heard:
        os.write(master, A)
        await heard.until(lambda: heard.keys == ["A00001"])
    os.close(slave)
    os.close(master)


async def test_a_flood_is_dropped_and_counted_and_the_loop_goes_on() -> None:
    one = receiver_at("gdl90:udpin:127.0.0.1:0")
    one.link.arrived("station", A * 20_000)  # type: ignore[attr-defined]
    assert one.link.counters.dropped == 1, "all of it that found no place"
    turns = 0

    async def others() -> None:
        nonlocal turns
        while True:
            turns += 1
            await asyncio.sleep(0)

    task = asyncio.create_task(others())
    async with running(one) as heard:
        await heard.until(lambda: len(heard.pieces) == 128)
    task.cancel()
    assert turns > 50, "others had a turn every two pieces"
    assert max(len(piece.data) for piece in heard.pieces) <= 1024


def test_a_decoder_that_raises_is_counted_and_dropped(caplog: pytest.LogCaptureFixture) -> None:
    receiver = Receiver.of("gdl90:udpin:0.0.0.0:4000", "gdl90")
    for _ in range(3):
        assert receiver.take(Piece(receiver.address, b"!\n"), 1.0) == []
    assert receiver.counters.bad == {INTERNAL_ERROR: 3}
    assert len(caplog.records) == 1
    assert receiver.take(Piece(receiver.address, A), 2.0) != []


def texts_of(receivers: list[ReceiverLink], now_s: float) -> list[str]:
    return [each.text for each in conditions_of(receivers, now_s)]


async def test_silence_problems_and_recovery_are_conditions() -> None:
    one, other = receiver_at("gdl90:udpin:127.0.0.1:0"), receiver_at("readsb:file:/x")
    assert texts_of([one, other], 0.0) == []
    assert texts_of([one], 10.0) == ["Avoidance: gdl90 receiver: silent for 10 s"]
    one.receiver.take(Piece("", b"H\n"), 12.0)
    assert texts_of([one], 21.9) == []
    one.receiver.take(Piece("", b"junk\n"), 21.9)
    (condition,) = conditions_of([one], 22.0)
    assert condition.text == "Avoidance: gdl90 receiver: not understood for 10 s"
    assert condition.ended == "Avoidance: gdl90 receiver works again"
    assert condition.matters, "it is repeated"
    one.receiver.take(Piece("", b"S,no GPS fix\n"), 23.0)
    assert texts_of([one], 23.0) == ["Avoidance: gdl90 receiver: no GPS fix"]
    one.receiver.take(Piece("", b"S,\n"), 24.0)
    assert texts_of([one], 24.0) == []


async def test_two_receivers_of_a_format_are_told_apart() -> None:
    texts = ["gdl90:udpin:127.0.0.1:0", "gdl90:tcp:127.0.0.1:4000"]
    receivers = [receiver_at(text) for text in texts]
    assert texts_of(receivers, 0.0) == []
    assert texts_of(receivers, 10.0) == [f"Avoidance: {text}: silent for 10 s" for text in texts]


class WebServer:
    """Answers each request with the next of `answers`, the last one for ever."""

    def __init__(self, *answers: bytes) -> None:
        self.answers = list(answers)
        self.requests = 0

    async def answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        self.requests += 1
        writer.write(self.answers.pop(0) if len(self.answers) > 1 else self.answers[0])
        with contextlib.suppress(OSError):
            await writer.drain()
        writer.close()


def ok(body: bytes, length: int | None = None) -> bytes:
    return b"HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (
        len(body) if length is None else length,
        body,
    )


@contextlib.asynccontextmanager
async def serving(*answers: bytes) -> AsyncIterator[tuple[WebServer, str]]:
    web = WebServer(*answers)
    server = await asyncio.start_server(web.answer, "127.0.0.1", 0)
    async with server:
        yield web, f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/data/aircraft.json"


class Collector:
    """A reader that keeps what it is given."""

    def __init__(self) -> None:
        self.documents: list[bytes] = []
        self.content = Content(lambda _counters: self)

    def feed(self, data: bytes) -> list[Frame]:
        self.documents.append(data)
        return []

    def feed_datagram(self, data: bytes) -> list[Frame]:
        raise NotImplementedError


async def polled(where: DocumentAddress, until: Callable[[], bool], documents: Collector) -> None:
    link = DocumentLink("readsb:test", where, replace(documents.content, document_period_s=0.01))
    task = asyncio.create_task(link.run(lambda _frames, _link: None))
    async with asyncio.timeout(10.0):
        while not until() and not task.done():  # noqa: ASYNC110 - no event is set
            await asyncio.sleep(0.005)
    link.close()
    await task


async def test_a_link_that_is_closed_when_the_next_reading_is_due_ends(tmp_path: Path) -> None:
    path = tmp_path / "aircraft.json"
    path.write_bytes(b"{}")
    ended = Content(lambda _counters: Closing(), document_period_s=0.0)
    link = DocumentLink("readsb:test", DocumentAddress(None, str(path)), ended)

    class Closing(Collector):
        def feed(self, data: bytes) -> list[Frame]:
            link.close()
            return super().feed(data)

    await asyncio.wait_for(link.run(lambda _frames, _link: None), 10.0)


async def test_a_document_that_did_not_change_gives_nothing() -> None:
    documents = Collector()
    async with serving(ok(b"one"), ok(b"one"), ok(b"two"), ok(b"two")) as (web, url):
        await polled(DocumentAddress(url, None), lambda: web.requests >= 6, documents)
    assert documents.documents == [b"one", b"two"]


async def test_a_file_is_read_each_time_it_is_replaced(tmp_path: Path) -> None:
    path, documents = tmp_path / "aircraft.json", Collector()
    path.write_bytes(b"one")

    def replaced() -> bool:
        if documents.documents == [b"one"]:
            path.write_bytes(b"two")
        return len(documents.documents) == 2

    await polled(DocumentAddress(None, str(path)), replaced, documents)
    assert documents.documents == [b"one", b"two"]


REDIRECT = b"HTTP/1.1 302 Found\r\nLocation: %s\r\nContent-Length: 0\r\n\r\n"


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", "the server answers 404"),
        (b"HTTP/1.1 500 Oh\r\n\r\n", "the server answers 500"),
        (b"SSH-2.0-OpenSSH\r\n", "no HTTP answer"),
        (b"", "no HTTP answer|closed|reset"),
        (ok(b"short", 50), "cut off"),
        (REDIRECT % b"file:///etc/passwd", "the server answers 302"),
        (REDIRECT % b"https://127.0.0.1/a", "redirects to https://127.0.0.1/a: use that address"),
        (REDIRECT % b"ftp://127.0.0.1/a", "redirects to ftp://127.0.0.1/a"),
        (REDIRECT % b"/data/aircraft.json", "the server answers 302"),
        (ok(bytes((8 << 20) + 1)), "larger than 8 MB"),
        (b"HTTP/1.1 200 OK\r\n\r\n" + bytes((8 << 20) + 1), "larger than 8 MB"),
    ],
)  # fmt: skip
async def test_a_failing_server_is_a_link_that_is_down(answer: bytes, words: str) -> None:
    async with serving(answer) as (_, url):
        link = DocumentLink("readsb:test", DocumentAddress(url, None), Collector().content)
        with pytest.raises(LinkDownError, match=f"^readsb:test: .*({words})") as caught:
            await link.open()
    assert "\n" not in str(caught.value)


async def test_a_redirect_within_http_is_followed() -> None:
    async with serving(ok(b"there")) as (_, there), serving(REDIRECT % there.encode()) as (_, here):
        documents = Collector()
        await polled(DocumentAddress(here, None), lambda: bool(documents.documents), documents)
    assert documents.documents == [b"there"]


@pytest.mark.parametrize(
    ("prepare", "words"),
    [
        (lambda _path: None, "No such file or directory"),
        (lambda path: path.mkdir(), "not a regular file"),
        (lambda path: os.mkfifo(path), "not a regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "not a regular file"),
        (lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), 1 << 40), "larger than 8 MB"),
    ],
)
async def test_a_file_that_cannot_be_read(
    prepare: Callable[[Path], None], words: str, tmp_path: Path
) -> None:
    path = tmp_path / "aircraft.json"
    prepare(path)
    link = DocumentLink("readsb:test", DocumentAddress(None, str(path)), Collector().content)
    with pytest.raises(LinkDownError, match=words):
        await link.open()


async def test_a_failing_server_is_asked_again_and_its_reason_is_told() -> None:
    down = b"HTTP/1.1 503 Busy\r\nContent-Length: 0\r\n\r\n"
    async with serving(down, ok(A)) as (_, url):
        one = receiver_at(f"readsb:{url}")
        async with running(one) as heard:
            async with asyncio.timeout(10.0):
                while one.problem(0.0) is None:  # noqa: ASYNC110 - no event is set
                    await asyncio.sleep(0.005)
            assert one.problem(0.0) == "the server answers 503"
            await heard.until(lambda: heard.keys == ["A00001"])
            assert one.problem(heard.now_s) is None
            assert isinstance(one.receiver._decoder, LineDecoder)
            assert one.receiver._decoder.restarts == 1
