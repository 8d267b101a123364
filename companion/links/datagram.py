"""Links of datagrams: what arrives waits in a bounded queue until `run` hands it over."""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from companion.errors import LinkError
from companion.links.link import Link, OnFrames
from companion.links.peers import Peers

_MAX_WAITING = 512  # about a second of a busy link

Address = TypeVar("Address", bound=Hashable)


class DatagramLink(Link, Generic[Address]):
    """The receiving half of a datagram link: whoever opens the socket calls `arrived` and `failed`.

    The frames are handed over from `run` and not from the event loop's callback, because there an error in
    `on_frames` would be logged and forgotten instead of stopping the service.
    """

    def __init__(self, address: str, clock_s: Callable[[], float] = time.monotonic) -> None:
        super().__init__(address)
        self.peers: Peers[Address] = Peers(self.counters, clock_s)
        self.closed = False
        self._waiting: deque[tuple[Address, bytes]] = deque()
        self._failure: str | None = None
        self._news = asyncio.Event()

    def arrived(self, peer: Address, datagram: bytes) -> None:
        """A datagram came in."""
        if len(self._waiting) >= _MAX_WAITING:
            self.counters.dropped += 1
            return
        self._waiting.append((peer, datagram))
        self._news.set()

    def failed(self, reason: str) -> None:
        """Nothing will ever come in again."""
        self._failure = reason
        self._news.set()

    async def run(self, on_frames: OnFrames) -> None:
        """Hand over the frames that arrive, those of one datagram together, until `close`."""
        await self.open()
        while not self.closed:
            self._hand_over(on_frames)
            if self._failure is not None:
                raise LinkError(f"{self.address}: {self._failure}")
            await self._news.wait()
            self._news.clear()

    def close(self) -> None:
        """Stop; `run` returns. A second time does nothing."""
        self.closed = True
        self._news.set()

    def _hand_over(self, on_frames: OnFrames) -> None:
        while self._waiting and not self.closed:
            peer, datagram = self._waiting.popleft()
            self.counters.received_bytes += len(datagram)
            frames = self.peers.split(peer, datagram)
            if frames:
                on_frames(frames, self)
