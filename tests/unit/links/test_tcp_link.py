"""TCP links: streams in pieces, and peers that connect, leave, restart or never read."""

import asyncio
import functools
import socket

import pytest

from companion.errors import LinkDownError, LinkError
from companion.links import LinkState, Reconnect, open_link, tcp
from companion.links.content import MAX_PEERS
from companion.links.datagram import SILENCE_S
from companion.links.tcp import TcpInLink, TcpOutLink
from companion.mavlink.dialect import Encoder, mavlink
from tests.support.inbox import Inbox, frame, until

pytestmark = pytest.mark.wire


async def listening(port: int = 0) -> TcpInLink:
    link = open_link(f"tcpin:127.0.0.1:{port}")
    assert isinstance(link, TcpInLink)
    await link.open()
    return link


def out(port: int) -> TcpOutLink:
    link = open_link(f"tcpout:127.0.0.1:{port}")
    assert isinstance(link, TcpOutLink)
    return link


async def test_there_and_back_with_several_clients() -> None:
    server = await listening()
    clients = [out(server.local_port) for _ in range(3)]
    heard, answered = Inbox(), [Inbox() for _ in clients]
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(server.run(heard))
        for client, inbox in zip(clients, answered, strict=True):
            tasks.create_task(client.run(inbox))
        await until(lambda: server.clients == 3)
        questions = [frame(number) for number in range(3)]
        for client, question in zip(clients, questions, strict=True):
            await client.open()
            client.send(question)
        await heard.until(3)
        answer = frame(7)
        server.send(answer)
        for inbox in answered:
            await inbox.until(1)
        for link in (server, *clients):
            link.close()
    assert sorted(heard.raws) == sorted(questions)
    assert [inbox.raws for inbox in answered] == 3 * [[answer]]
    assert (server.counters.frames, server.counters.sent_frames, server.counters.send_errors) == (3, 3, 0)


async def test_a_frame_in_pieces_among_noise_is_one_frame() -> None:
    server, heard = await listening(), Inbox()
    running = asyncio.create_task(server.run(heard))
    _, writer = await asyncio.open_connection("127.0.0.1", server.local_port)
    sent = [frame(number) for number in range(3)]
    stream = b"noise" + b"".join(sent)
    for start in range(0, len(stream), 7):
        writer.write(stream[start : start + 7])
        await writer.drain()
        await until(lambda seen=start: server.counters.received_bytes >= min(seen + 7, len(stream)))  # type: ignore[misc]
    await heard.until(3)
    assert heard.raws == sent
    assert server.counters.bad_bytes == len(b"noise")
    writer.close()
    server.close()
    await running


async def test_two_clients_do_not_mix_their_bytes() -> None:
    server, heard = await listening(), Inbox()
    running = asyncio.create_task(server.run(heard))
    writers = [(await asyncio.open_connection("127.0.0.1", server.local_port))[1] for _ in range(2)]
    one, two = frame(1), frame(2)
    for part in (slice(0, 5), slice(5, None)):
        before = server.counters.received_bytes
        for writer, raw in zip(writers, (one, two), strict=True):
            writer.write(raw[part])
        due = before + len(one[part]) + len(two[part])
        await until(lambda due=due: server.counters.received_bytes >= due)  # type: ignore[misc]
    await heard.until(2)
    assert sorted(heard.raws) == sorted([one, two])
    assert server.counters.bad_bytes == 0
    for writer in writers:
        writer.close()
    server.close()
    await running


async def test_a_client_may_leave_and_sending_to_none_is_not_an_error() -> None:
    server, heard = await listening(), Inbox()
    running = asyncio.create_task(server.run(heard))
    client = out(server.local_port)
    await client.open()
    await until(lambda: server.clients == 1)
    client.close()
    await until(lambda: server.clients == 0)
    server.send(frame())
    assert (server.counters.sent_frames, server.counters.send_errors) == (0, 0)
    assert not running.done()
    server.close()
    await running


async def test_the_link_connects_again_to_a_peer_that_restarts() -> None:
    server = await listening()
    port = server.local_port
    client, heard = out(port), Inbox()
    reconnect = Reconnect(client)
    running = asyncio.create_task(reconnect.run(heard))
    await until(lambda: server.clients == 1)
    server.send(frame(1)[:9])  # cut off by the restart
    server.close()
    await until(lambda: reconnect.state is LinkState.WAITING)
    client.send(frame())
    assert client.counters.send_errors == 1
    server = await listening(port)
    await until(lambda: server.clients == 1)
    whole = frame(2)
    server.send(whole)
    await heard.until(1)
    assert heard.raws == [whole]
    client.close()
    await running
    server.close()


async def test_a_refused_connection_is_named_and_may_be_tried_again() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        client = out(taken.getsockname()[1])
        for _ in range(2):
            with pytest.raises(LinkDownError, match=f"^{client.address}: Connection refused$"):
                await client.open()
    client.close()


async def test_a_connection_to_ourselves_counts_as_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a listener, the kernel may choose this same port for our own end."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    loop = asyncio.get_running_loop()
    by_chance = functools.partial(loop.create_connection, local_addr=("127.0.0.1", port))
    monkeypatch.setattr(loop, "create_connection", by_chance)
    client = out(port)
    with pytest.raises(LinkDownError, match="Connection refused"):
        await client.open()
    assert client.clients == 0


async def test_a_flood_is_read_in_small_pieces() -> None:
    server = await listening()
    flooder = socket.create_connection(("127.0.0.1", server.local_port))
    flooder.sendall(bytes(200_000))
    await until(lambda: sum(len(data) for _, data in server._waiting) == 200_000)
    assert max(len(data) for _, data in server._waiting) <= 16_384
    flooder.close()
    server.close()


async def test_a_connection_without_an_answer_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp, "_LONGEST_CONNECTING_S", 0.05)
    with socket.socket() as full:  # a full queue of connections that are never accepted
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        waiting = [socket.socket() for _ in range(4)]
        for each in waiting:
            each.setblocking(False)
            each.connect_ex(full.getsockname())
        client = out(full.getsockname()[1])
        with pytest.raises(LinkDownError, match=f"^{client.address}: no answer$"):
            await client.open()
        for each in waiting:
            each.close()


async def test_a_port_in_use_is_a_permanent_error() -> None:
    first = await listening()
    with pytest.raises(LinkError, match="in use") as refusal:
        await listening(first.local_port)
    assert not isinstance(refusal.value, LinkDownError)
    first.close()


async def test_a_peer_that_does_not_read_delays_no_other_peer_and_fills_no_buffer() -> None:
    server = await listening()
    unread = socket.create_connection(("127.0.0.1", server.local_port))
    client, heard = out(server.local_port), Inbox()
    running = asyncio.create_task(client.run(heard))
    await until(lambda: server.clients == 2)
    first = server._connections[0].transport
    assert first is not None
    # The system's buffers of megabytes would take long to fill.
    unread.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    first.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    raw = frame()
    for sent in range(1, 100_000):
        server.send(raw)
        if sent % 10 == 0:
            await heard.until(sent)  # the client that reads gets all of them
        if server.counters.send_errors > 1000:
            break
    assert server.counters.send_errors > 1000, "its buffer never filled up"
    assert first.get_write_buffer_size() <= len(raw)
    unread.close()
    client.close()
    server.close()
    await running


async def test_a_flood_of_clients_does_not_displace_the_autopilot() -> None:
    now_s = 0.0
    server, heard = TcpInLink("tcpin", "127.0.0.1", 0, lambda: now_s), Inbox()
    await server.open()
    running = asyncio.create_task(server.run(heard))
    autopilot = out(server.local_port)
    await autopilot.open()
    autopilot.send(frame())
    await heard.until(1)
    idle = [socket.create_connection(("127.0.0.1", server.local_port)) for _ in range(MAX_PEERS + 4)]
    await until(lambda: server.counters.dropped == 5)
    assert server.clients == MAX_PEERS
    now_s = SILENCE_S + 1.0
    autopilot.send(frame())
    await heard.until(2)
    newcomers = [out(server.local_port) for _ in range(3)]
    for number, newcomer in enumerate(newcomers):
        await newcomer.open()
        newcomer.send(frame())
        await heard.until(3 + number)
    assert server.clients == MAX_PEERS
    autopilot.send(frame())
    await heard.until(6)
    for link in (autopilot, server, *newcomers):
        link.close()
    for each in idle:
        each.close()
    await running


async def test_listen_only_never_sends() -> None:
    server = await listening()
    client = open_link(f"tcpout:127.0.0.1:{server.local_port}?listen")
    answered, heard = Inbox(), Inbox()
    tasks = [asyncio.create_task(client.run(heard)), asyncio.create_task(server.run(answered))]
    await until(lambda: server.clients == 1)
    client.send(frame())
    server.send(frame())
    await heard.until(1)
    assert (client.counters.sent_bytes, server.counters.received_bytes) == (0, 0)
    client.close()
    server.close()
    await asyncio.gather(*tasks)


async def test_closing_while_it_connects_leaves_nothing_open() -> None:
    server = await listening()
    client = out(server.local_port)
    opening = asyncio.create_task(client.open())
    await asyncio.sleep(0)
    client.close()
    await opening
    assert client.clients == 0
    await client.run(Inbox())
    server.close()


@pytest.mark.parametrize("kind", [mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ADSB])
async def test_an_autopilot_that_connects_last_finds_a_place(kind: int) -> None:
    server = await listening()
    heard = Inbox()
    running = asyncio.create_task(server.run(heard))
    hello = Encoder().encode(mavlink.MAVLink_heartbeat_message(kind, 0, 0, 0, 4, 3), 250, 190)
    others = [out(server.local_port) for _ in range(MAX_PEERS)]
    for number, other in enumerate(others):
        await other.open()
        other.send(hello)
        await heard.until(number + 1)
    autopilot = out(server.local_port)
    await autopilot.open()
    autopilot.send(Encoder().encode(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3), 1, 1))
    await heard.until(MAX_PEERS + 1)
    for _ in range(MAX_PEERS):  # and keeps it
        newcomer = out(server.local_port)
        await newcomer.open()
        others.append(newcomer)
    autopilot.send(frame())
    await heard.until(MAX_PEERS + 2)
    for link in (autopilot, server, *others):
        link.close()
    await running
