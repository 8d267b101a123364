"""UDP: `udpin` listens and answers whoever talks to it, `udpout` talks to one fixed address."""

import asyncio
import socket
import time
from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from companion.errors import LinkError
from companion.links.datagram import DatagramLink

SocketAddress = tuple[Any, ...]  # (host, port) or, for IPv6, (host, port, flow, scope)


class UdpLink(DatagramLink[SocketAddress]):
    """What both directions share: a socket in the event loop, and sending that never waits."""

    def __init__(
        self, address: str, host: str, port: int, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(address, clock_s)
        self._host = host
        self._port = port
        self.congested = False
        self._transport: asyncio.DatagramTransport | None = None
        self._opening = asyncio.Lock()  # `open` and `run` may meet: one socket, not two

    @property
    def local_port(self) -> int:
        """The port of our own socket, once open."""
        if self._transport is None:
            raise LinkError(f"{self.address}: not open")
        port: int = self._transport.get_extra_info("sockname")[1]
        return port

    async def open(self) -> None:
        """Make the socket; `LinkError` when the host is unknown or the port in use."""
        async with self._opening:
            if self._transport is not None:
                return
            try:
                transport = await self._make_transport(await _resolve(self._host, self._port))
            except OSError as error:
                raise LinkError(f"{self.address}: {error.strerror or error}") from error
            except UnicodeError as error:
                raise LinkError(f"{self.address}: this is no host name") from error
            self._transport = transport
            if self.closed:
                transport.close()

    def send(self, data: bytes) -> None:
        """Send one frame to everybody on this link. Never waits, never raises: errors are counted."""
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

    def close(self) -> None:
        """Stop; `run` returns. A second time does nothing."""
        super().close()
        if self._transport is not None:
            self._transport.close()

    @abstractmethod
    async def _make_transport(self, address: SocketAddress) -> asyncio.DatagramTransport: ...

    @abstractmethod
    def _receivers(self) -> list[SocketAddress] | list[None]:
        """Whom to send to; `None` is whom the socket is connected to."""


class UdpInLink(UdpLink):
    """Bound to a port; answers every peer heard lately, and sends nothing while there is none."""

    async def _make_transport(self, address: SocketAddress) -> asyncio.DatagramTransport:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(lambda: _Protocol(self), local_addr=address[:2])
        return transport

    def _receivers(self) -> list[SocketAddress]:
        return self.peers.present()


class UdpOutLink(UdpLink):
    """Connected to one address: the kernel lets in only what comes from there."""

    async def _make_transport(self, address: SocketAddress) -> asyncio.DatagramTransport:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_datagram_endpoint(lambda: _Protocol(self), remote_addr=address[:2])
        return transport

    def _receivers(self) -> list[None]:
        return [None]


class _Protocol(asyncio.DatagramProtocol):
    def __init__(self, link: UdpLink) -> None:
        self._link = link

    def datagram_received(self, data: bytes, addr: SocketAddress) -> None:
        self._link.arrived(addr, data)

    def error_received(self, exc: Exception) -> None:  # noqa: ARG002 - an unreachable port may open again
        self._link.counters.send_errors += 1

    def pause_writing(self) -> None:
        self._link.congested = True  # old setpoints are worth nothing: nothing more is queued

    def resume_writing(self) -> None:
        self._link.congested = False

    def connection_lost(self, exc: Exception | None) -> None:
        if exc is not None:
            self._link.failed(str(exc))


async def _resolve(host: str, port: int) -> SocketAddress:
    """The address of a host, IPv4 if it has one: that is what autopilots and ground stations listen on."""
    found = await asyncio.get_running_loop().getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    return min(found, key=lambda entry: entry[0] != socket.AF_INET)[4]
