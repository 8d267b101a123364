"""Link addresses, as users write them.

| address | meaning |
|---|---|
| `udpin:HOST:PORT` | listens, and sends to each peer that it hears |
| `udpout:HOST:PORT` | sends to this address, and receives from this address only |
| `tcpin:HOST:PORT` | listens; several clients may connect |
| `tcpout:HOST:PORT` | connects to this address |
| `serial:DEVICE:BAUD` | a serial port, by absolute path; 57600 baud unless given |

With `?listen` at the end, nothing is ever sent on the link.
"""

import re
from dataclasses import dataclass
from enum import StrEnum

from companion.errors import LinkError

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


def parse_address(text: str) -> LinkAddress:
    """The address in a text, IPv6 hosts in brackets; `LinkError` if it is not one."""
    listen_only = text.endswith(_LISTEN_ONLY)
    body = text.removesuffix(_LISTEN_ONLY)
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
    raise LinkError(f"{text!r} is not a link address: use {_FORMS}")


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
