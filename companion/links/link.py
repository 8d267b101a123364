"""What every link is: frames come in by a callback, bytes go out without waiting."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

from companion.mavlink.framing import Frame, StreamCounters


@dataclass(slots=True)
class LinkCounters(StreamCounters):
    """What came in and what went out, over all times that the link was opened.

    `dropped` pieces arrived faster than they were dealt with; `send_errors` are frames that did not go out.
    """

    received_bytes: int = 0
    dropped: int = 0
    sent_frames: int = 0
    sent_bytes: int = 0
    send_errors: int = 0


class Link(ABC):
    """One way to other MAVLink systems; nothing is ever sent on one that is `listen_only`.

    `await open()` (optional: `run` does it too) raises `LinkDownError` if the address does not work now, and
    another `LinkError` if it never will; `run` hands over whatever arrives until `close`, and raises
    `LinkDownError` when the link is lost, after which both may be tried again. What `on_frames` raises comes
    out of `run`. All in one event loop.
    """

    def __init__(self, address: str, *, listen_only: bool = False) -> None:
        self.address = address
        self.listen_only = listen_only
        self.counters = LinkCounters()

    def send(self, data: bytes) -> None:
        """Send one frame to everybody on this link. Never waits, never raises: errors are counted."""
        if not self.listen_only:
            self._send(data)

    @abstractmethod
    async def open(self) -> None:
        """Get ready to send and receive; a second time does nothing."""

    @abstractmethod
    async def run(self, on_frames: "OnFrames") -> None:
        """Hand over the frames that arrive, those of one datagram together, until `close`."""

    @abstractmethod
    def close(self) -> None:
        """Stop for good; `run` returns. A second time does nothing."""

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Send one frame, now or never: old setpoints are worth nothing. Errors are counted."""


OnFrames = Callable[[list[Frame], Link], None]
