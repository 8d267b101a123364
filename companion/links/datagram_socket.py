"""A UDP socket that is read until it is empty, and what the kernel dropped before it was read."""

import contextlib
import socket
import struct
from typing import Final

from companion.links.sockets import SocketAddress

_MAX_DATAGRAM: Final = 1 << 16
# Linux: each datagram brings the number of those that were dropped before it (socket(7)).
_SO_RXQ_OVFL: Final = 40
_COUNT = struct.Struct("=I")
_COUNT_ROOM: Final = socket.CMSG_SPACE(_COUNT.size)
# The kernel gives what the system's limit allows, usually a quarter of a second of a busy link.
_BUFFER_BYTES: Final = 4 << 20


class DatagramSocket:
    """Not connected to the event loop: that reads the first datagram, and `receive` those after it."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._dropped = self._taken = 0

    def bind(self, address: SocketAddress) -> None:
        """Receive what is sent to a local address; `OSError` if it is in use."""
        self._prepare(address)
        self.socket.bind(address)

    def connect(self, address: SocketAddress) -> None:
        """Receive what one address sends."""
        self._prepare(address)
        self.socket.connect(address)

    def receive(self) -> tuple[SocketAddress, bytes] | None:
        """The next datagram that waits, with its sender; `None` if there is none."""
        try:
            data, notes, _, sender = self.socket.recvmsg(_MAX_DATAGRAM, _COUNT_ROOM)
        except OSError:  # empty, closed, or the peer's port is: the event loop reports what lasts
            return None
        for level, kind, value in notes:
            if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL and len(value) == _COUNT.size:
                (self._dropped,) = _COUNT.unpack(value)
        return sender, data

    def take_dropped(self) -> int:
        """The number of datagrams that the kernel dropped since the last call, as far as is known."""
        new, self._taken = (self._dropped - self._taken) & 0xFFFF_FFFF, self._dropped
        return new

    def _prepare(self, address: SocketAddress) -> None:
        if len(address) == 4:
            self.socket.close()
            self.socket = socket.socket(socket.AF_INET6, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        for option, value in ((socket.SO_RCVBUF, _BUFFER_BYTES), (_SO_RXQ_OVFL, 1)):
            with contextlib.suppress(OSError):  # other systems have no such counter
                self.socket.setsockopt(socket.SOL_SOCKET, option, value)
