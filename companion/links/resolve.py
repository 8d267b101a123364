"""Hosts by name."""

import asyncio
import socket
from typing import Any

SocketAddress = tuple[Any, ...]  # (host, port) or, for IPv6, (host, port, flow, scope)


async def resolve(host: str, port: int, kind: socket.SocketKind) -> SocketAddress:
    """The address of a host, IPv4 if it has one: that is what autopilots and ground stations listen on.

    `OSError` when the name is not known now, `UnicodeError` when it can be none.
    """
    found = await asyncio.get_running_loop().getaddrinfo(host, port, type=kind)
    return min(found, key=lambda entry: entry[0] != socket.AF_INET)[4]
