"""Simulated receivers at their links: where what they send goes to, and where Companion hears it."""

import contextlib
from collections.abc import Sequence

from companion.address import (
    DocumentAddress,
    NetworkAddress,
    NetworkKind,
    parse_address,
    parse_receiver_address,
)
from companion.errors import LinkDownError, LinkError
from companion.links import Link, Reconnect, open_link
from companion.mavlink.framing import Frame
from sim.document_output import DocumentFile, DocumentServer
from sim.receiver import Carrier, SimulatedReceiver
from sim.receivers import FORMATS

_EVERYWHERE = ("0.0.0.0", "::")


class ReceiverOutput:
    """A simulated receiver of the format `name` at its link, which is opened again whenever it fails."""

    def __init__(self, name: str, address: str) -> None:
        """It is not switched on yet. `LinkError` for a wrong address."""
        self.name = name
        self.link = open_output(name, address)
        self._receiver: SimulatedReceiver | None = None

    def switch_on(self, receiver: SimulatedReceiver) -> None:
        """Send what this receiver hears."""
        self._receiver = receiver

    def step(self, now_s: float, carrier: Carrier) -> None:
        """Send what the receiver has to say by now; what the link cannot take is lost."""
        if self._receiver is not None:
            for piece in self._receiver.pieces(now_s, carrier):
                self.link.send(piece)

    async def open(self) -> None:
        """Open the link if that is possible now; `LinkError` if it never is."""
        with contextlib.suppress(LinkDownError):
            await self.link.open()

    async def run(self) -> None:
        """Keep the link open until `close`; what arrives on it is of no use."""
        await Reconnect(self.link).run(_ignore)

    def close(self) -> None:
        """Close the link; `run` returns."""
        self.link.close()


def open_output(name: str, text: str) -> Link:
    """The link for what a receiver of this format sends, not opened yet; `LinkError` for a wrong address."""
    if FORMATS[name].sent_as == "document":
        at = parse_receiver_address(f"{name}:{text}").at
        assert isinstance(at, DocumentAddress)
        return DocumentFile(text, at.path) if at.path is not None else DocumentServer(text, str(at.url))
    address = parse_address(text)
    only_hears = isinstance(address, NetworkAddress) and address.kind is NetworkKind.UDP_IN
    if address.listen_only or (only_hears and not _is_mavlink(name)):
        raise LinkError(f"{text}: a receiver sends: use udpout, tcpin or tcpout:HOST:PORT, or serial")
    return open_link(text)


def heard_at(name: str, text: str) -> str:
    """The link of Companion, on the same computer, that hears what is sent to the address `text`.

    At the other end of a serial line the device has another name: there is only a placeholder for it.
    """
    prefix = "" if _is_mavlink(name) else f"{name}:"
    if FORMATS[name].sent_as == "document":
        return prefix + text
    address = parse_address(text)
    if not isinstance(address, NetworkAddress):
        return f"{prefix}serial:/dev/NAME:{address.baud}"
    ends = {
        NetworkKind.UDP_OUT: NetworkKind.UDP_IN,
        NetworkKind.UDP_IN: NetworkKind.UDP_OUT,
        NetworkKind.TCP_IN: NetworkKind.TCP_OUT,
        NetworkKind.TCP_OUT: NetworkKind.TCP_IN,
    }
    kind = ends[address.kind]
    host = "127.0.0.1" if address.host in _EVERYWHERE else address.host
    return f"{prefix}{kind}:{f'[{host}]' if ':' in host else host}:{address.port}"


def local_address(name: str, port: int) -> str:
    """The usual address of a receiver of this format on this computer, with a port."""
    match FORMATS[name].sent_as:
        case "stream":
            return f"tcpin:127.0.0.1:{port}"
        case "document":
            return f"http://127.0.0.1:{port}/data/aircraft.json"
        case _:
            return f"udpout:127.0.0.1:{port}"


def named_output(text: str) -> tuple[str, str]:
    """Format and address in a text such as `gdl90:udpout:127.0.0.1:4000`; `LinkError` if it is none."""
    name, _, address = text.partition(":")
    if name not in FORMATS or not address:
        raise LinkError(f"{text}: use FORMAT:ADDRESS, with one of {', '.join(FORMATS)}")
    return name, address


def _is_mavlink(name: str) -> bool:
    return FORMATS[name].sent_as == "mavlink"


def _ignore(_frames: Sequence[Frame], _link: Link) -> None:
    return None
