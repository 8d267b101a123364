"""Links to other MAVLink systems: `open_link` makes one from its address, `Reconnect` keeps one open."""

from companion.address import NetworkKind, SerialAddress, parse_address
from companion.links.backoff import Backoff, LinkState
from companion.links.link import Link, LinkCounters, OnFrames
from companion.links.memory import MemoryLink, memory_pair
from companion.links.reconnect import Reconnect, open_all
from companion.links.serial import SerialLink
from companion.links.tcp import TcpInLink, TcpOutLink
from companion.links.udp import UdpInLink, UdpOutLink

__all__ = [
    "Backoff",
    "Link",
    "LinkCounters",
    "LinkState",
    "MemoryLink",
    "OnFrames",
    "Reconnect",
    "SerialLink",
    "memory_pair",
    "open_all",
    "open_link",
]

_NETWORK_LINKS: dict[NetworkKind, type[UdpInLink | UdpOutLink | TcpInLink | TcpOutLink]] = {
    NetworkKind.UDP_IN: UdpInLink,
    NetworkKind.UDP_OUT: UdpOutLink,
    NetworkKind.TCP_IN: TcpInLink,
    NetworkKind.TCP_OUT: TcpOutLink,
}


def open_link(text: str) -> Link:
    """The link for an address, not opened yet; `LinkError` if the text is not a link address.

    Whether the host exists and the port is free is known when the link is opened (`Link.open`, `Link.run`).
    """
    address = parse_address(text)
    if isinstance(address, SerialAddress):
        return SerialLink(text, address.device, address.baud, listen_only=address.listen_only)
    kind = _NETWORK_LINKS[address.kind]
    return kind(text, address.host, address.port, listen_only=address.listen_only)
