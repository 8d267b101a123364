"""Link addresses, as users write them.

| address | meaning |
|---|---|
| `udpin:HOST:PORT` | listens, and sends to each peer that it hears |
| `udpout:HOST:PORT` | sends to this address, and receives from this address only |
| `tcpin:HOST:PORT` | listens; several clients may connect |
| `tcpout:HOST:PORT` | connects to this address |
| `serial:DEVICE:BAUD` | a serial port, by absolute path; 57600 baud unless given |

With `?listen` at the end, nothing is ever sent on the link.

A receiver of traffic that does not speak MAVLink has its format before the address: `gdl90:udpin:HOST:PORT`.
It is only listened to, so that `udpout` makes no sense; `tcp` means `tcpout`. Formats of whole documents have
`FORMAT:http://HOST/PATH`, `https` or `FORMAT:file:/PATH` instead.
"""

import difflib
import re
from dataclasses import dataclass
from enum import StrEnum

from companion.errors import LinkError
from companion.sources.registry import FORMATS

DEFAULT_BAUD = 57_600  # of the TELEM ports of ArduPilot and PX4
_FORMS = "udpin|udpout|tcpin|tcpout:HOST:PORT or serial:/dev/NAME:BAUD"

_LISTEN_ONLY = "?listen"
_NETWORK = re.compile(
    r"(?P<kind>udpin|udpout|tcpin|tcpout):"
    r"(?:\[(?P<v6>[0-9A-Fa-f:.%\w]+)\]|(?P<host>[^\s:\[\]?]+)):(?P<port>\d{1,5})",
    re.ASCII,
)
# Names under /dev/serial/by-path contain colons: only digits after the last colon are a baud rate.
_SERIAL = re.compile(r"serial:(?P<device>/[^\s?]+?)(?::(?P<baud>\d{1,8}))?", re.ASCII)
_SLOWEST_BAUD, _FASTEST_BAUD = 1_200, 4_000_000
_LINK_KINDS = ("udpin", "udpout", "tcpin", "tcpout", "serial")
_HEARD_BY = (*_LINK_KINDS, "tcp")  # the ways to receivers of a stream
_DOCUMENT_KINDS = ("http", "https", "file")
_WEB = re.compile(r"https?://(\[[0-9A-Fa-f:.]+\]|[^\s/:?#@\[\]]+)(:(?P<port>\d{1,5}))?(/[!-~]*)?", re.ASCII)
_FILE = re.compile(r"file:(?P<path>/[^\0]+)")


class NetworkKind(StrEnum):
    """UDP or TCP, and which side connects."""

    UDP_IN = "udpin"
    UDP_OUT = "udpout"
    TCP_IN = "tcpin"
    TCP_OUT = "tcpout"

    @property
    def listens(self) -> bool:
        """Whether the link waits for peers at a port of its own."""
        return self in (NetworkKind.UDP_IN, NetworkKind.TCP_IN)


@dataclass(frozen=True, slots=True)
class NetworkAddress:
    """A well-formed host address; whether the host exists is known when the link is opened."""

    kind: NetworkKind
    host: str
    port: int
    listen_only: bool = False

    @property
    def place(self) -> tuple[object, ...]:
        """The host and port, or device, that only one link can use."""
        return self.kind, self.host, self.port


@dataclass(frozen=True, slots=True)
class SerialAddress:
    """A well-formed serial port address; whether the device exists is known when the link is opened."""

    device: str
    baud: int = DEFAULT_BAUD
    listen_only: bool = False

    @property
    def place(self) -> tuple[object, ...]:
        """The host and port, or device, that only one link can use."""
        return (self.device,)


LinkAddress = NetworkAddress | SerialAddress


@dataclass(frozen=True, slots=True)
class DocumentAddress:
    """A document that is read again and again: an http or https URL, or the absolute path of a file."""

    url: str | None
    path: str | None

    @property
    def place(self) -> tuple[object, ...]:
        """The URL or path."""
        return self.url, self.path


@dataclass(frozen=True, slots=True)
class ReceiverAddress:
    """A receiver of traffic: the name of its format, and where it is heard."""

    format: str
    at: LinkAddress | DocumentAddress

    @property
    def place(self) -> tuple[object, ...]:
        """The host and port, device or document that only one link can use."""
        return self.at.place


def parse_any_address(text: str) -> LinkAddress | ReceiverAddress:
    """The address in a text, of a MAVLink link or of a receiver; `LinkError` if it is neither."""
    return parse_receiver_address(text) if is_of_receiver(text) else parse_address(text)


def is_of_receiver(text: str) -> bool:
    """Whether a text is, or was meant as, the address of a receiver: a word, then where it is heard."""
    word, _, rest = text.partition(":")
    kind = rest.partition(":")[0]
    return word not in _LINK_KINDS and (word in FORMATS or kind in (*_HEARD_BY, *_DOCUMENT_KINDS))


def parse_receiver_address(text: str) -> ReceiverAddress:
    """The address of a receiver in a text; `LinkError`, with what to do, if it is not one."""
    name, _, rest = text.partition(":")
    if name not in FORMATS:
        close = difflib.get_close_matches(name.lower(), FORMATS, n=1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(FORMATS)}"
        raise LinkError(f"{text}: {name!r} is not a format of receivers, {hint}")
    if text.endswith(_LISTEN_ONLY):
        raise LinkError(f"{text}: a receiver is only listened to: leave out {_LISTEN_ONLY}")
    kind = rest.partition(":")[0]
    if FORMATS[name].documents:
        return ReceiverAddress(name, _parse_document(text, name, rest))
    forms = f"{name}:tcp:HOST:PORT, {name}:udpin:HOST:PORT or {name}:serial:/dev/NAME:BAUD"
    if kind == "udpout":
        raise LinkError(f"{text}: a receiver is only listened to: use {name}:udpin:HOST:PORT, a port of ours")
    if kind not in _HEARD_BY:
        raise LinkError(f"{text}: {name} does not arrive like this: use {forms}")
    return ReceiverAddress(name, _parse_link(f"tcpout{rest[3:]}" if kind == "tcp" else rest, text, forms))


def _parse_document(text: str, name: str, rest: str) -> DocumentAddress:
    if (file := _FILE.fullmatch(rest)) is not None:
        return DocumentAddress(None, file["path"])
    web = _WEB.fullmatch(rest)
    if web is None or not 0 < int(web["port"] or 80) < 65_536:
        raise LinkError(f"{text}: {name} is a document: use {name}:http://HOST/PATH or {name}:file:/PATH")
    return DocumentAddress(rest, None)


def parse_address(text: str) -> LinkAddress:
    """The address of a MAVLink link in a text, IPv6 hosts in brackets; `LinkError` if it is not one."""
    if is_of_receiver(text):
        raise LinkError(f"{text}: a MAVLink link is needed here, not a receiver: use {_FORMS}")
    return _parse_link(text, text, _FORMS)


def _parse_link(link: str, text: str, forms: str) -> LinkAddress:
    """The address in `link`; errors show the whole `text`, and the `forms` that it may have."""
    listen_only = link.endswith(_LISTEN_ONLY)
    body = link.removesuffix(_LISTEN_ONLY)
    if (match := _NETWORK.fullmatch(body)) is not None:
        host, kind = match["v6"] or match["host"], NetworkKind(match["kind"])
        address = NetworkAddress(kind, host, int(match["port"]), listen_only)
        _check_network(text, address)
        return address
    if (match := _SERIAL.fullmatch(body)) is not None:
        baud = DEFAULT_BAUD if match["baud"] is None else int(match["baud"])
        if not _SLOWEST_BAUD <= baud <= _FASTEST_BAUD:
            raise LinkError(f"{text}: baud rate must be {_SLOWEST_BAUD} to {_FASTEST_BAUD} (got {baud})")
        return SerialAddress(match["device"], baud, listen_only)
    raise LinkError(f"{text!r} is not a link address: use {forms}")


def _check_network(text: str, address: NetworkAddress) -> None:
    if address.port > 65_535:
        raise LinkError(f"{text}: port must be at most 65535 (got {address.port})")
    if address.port == 0 and not address.kind.listens:
        raise LinkError(f"{text}: port 0 cannot be sent to")
    if address.kind is NetworkKind.UDP_OUT and address.listen_only:
        raise LinkError(f"{text}: a udpout link that never sends gets no answer; use udpin to listen")


def host_and_port(listen: str) -> tuple[str, int]:
    """Host and port from HOST:PORT, IPv6 hosts in brackets; `ValueError` if it is not one."""
    host, _, port = listen.rpartition(":")
    if host.startswith("[") and host.endswith("]"):
        host = host[1:-1]
    elif ":" in host:
        raise ValueError("an IPv6 address needs brackets: [::1]:8080")
    if not host or not (port.isascii() and port.isdigit()) or not 0 < int(port) < 65_536:
        raise ValueError("must be HOST:PORT")
    return host, int(port)
