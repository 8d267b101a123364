"""From an address to a link; whether it works is known when the link is opened."""

from companion.address import (
    DocumentAddress,
    LinkAddress,
    NetworkKind,
    SerialAddress,
    parse_address,
)
from companion.links.content import MAVLINK, Content
from companion.links.link import Link
from companion.links.serial import SerialLink
from companion.links.tcp import TcpInLink, TcpOutLink
from companion.links.udp import UdpInLink, UdpOutLink

_NETWORK_LINKS: dict[NetworkKind, type[UdpInLink | UdpOutLink | TcpInLink | TcpOutLink]] = {
    NetworkKind.UDP_IN: UdpInLink,
    NetworkKind.UDP_OUT: UdpOutLink,
    NetworkKind.TCP_IN: TcpInLink,
    NetworkKind.TCP_OUT: TcpOutLink,
}


def open_link(text: str) -> Link:
    """The MAVLink link for an address, not opened yet; `LinkError` if the text is not a link address.

    Whether the host exists and the port is free is known when the link is opened (`Link.open`, `Link.run`).
    """
    return make_link(text, parse_address(text))


def make_link(text: str, address: LinkAddress | DocumentAddress, content: Content = MAVLINK) -> Link:
    """The link for an address, not opened yet; `text` is its name."""
    if isinstance(address, DocumentAddress):
        from companion.links.document import DocumentLink  # an HTTP client, which few flights need

        return DocumentLink(text, address, content)
    listen_only = address.listen_only or content is not MAVLINK
    if isinstance(address, SerialAddress):
        return SerialLink(text, address.device, address.baud, listen_only=listen_only, content=content)
    kind = _NETWORK_LINKS[address.kind]
    return kind(text, address.host, address.port, listen_only=listen_only, content=content)
