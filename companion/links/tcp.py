"""TCP: `tcpin` listens and serves several clients, `tcpout` connects to one address."""

import asyncio
import errno
import socket
import time
from abc import abstractmethod
from collections.abc import Callable

from companion.errors import LinkError
from companion.links.content import MAVLINK, Content, Reader
from companion.links.datagram import SILENCE_S
from companion.links.queued import QueuedLink
from companion.links.rank import Rank, rank_of
from companion.links.sockets import SocketAddress, error_text, resolve
from companion.mavlink.framing import Frame

_READ_BYTES = 16_384
# How long a client keeps its place against newcomers while it is not heard. Heartbeats come every second.
_KEPT_UNHEARD_S = {Rank.SILENT: 0.0, Rank.OTHER: 0.0, Rank.VEHICLE: 3.0, Rank.OURS: SILENCE_S}
_LONGEST_CONNECTING_S = 5.0
# The kernel buffers this much for a peer that does not read, and closes the connection after this time:
# setpoints that arrive later do harm. The kernel counts the overhead of each small packet, so that the buffer
# has room for about a hundred frames: a burst on a slow radio.
_SEND_BUFFER_BYTES = 65_536
_UNANSWERED_MS = 5_000
# Keep-alive probes detect a peer that vanished, even if we never send.
_PROBE_AFTER_S, _PROBE_EVERY_S, _PROBES = 5, 2, 3


class Connection(asyncio.BufferedProtocol):
    """The stream of one peer, in both directions."""

    def __init__(self, link: "TcpLink") -> None:
        self.reader: Reader = link.content.new_reader(link.counters)
        self.heard_s = 0.0
        self.rank = Rank.SILENT
        self.transport: asyncio.Transport | None = None
        self._link = link
        self._buffer = bytearray(_READ_BYTES)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Called by the event loop when connected."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        _tune(transport.get_extra_info("socket"))
        self._link.joined(self)

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - small pieces keep other tasks on time
        """The buffer for the next piece."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Called by the event loop when the next piece has arrived."""
        self._link.arrived(self, bytes(self._buffer[:nbytes]))

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by the event loop when the connection has ended, from either side."""
        self._link.left(self, exc)

    def write(self, data: bytes) -> bool:
        """Send a frame if possible now; at most the rest of one frame waits for a peer that does not read."""
        transport = self.transport
        if transport is None or transport.is_closing() or transport.get_write_buffer_size():
            return False
        transport.write(data)
        return True

    def abort(self) -> None:
        """Close the connection; data not sent yet is dropped."""
        if self.transport is not None:
            self.transport.abort()


class TcpLink(QueuedLink[Connection]):
    """The common part of `tcpin` and `tcpout`: connections, and sending that never waits."""

    def __init__(
        self,
        address: str,
        host: str,
        port: int,
        clock_s: Callable[[], float] = time.monotonic,
        *,
        listen_only: bool = False,
        content: Content = MAVLINK,
    ) -> None:
        super().__init__(address, listen_only=listen_only, content=content)
        self._host = host
        self._port = port
        self._clock_s = clock_s
        self._connections: list[Connection] = []

    @property
    def clients(self) -> int:
        """The number of connections."""
        return len(self._connections)

    def joined(self, connection: Connection) -> None:
        """Called when a connection was made."""
        connection.heard_s = self._clock_s()
        self._connections.append(connection)

    @abstractmethod
    def left(self, connection: Connection, error: Exception | None) -> None:
        """Called when a connection has ended; the other end closed it if it is still in `_connections`."""

    def _send(self, data: bytes) -> None:
        for connection in self._connections:
            if connection.write(data):
                self.counters.sent_frames += 1
                self.counters.sent_bytes += len(data)
            else:
                self.counters.send_errors += 1

    def _split(self, source: Connection, data: bytes) -> list[Frame]:
        frames = source.reader.feed(data)
        if frames:
            source.heard_s = self._clock_s()
            source.rank = max(source.rank, rank_of(frames, self.ours))
        return frames

    def _disconnect(self) -> None:
        connections, self._connections = self._connections, []
        for connection in connections:
            connection.abort()

    async def _resolved(self) -> SocketAddress:
        return await resolve(self._host, self._port, socket.SOCK_STREAM)


class TcpInLink(TcpLink):
    """Listens, and serves several clients; a client that leaves does not end the link.

    When all places are taken, a newcomer replaces the client of the lowest rank that was not heard for
    longest: the autopilot always finds a place. Only autopilots that are heard keep theirs.
    """

    _server: asyncio.Server | None = None

    @property
    def local_port(self) -> int:
        """The port of our own socket, once open."""
        if self._server is None:
            raise LinkError(f"{self.address}: not open")
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    def joined(self, connection: Connection) -> None:
        """Called when a client has connected."""
        if self.closed or (len(self._connections) >= self.content.max_peers and not self._drop_one()):
            self.counters.dropped += 1
            connection.abort()
            return
        super().joined(connection)

    def left(self, connection: Connection, error: Exception | None) -> None:  # noqa: ARG002 - it may connect again
        """Called when a client has left."""
        if connection in self._connections:
            self._connections.remove(connection)

    def _drop_one(self) -> bool:
        last = min(self._connections, key=lambda each: (each.rank, each.heard_s))
        unheard_s = self._clock_s() - last.heard_s
        if unheard_s < _KEPT_UNHEARD_S[last.rank]:
            return False
        self._connections.remove(last)
        self.counters.dropped += 1
        last.abort()
        return True

    @property
    def _is_open(self) -> bool:
        return self._server is not None

    async def _connect(self) -> None:
        host, port = (await self._resolved())[:2]
        self._server = await asyncio.get_running_loop().create_server(self._new_connection, host, port)

    def _disconnect(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            server.close()
        super()._disconnect()

    def _new_connection(self) -> Connection:
        return Connection(self)


class TcpOutLink(TcpLink):
    """Connects to one address; the link is lost when that connection is lost."""

    def left(self, connection: Connection, error: Exception | None) -> None:
        """Called when the connection has ended."""
        if connection in self._connections:
            self._connections.remove(connection)
            self.failed(error_text(error) if isinstance(error, OSError) else "closed by the other end")

    def _send(self, data: bytes) -> None:
        if not self._connections:
            self.counters.send_errors += 1
        super()._send(data)

    @property
    def _is_open(self) -> bool:
        return bool(self._connections) or self._failure is not None

    async def _connect(self) -> None:
        host, port = (await self._resolved())[:2]
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(_LONGEST_CONNECTING_S):
            transport, _ = await loop.create_connection(lambda: Connection(self), host, port)
        if transport.get_extra_info("sockname") == transport.get_extra_info("peername"):
            # There was no listener, and the kernel chose this same port for our own end.
            self._disconnect()
            raise ConnectionRefusedError(errno.ECONNREFUSED, "connected to itself")


def _tune(stream: socket.socket) -> None:
    for level, option, value in (
        (socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES),
        (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
        (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, _PROBE_AFTER_S),
        (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, _PROBE_EVERY_S),
        (socket.IPPROTO_TCP, socket.TCP_KEEPCNT, _PROBES),
        (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS),
    ):
        stream.setsockopt(level, option, value)
