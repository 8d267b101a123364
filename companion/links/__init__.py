"""Links to other MAVLink systems, and to receivers of traffic: made from their addresses, and kept open."""

from collections.abc import Iterable

from companion.address import is_of_receiver, parse_receiver_address
from companion.links.backoff import Backoff, LinkState
from companion.links.link import Link, LinkCounters, OnFrames
from companion.links.memory import MemoryLink, memory_pair
from companion.links.opening import open_link
from companion.links.receiver_link import OnPiece, ReceiverLink
from companion.links.reconnect import Reconnect, open_all
from companion.links.serial import SerialLink

__all__ = [
    "Backoff",
    "Link",
    "LinkCounters",
    "LinkState",
    "MemoryLink",
    "OnFrames",
    "OnPiece",
    "ReceiverLink",
    "Reconnect",
    "SerialLink",
    "memory_pair",
    "open_all",
    "open_link",
    "open_links",
]


def open_links(addresses: Iterable[str]) -> tuple[list[Link], list[ReceiverLink]]:
    """The MAVLink links and the receivers for these addresses, not opened yet.

    `LinkError` if a text is not an address, `ConfigError` if a format cannot be decoded here.
    """
    links: list[Link] = []
    receivers: list[ReceiverLink] = []
    for text in addresses:
        if is_of_receiver(text):
            receivers.append(ReceiverLink(text, parse_receiver_address(text)))
        else:
            links.append(open_link(text))
    return links, receivers
