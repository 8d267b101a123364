"""A UDP relay with faults between two ends, such as companion and vehicle."""

import asyncio
import socket
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from companion.address import NetworkAddress, NetworkKind, parse_address
from companion.errors import LinkError
from companion.links.sockets import SocketAddress, error_text, resolve
from sim.faults import Faults, FaultyLine

MAX_SOURCES = 16
_LARGEST_DATAGRAM = 65_535
_READ_AT_ONCE = 64  # a flood must not block the timers


@dataclass(slots=True, eq=False)
class _Source:
    """One sender on the listening side, and its own socket towards the far end."""

    address: SocketAddress
    outgoing: socket.socket
    heard_s: float = 0.0


_Parcel = tuple[_Source, bytes]


class Relay:
    """Forwards datagrams from `listen` (udpin) to `to` (udpout), and the answers back, with faults both ways.

    Each source on the listening side has its own port on the other side, so the far end can distinguish the
    sources and answers return to the right one. `forth` leads away from the listening side, `back` to it.
    """

    def __init__(
        self, listen: str, to: str, *, forth: Faults | None = None, back: Faults | None = None, seed: int = 0
    ) -> None:
        self._listen = _address(listen, NetworkKind.UDP_IN)
        self._to = _address(to, NetworkKind.UDP_OUT)
        self._names = listen, to
        self.forth: FaultyLine[_Parcel] = FaultyLine(forth or Faults(), f"{seed} forth")
        self.back: FaultyLine[_Parcel] = FaultyLine(back or Faults(), f"{seed} back")
        self.send_errors = 0
        self._socket: socket.socket | None = None
        self._target: SocketAddress = ()
        self._sources: dict[SocketAddress, _Source] = {}
        self._timers: dict[int, asyncio.TimerHandle] = {}

    @property
    def local_port(self) -> int:
        """The listening port; `LinkError` before `open`."""
        if self._socket is None:
            raise LinkError(f"{self._names[0]}: not open")
        port: int = self._socket.getsockname()[1]
        return port

    async def open(self) -> None:
        """Start, until `close`. `LinkError` if an address cannot be used."""
        self._target = await _resolved(self._names[1], self._to)
        own = await _resolved(self._names[0], self._listen)
        listening = socket.socket(_family(own), socket.SOCK_DGRAM)
        listening.setblocking(False)
        try:
            listening.bind(own)
        except OSError as error:
            listening.close()
            raise LinkError(f"{self._names[0]}: {error_text(error)}") from error
        self._socket = listening
        asyncio.get_running_loop().add_reader(listening, self._read_sources, listening)

    def close(self) -> None:
        """Stop; datagrams in flight are lost. A second call does nothing."""
        for timer in self._timers.values():
            timer.cancel()
        for source in list(self._sources.values()):
            self._remove_source(source)
        listening, self._socket = self._socket, None
        if listening is not None:
            asyncio.get_running_loop().remove_reader(listening)
            listening.close()

    def cut(self) -> None:
        """Lose all datagrams both ways, those in flight included, until `mend`."""
        self.forth.cut()
        self.back.cut()

    def mend(self) -> None:
        """End a cut."""
        self.forth.mend()
        self.back.mend()

    def _read_sources(self, listening: socket.socket) -> None:
        now_s = asyncio.get_running_loop().time()
        for _ in range(_READ_AT_ONCE):
            try:
                datagram, address = listening.recvfrom(_LARGEST_DATAGRAM)
            except OSError:
                break
            source = self._sources.get(address) or self._add_source(address)
            if source is not None:
                source.heard_s = now_s
                self.forth.put((source, datagram), now_s)
        self._deliver(self.forth, self._send_forth)

    def _read_answers(self, source: _Source) -> None:
        now_s = asyncio.get_running_loop().time()
        for _ in range(_READ_AT_ONCE):
            try:
                datagram = source.outgoing.recv(_LARGEST_DATAGRAM)
            except BlockingIOError:
                break
            except OSError:
                self.send_errors += 1  # reported by the system: no listener
                break
            self.back.put((source, datagram), now_s)
        self._deliver(self.back, self._send_back)

    def _deliver(self, line: FaultyLine[_Parcel], send: Callable[[_Source, bytes], object]) -> None:
        loop = asyncio.get_running_loop()
        for source, datagram in line.take(loop.time()):
            try:
                send(source, datagram)
            except OSError:
                self.send_errors += 1
        timer = self._timers.pop(id(line), None)
        if timer is not None:
            timer.cancel()
        if line.next_due_s is not None:
            self._timers[id(line)] = loop.call_at(line.next_due_s, self._deliver, line, send)

    def _send_forth(self, source: _Source, datagram: bytes) -> None:
        source.outgoing.send(datagram)

    def _send_back(self, source: _Source, datagram: bytes) -> None:
        if self._socket is not None:
            self._socket.sendto(datagram, source.address)

    def _add_source(self, address: SocketAddress) -> _Source | None:
        """Add a source; if there are too many, remove the one that was silent the longest."""
        if len(self._sources) >= MAX_SOURCES:
            self._remove_source(min(self._sources.values(), key=lambda each: each.heard_s))
        outgoing = socket.socket(_family(self._target), socket.SOCK_DGRAM)
        outgoing.setblocking(False)
        try:
            outgoing.connect(self._target)
        except OSError:
            outgoing.close()
            self.send_errors += 1
            return None
        source = self._sources[address] = _Source(address, outgoing)
        asyncio.get_running_loop().add_reader(outgoing, partial(self._read_answers, source))
        return source

    def _remove_source(self, source: _Source) -> None:
        del self._sources[source.address]
        asyncio.get_running_loop().remove_reader(source.outgoing)
        source.outgoing.close()


def _address(text: str, kind: NetworkKind) -> NetworkAddress:
    address = parse_address(text)
    if not isinstance(address, NetworkAddress) or address.kind is not kind or address.listen_only:
        raise LinkError(f"{text}: the relay needs {kind}:HOST:PORT here")
    return address


async def _resolved(name: str, address: NetworkAddress) -> SocketAddress:
    try:
        return await resolve(address.host, address.port, socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        words = error_text(error) if isinstance(error, OSError) else "this is not a host name"
        raise LinkError(f"{name}: {words}") from error


def _family(address: SocketAddress) -> socket.AddressFamily:
    return socket.AF_INET if len(address) == 2 else socket.AF_INET6
