"""The interface of all links: frames arrive in a callback, and sending never waits."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from companion.links.content import MAVLINK, Content
from companion.links.rank import Address
from companion.mavlink.framing import Frame, StreamCounters


@dataclass(slots=True)
class LinkCounters(StreamCounters):
    """Counts of what was received and sent since the link was made.

    `dropped` counts datagrams (or pieces of a stream) that arrived faster than they were processed;
    `send_errors` counts frames that were not sent.
    """

    received_bytes: int = 0
    dropped: int = 0
    sent_frames: int = 0
    sent_bytes: int = 0
    send_errors: int = 0


class Link(ABC):
    """A connection to other MAVLink systems; a `listen_only` link never sends.

    `await open()` (optional, as `run` opens the link too) raises `LinkDownError` if the address does not work
    now, and another `LinkError` if it never will. `run` passes received frames on until `close`, and raises
    `LinkDownError` when the link is lost; then both may be called again. Errors of `on_frames` are raised by
    `run`. All calls must be made in one event loop.
    """

    def __init__(self, address: str, *, listen_only: bool = False, content: Content = MAVLINK) -> None:
        self.address = address
        self.listen_only = listen_only
        self.content = content
        self.counters = LinkCounters()
        self.ours: Address | None = None  # the autopilot that is flown: it always keeps its place as a peer

    def send(self, data: bytes) -> None:
        """Send one frame to all peers on this link. Never waits, never raises: errors are counted."""
        if not self.listen_only:
            self._send(data)

    @abstractmethod
    async def open(self) -> None:
        """Open the link for sending and receiving; does nothing if it is open."""

    @abstractmethod
    async def run(self, on_frames: "OnFrames") -> None:
        """Pass received frames to `on_frames`, those of one datagram together, until `close`."""

    @abstractmethod
    def close(self) -> None:
        """Close for good; `run` returns. A second call does nothing."""

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Send one frame now or drop it, because an old setpoint is worthless. Errors are counted."""


OnFrames = Callable[[list[Frame], Link], None]
