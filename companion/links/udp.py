"""UDP: `udpin` listens and sends to each peer that it hears, `udpout` sends to one fixed address."""

import asyncio
import socket
import time
from abc import abstractmethod
from collections.abc import Callable

from companion.errors import LinkError
from companion.links.content import MAVLINK, Content
from companion.links.datagram import DatagramLink
from companion.links.datagram_socket import DatagramSocket
from companion.links.sockets import SocketAddress, error_text, resolve


class UdpLink(DatagramLink[SocketAddress]):
    """The common part of `udpin` and `udpout`: a socket in the event loop, and sending that never waits."""

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
        super().__init__(address, clock_s, listen_only=listen_only, content=content)
        self.congested = False
        self._host = host
        self._port = port
        self._transport: asyncio.DatagramTransport | None = None

    @property
    def local_port(self) -> int:
        """The port of our own socket, once open."""
        if self._transport is None:
            raise LinkError(f"{self.address}: not open")
        port: int = self._transport.get_extra_info("sockname")[1]
        return port

    def lost(self, transport: asyncio.BaseTransport | None, error: Exception | None) -> None:
        """Called when the socket was closed; the link is lost if it is still `_transport`."""
        if transport is self._transport and error is not None:
            self.failed(error_text(error) if isinstance(error, OSError) else str(error))

    def _send(self, data: bytes) -> None:
        transport, counters = self._transport, self.counters
        if transport is None or transport.is_closing() or self.congested:
            counters.send_errors += 1
            return
        for peer in self._receivers():
            errors_before = counters.send_errors
            transport.sendto(data, peer)
            if counters.send_errors == errors_before:
                counters.sent_frames += 1
                counters.sent_bytes += len(data)

    @property
    def _is_open(self) -> bool:
        return self._transport is not None

    async def _connect(self) -> None:
        self.congested = False
        address = await resolve(self._host, self._port, socket.SOCK_DGRAM)
        opened = DatagramSocket()
        try:
            self._open_socket(opened, address)
            transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
                lambda: _Protocol(self, opened), sock=opened.socket
            )
        except BaseException:
            opened.socket.close()
            raise
        self._transport = transport

    def _disconnect(self) -> None:
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.close()

    @staticmethod
    @abstractmethod
    def _open_socket(opened: DatagramSocket, address: SocketAddress) -> None: ...

    @abstractmethod
    def _receivers(self) -> list[SocketAddress] | list[None]:
        """The addresses to send to; `None` is the address that the socket is connected to."""


class UdpInLink(UdpLink):
    """Bound to a port; sends to every peer heard lately."""

    @staticmethod
    def _open_socket(opened: DatagramSocket, address: SocketAddress) -> None:
        opened.bind(address)

    def _receivers(self) -> list[SocketAddress]:
        return self.peers.present()


class UdpOutLink(UdpLink):
    """Connected to one address: the kernel accepts datagrams from there only."""

    @staticmethod
    def _open_socket(opened: DatagramSocket, address: SocketAddress) -> None:
        opened.connect(address)

    def _receivers(self) -> list[None]:
        return [None]


class _Protocol(asyncio.DatagramProtocol):
    def __init__(self, link: UdpLink, opened: DatagramSocket) -> None:
        self._link = link
        self._socket = opened
        self._transport: asyncio.BaseTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: SocketAddress) -> None:
        link = self._link
        link.arrived(addr, data)
        # The event loop reads one datagram in a turn: of a flood, the kernel would drop most.
        while link.has_room and not link.closed:
            received = self._socket.receive()
            if received is None:
                break
            link.arrived(*received)
        link.counters.dropped += self._socket.take_dropped()

    def error_received(self, exc: Exception) -> None:  # noqa: ARG002 - an unreachable port may open later
        self._link.counters.send_errors += 1

    def pause_writing(self) -> None:
        self._link.congested = True  # old setpoints are worthless: nothing more is queued

    def resume_writing(self) -> None:
        self._link.congested = False

    def connection_lost(self, exc: Exception | None) -> None:
        self._link.lost(self._transport, exc)
