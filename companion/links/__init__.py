"""Links to other MAVLink systems. `open_link` makes one from its address."""

from companion.address import parse_address
from companion.links.link import Link, LinkCounters, OnFrames
from companion.links.memory import MemoryLink, memory_pair
from companion.links.udp import UdpInLink, UdpOutLink

__all__ = ["Link", "LinkCounters", "MemoryLink", "OnFrames", "memory_pair", "open_link"]


def open_link(text: str) -> Link:
    """The link that an address stands for; `LinkError` when it stands for none.

    Whether the host exists and the port is free turns out when the link is opened (`Link.open`, `Link.run`).
    """
    address = parse_address(text)
    kind = UdpInLink if address.listens else UdpOutLink
    return kind(text, address.host, address.port)
