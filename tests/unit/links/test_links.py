"""Links: addresses, peers, hostile and absent peers, and bugs in the callback."""

import asyncio
import socket

import pytest

from companion.errors import LinkDownError, LinkError
from companion.links import Link, SerialLink, memory_pair, open_link
from companion.links.content import MAX_PEERS
from companion.links.datagram import SILENCE_S, Peers
from companion.links.sockets import resolve
from companion.links.tcp import TcpInLink, TcpOutLink
from companion.links.udp import UdpInLink, UdpOutLink
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame, StreamCounters
from tests.support.inbox import Inbox, frame


@pytest.mark.parametrize(
    ("address", "kind", "host", "port"),
    [
        ("udpin:0.0.0.0:14550", UdpInLink, "0.0.0.0", 14550),
        ("udpin:127.0.0.1:0", UdpInLink, "127.0.0.1", 0),
        ("udpout:drone-7.local:14551", UdpOutLink, "drone-7.local", 14551),
        ("udpout:[::1]:65535", UdpOutLink, "::1", 65535),
        ("udpin:[fe80::1%eth0]:1", UdpInLink, "fe80::1%eth0", 1),
        ("udpin:0.0.0.0:14550?listen", UdpInLink, "0.0.0.0", 14550),
        ("tcpin:0.0.0.0:5760", TcpInLink, "0.0.0.0", 5760),
        ("tcpout:[::1]:5760?listen", TcpOutLink, "::1", 5760),
    ],
)
def test_addresses(address: str, kind: type[Link], host: str, port: int) -> None:
    link = open_link(address)
    assert isinstance(link, UdpInLink | UdpOutLink | TcpInLink | TcpOutLink)
    assert link.listen_only is address.endswith("?listen")
    assert (type(link), link.address, link._host, link._port) == (kind, address, host, port)


def test_serial_addresses() -> None:
    link = open_link("serial:/dev/serial/by-id/usb-ArduPilot_fmuv5-if00?listen")
    assert isinstance(link, SerialLink)
    assert (link._device, link._baud) == ("/dev/serial/by-id/usb-ArduPilot_fmuv5-if00", 57_600)
    assert link.listen_only


@pytest.mark.parametrize(
    "address",
    [
        "",
        "udpin",
        "udpin:14550",
        "udpin::14550",
        "udpin:host:",
        "udpin:host:port",
        "udpin:host:-1",
        "udpin:host:65536",
        "udpout:host:99999",
        "udpout:host:0",
        "udpout:::1:14550",
        "udpout:ho st:1",
        "UDPIN:host:1",
        "tcp:host:5760",
        "/dev/ttyACM0",
        "tcpin:5760",
        "tcpout:host:0",
        "udpout:host:1?listen",
        "udpin:host:1?listen?listen",
        "udpin:host:1?speak",
        "serial:ttyACM0",
        "serial:/dev/ttyACM0:57",
        "serial:/dev/ttyACM0:99999999",
        "serial:/dev/tty ACM0:57600",
        "udpin:host:1\n",
        "udpin:host:١٢",
    ],
)
def test_a_bad_address_is_refused_in_one_line(address: str) -> None:
    with pytest.raises(LinkError) as refusal:
        open_link(address)
    assert address.strip() in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.wire
async def test_there_and_back_over_udp() -> None:
    listening = open_link("udpin:127.0.0.1:0")
    await listening.open()
    assert isinstance(listening, UdpInLink)
    talking = open_link(f"udpout:localhost:{listening.local_port}")
    heard, answered = Inbox(), Inbox()
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(listening.run(heard))
        tasks.create_task(talking.run(answered))
        await talking.open()
        listening.send(frame())  # no peer yet: not sent, and not an error
        assert (listening.counters.sent_frames, listening.counters.send_errors) == (0, 0)
        question, answer = frame(1), frame(2)
        talking.send(question + question)
        await heard.until(2)
        listening.send(answer)
        await answered.until(1)
        talking.close()
        listening.close()
    assert heard.batches == [[question, question]]
    assert answered.batches == [[answer]]
    assert (listening.counters.frames, listening.counters.sent_frames) == (2, 1)
    assert talking.counters.sent_bytes == listening.counters.received_bytes == 2 * len(question)


@pytest.mark.wire
async def test_an_unreachable_port_is_counted_and_survived() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        address = f"udpout:127.0.0.1:{other.getsockname()[1]}"
    talking = open_link(address)
    heard = Inbox()
    await talking.open()
    running = asyncio.create_task(talking.run(heard))

    for _ in range(1000):
        talking.send(frame())
        if talking.counters.send_errors:
            break
        await asyncio.sleep(0.001)
    assert talking.counters.send_errors
    assert not running.done()
    talking.close()
    await running


@pytest.mark.wire
async def test_the_error_of_a_port_in_use_names_the_address() -> None:
    first = open_link("udpin:127.0.0.1:0")
    await first.open()
    assert isinstance(first, UdpInLink)
    second = open_link(f"udpin:127.0.0.1:{first.local_port}")
    with pytest.raises(LinkError, match=rf"^{second.address}: .*in use") as refusal:
        await second.run(Inbox())
    assert not isinstance(refusal.value, LinkDownError), "trying again does not help"
    first.close()


@pytest.mark.wire
@pytest.mark.parametrize(
    ("host", "kind"),
    [("no-such-host.invalid", LinkDownError), ("a" * 70, LinkError), ("192.0.2.1", LinkDownError)],
)
@pytest.mark.parametrize("way", ["udpin", "tcpin"])
async def test_the_error_of_an_unknown_host_names_the_address(
    way: str, host: str, kind: type[LinkError]
) -> None:
    with pytest.raises(kind, match=f"^{way}:{host}:14550: .") as refusal:
        await open_link(f"{way}:{host}:14550").open()
    assert type(refusal.value) is kind


async def test_a_name_with_both_addresses_resolves_to_the_ipv4_one(monkeypatch: pytest.MonkeyPatch) -> None:
    async def both(*_args: object, **_kwargs: object) -> list[tuple[object, ...]]:
        return [
            (socket.AF_INET6, socket.SOCK_DGRAM, 17, "", ("::1", 14550, 0, 0)),
            (socket.AF_INET, socket.SOCK_DGRAM, 17, "", ("127.0.0.1", 14550)),
        ]

    monkeypatch.setattr(asyncio.get_running_loop(), "getaddrinfo", both)
    assert await resolve("localhost", 14550, socket.SOCK_DGRAM) == ("127.0.0.1", 14550)


@pytest.mark.wire
async def test_sending_never_raises() -> None:
    link = open_link("udpout:127.0.0.1:14550")
    link.send(frame())  # not open
    await link.open()
    await link.open()
    link.send(bytes(70_000))  # larger than any datagram
    assert link.counters.send_errors == 2
    link.close()
    link.close()
    link.send(frame())
    assert (link.counters.send_errors, link.counters.sent_frames) == (3, 0)
    await link.run(Inbox())


@pytest.mark.wire
async def test_nothing_is_queued_while_the_network_is_congested() -> None:
    link = UdpOutLink("udpout:127.0.0.1:14550", "127.0.0.1", 14550)
    await link.open()
    link.congested = True
    link.send(frame())
    assert (link.counters.send_errors, link.counters.sent_frames) == (1, 0)
    link.close()


async def test_an_error_in_the_callback_is_raised_by_run() -> None:
    near, far = memory_pair()

    def buggy(_frames: list[Frame], _link: Link) -> None:
        raise ZeroDivisionError

    far.send(frame())
    with pytest.raises(ZeroDivisionError):
        await near.run(buggy)


async def test_a_socket_that_dies_is_a_link_error_and_can_be_opened_again() -> None:
    near, far = memory_pair()
    near.failed("the cable is gone")
    with pytest.raises(LinkDownError, match="memory:a: the cable is gone"):
        await near.run(Inbox())
    heard = Inbox()
    running = asyncio.create_task(near.run(heard))
    far.send(frame())
    await heard.until(1)
    near.close()
    await running


@pytest.mark.wire
async def test_a_udp_socket_that_dies_is_opened_again() -> None:
    link = UdpInLink("udpin:127.0.0.1:0", "127.0.0.1", 0)
    heard = Inbox()
    await link.open()
    transport = link._transport
    link.lost(transport, OSError(19, "the network card"))
    with pytest.raises(LinkDownError, match=r"127\.0\.0\.1:0: No such device"):
        await link.run(heard)
    await link.open()
    assert link._transport is not transport
    link.close()


async def test_a_listen_only_link_never_sends() -> None:
    near, far = memory_pair()
    near.listen_only = True
    near.send(frame())
    far.send(frame())
    assert far.counters.received_bytes == len(far._waiting) == 0
    assert len(near._waiting) == 1
    assert (near.counters.sent_frames, near.counters.send_errors) == (0, 0)


async def test_much_junk_at_once_does_not_block_other_tasks() -> None:
    near, far = memory_pair()
    for _ in range(10):
        far.send(bytes(32_768))
    good = frame()
    far.send(good)
    near.failed("the cable is gone")
    heard, turns = Inbox(), 0
    running = asyncio.create_task(near.run(heard))
    while not running.done():
        await asyncio.sleep(0)
        turns += 1
    assert turns >= 10
    assert heard.raws == [good]
    assert isinstance(running.exception(), LinkDownError)


async def test_the_queue_is_bounded_in_bytes_too() -> None:
    near, far = memory_pair()
    for _ in range(100):
        far.send(bytes(65_000))
    assert near.counters.dropped == 100 - (1 << 20) // 65_000
    near.close()


async def test_a_flood_is_dropped_and_counted_not_stored() -> None:
    near, far = memory_pair()
    for _ in range(2000):
        far.send(b"\x00")
    assert near.counters.dropped == 2000 - 512
    near.close()
    await near.run(Inbox())


async def test_memory_links_deliver_everything_in_order() -> None:
    near, far = memory_pair()
    sent = [frame(n) for n in range(100)]
    heard = Inbox()
    running = asyncio.create_task(near.run(heard))
    for raw in sent:
        far.send(raw)
    far.send(b"not a frame")
    await heard.until(100)
    near.close()
    await running
    assert heard.raws == sent
    assert near.counters.bad_bytes == len(b"not a frame")
    near.send(frame())
    assert near.counters.send_errors == 1


def through_faults(count: int = 400, **faults: float) -> tuple[list[bytes], list[bytes], int]:
    near, far = memory_pair(**faults, seed=5)  # type: ignore[arg-type]
    sent = [frame(n) for n in range(count)]
    for raw in sent:
        far.send(raw)
    received: list[bytes] = []
    near._hand_over(lambda frames, _link: received.extend(one.raw for one in frames))
    return sent, received, near.counters.lost


def test_memory_links_have_the_requested_faults_and_repeat_them() -> None:
    sent, received, lost = through_faults(loss=0.25)
    assert 250 < len(received) < 350
    assert received == [raw for raw in sent if raw in received]
    assert lost == pytest.approx(len(sent) - len(received), abs=5)  # losses at the very end cannot be counted
    assert through_faults(loss=0.25)[1] != received  # later sequence numbers, so other bytes
    assert len(through_faults(loss=0.25)[1]) == len(received)

    sent, received, lost = through_faults(duplication=0.25)
    assert len(received) > 450
    assert list(dict.fromkeys(received)) == sent
    assert lost == 0

    sent, received, _ = through_faults(reordering=0.25)
    assert received != sent[: len(received)]
    assert len(received) >= len(sent) - 1
    assert set(received) <= set(sent)


class Clock:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_only_senders_of_recent_good_frames_are_peers() -> None:
    clock = Clock()
    peers: Peers[str] = Peers(StreamCounters(), clock)
    assert peers.split("scanner", b"GET / HTTP/1.1") == []
    assert peers.present() == []
    assert len(peers.split("autopilot", frame())) == 1
    clock.now_s += SILENCE_S - 1.0
    peers.split("station", frame())
    peers.split("station", b"noise")
    assert peers.present() == ["autopilot", "station"]
    clock.now_s += 1.5
    assert peers.present() == ["station"]


def heartbeat(vehicle_type: int = 1, autopilot: int = 3, system: int = 1, component: int = 1) -> bytes:
    message = mavlink.MAVLink_heartbeat_message(vehicle_type, autopilot, 0, 0, 4, 3)
    return Encoder().encode(message, system, component)


def station(number: int) -> bytes:
    return heartbeat(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 200 + number % 50, 190)


FULL = 3 * MAX_PEERS


@pytest.mark.parametrize("ours", [None, (1, 1)])
def test_a_flood_of_newcomers_does_not_displace_the_autopilot(ours: tuple[int, int] | None) -> None:
    clock = Clock()
    peers: Peers[int] = Peers(StreamCounters(), clock)
    peers.split(0, heartbeat(), ours)
    for newcomer in range(1, 1000):
        clock.now_s += 0.001
        assert len(peers.split(newcomer, station(newcomer), ours)) == 1
    assert peers.present() == [0, *range(1000 - MAX_PEERS + 1, 1000)]
    clock.now_s += SILENCE_S + 1.0
    peers.split(2000, frame())
    assert peers.present() == [2000]


@pytest.mark.parametrize("others", ["stations", "receivers", "vehicles", "strange autopilots"])
def test_an_autopilot_that_comes_last_finds_a_place(others: str) -> None:
    clock = Clock()
    peers: Peers[int] = Peers(StreamCounters(), clock)
    first = {
        "stations": station,
        "receivers": lambda n: heartbeat(mavlink.MAV_TYPE_ADSB, 0, 50 + n, 156),
        "vehicles": lambda n: heartbeat(1, 3, 2 + n),
        "strange autopilots": lambda n: heartbeat(2, 0, 2 + n),
    }[others]
    for number in range(FULL):
        clock.now_s += 0.01
        peers.split(number, first(number))
    peers.split(1000, heartbeat())
    assert 1000 in peers.present()


def test_no_one_displaces_the_autopilot_that_is_flown_and_it_moves_to_any_port() -> None:
    clock = Clock()
    peers: Peers[int] = Peers(StreamCounters(), clock)
    for port in range(40):
        peers.split(port, frame(), (1, 1))  # any message of it will do
        assert port in peers.present()
        clock.now_s += 0.05
    for other in range(100, 300):
        peers.split(other, heartbeat(1, 3, 2 + other % 200), (1, 1))
    assert 39 in peers.present()


def test_the_newest_wins_among_equals_at_once() -> None:
    clock = Clock()
    peers: Peers[int] = Peers(StreamCounters(), clock)
    for port in range(40):
        clock.now_s += 0.1
        peers.split(port, station(1))
        assert port in peers.present()
        assert len(peers.present()) <= MAX_PEERS


def test_the_sequence_numbers_of_two_peers_do_not_mix() -> None:
    counters = StreamCounters()
    peers: Peers[str] = Peers(counters, Clock())
    one, two = Encoder(), Encoder()
    message = mavlink.MAVLink_mission_current_message(1)
    for _ in range(50):
        two.encode(message, 1, 1)
    for _ in range(20):
        peers.split("one", one.encode(message, 1, 1))
        peers.split("two", two.encode(message, 1, 1))
    assert (counters.frames, counters.lost) == (40, 0)
