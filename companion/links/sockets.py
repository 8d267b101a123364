"""Host names to socket addresses, and the errors of sockets and ports as text."""

import asyncio
import errno
import os
import socket
from typing import Any

from companion.errors import PORT_IN_USE

SocketAddress = tuple[Any, ...]  # (host, port) or, for IPv6, (host, port, flow, scope)


async def resolve(host: str, port: int, kind: socket.SocketKind) -> SocketAddress:
    """The address of a host; IPv4 if it has one, because autopilots and ground stations listen there.

    `OSError` when the name cannot be resolved now, `UnicodeError` when it cannot be a host name.
    """
    found = await asyncio.get_running_loop().getaddrinfo(host, port, type=kind)
    return min(found, key=lambda entry: entry[0] != socket.AF_INET)[4]


def error_text(error: OSError) -> str:
    """The reason of an error, without number and address; name resolution has its own, negative numbers."""
    if error.errno == errno.EADDRINUSE:
        return PORT_IN_USE
    if isinstance(error, TimeoutError):
        return "no answer"
    if error.errno is not None and error.errno > 0:
        return os.strerror(error.errno)
    return error.strerror or str(error) or type(error).__name__
