"""What every link is: frames come in by a callback, bytes go out without waiting."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from companion.mavlink.framing import Frame, StreamCounters


@dataclass(slots=True)
class LinkCounters(StreamCounters):
    """What came in and what went out. `dropped` datagrams arrived faster than they were dealt with."""

    received_bytes: int = 0
    dropped: int = 0
    sent_frames: int = 0
    sent_bytes: int = 0
    send_errors: int = 0


class Link(ABC):
    """One way to other MAVLink systems.

    `await open()` (optional: `run` does it too) raises `LinkError` if the address cannot be used; `run` hands
    over whatever arrives until `close`; what `on_frames` raises comes out of `run`. All in one event loop.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.counters = LinkCounters()

    @abstractmethod
    async def open(self) -> None:
        """Get ready to send and receive; a second time does nothing."""

    @abstractmethod
    async def run(self, on_frames: "OnFrames") -> None:
        """Hand over the frames that arrive, those of one datagram together, until `close`."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send one frame to everybody on this link. Never waits, never raises: errors are counted."""

    @abstractmethod
    def close(self) -> None:
        """Stop; `run` returns. A second time does nothing."""


OnFrames = Callable[[list[Frame], Link], None]
