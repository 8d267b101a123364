"""Links whose bytes arrive in callbacks: a bounded queue holds them until `run` processes them."""

import asyncio
import errno
from abc import abstractmethod
from collections import deque
from typing import Generic, TypeVar

from companion.errors import LinkDownError, LinkError
from companion.links.content import MAVLINK, Content
from companion.links.link import Link, OnFrames
from companion.links.sockets import error_text
from companion.mavlink.framing import Frame

_MAX_WAITING_BYTES = 1 << 20
# Waiting does not help: another program has the port, or the system forbids it.
_PERMANENT = frozenset({errno.EADDRINUSE, errno.EACCES, errno.EPERM})

Source = TypeVar("Source")


class QueuedLink(Link, Generic[Source]):
    """Opening, receiving and closing; the owner of the socket calls `arrived` and `failed`.

    `run` calls `on_frames`, not the event loop's callback: an error raised there would only be logged, and
    would not stop the service.
    """

    def __init__(self, address: str, *, listen_only: bool = False, content: Content = MAVLINK) -> None:
        super().__init__(address, listen_only=listen_only, content=content)
        self.closed = False
        self._waiting: deque[tuple[Source, bytes]] = deque()
        self._waiting_bytes = 0
        self._failure: str | None = None
        self._changed = asyncio.Event()
        self._opening = asyncio.Lock()  # `open` and `run` at the same time must not open two sockets

    async def open(self) -> None:
        """Open the link for sending and receiving; does nothing if it is open."""
        async with self._opening:
            if not (self.closed or self._is_open):
                await self._open()

    async def run(self, on_frames: OnFrames) -> None:
        """Pass received frames to `on_frames`, those of one datagram together, until `close`."""
        await self.open()
        while not self.closed:
            self._hand_over(on_frames)
            if self._failure is not None and not self._waiting:
                reason, self._failure = self._failure, None
                self._disconnect()
                raise LinkDownError(f"{self.address}: {reason}")
            if self._waiting:
                await asyncio.sleep(0)
                continue
            await self._changed.wait()
            self._changed.clear()

    def close(self) -> None:
        """Close for good; `run` returns. A second call does nothing."""
        self.closed = True
        self._disconnect()
        self._changed.set()

    def arrived(self, source: Source, data: bytes) -> None:
        """Queue a datagram, or the next piece of a stream; drop it if the queue is full."""
        size = self.content.piece_bytes
        for start in range(0, max(len(data), 1), size):
            piece = data[start : start + size]
            waiting_bytes = self._waiting_bytes + len(piece)
            if len(self._waiting) >= self.content.max_waiting or waiting_bytes > _MAX_WAITING_BYTES:
                self.counters.dropped += 1
                return
            self._waiting.append((source, piece))
            self._waiting_bytes = waiting_bytes
            self._changed.set()

    @property
    def has_room(self) -> bool:
        """Whether the next datagram would not be dropped."""
        return len(self._waiting) < self.content.max_waiting and self._waiting_bytes < _MAX_WAITING_BYTES

    def failed(self, reason: str) -> None:
        """The link is lost: `run` raises `LinkDownError` when the queue is empty."""
        self._failure = reason
        self._changed.set()

    async def _open(self) -> None:
        try:
            await self._connect()
        except UnicodeError as error:
            raise LinkError(f"{self.address}: this is not a host name") from error
        except OSError as error:
            kind = LinkError if error.errno in _PERMANENT else LinkDownError
            raise kind(f"{self.address}: {error_text(error)}") from error
        if self.closed:  # while it was being opened
            self._disconnect()

    def _hand_over(self, on_frames: OnFrames) -> None:
        received_before = self.counters.received_bytes
        while self._waiting and not self.closed:
            if self.counters.received_bytes - received_before >= self.content.bytes_at_once:
                break
            source, data = self._waiting.popleft()
            self._waiting_bytes -= len(data)
            self.counters.received_bytes += len(data)
            frames = self._split(source, data)
            if frames:
                on_frames(frames, self)

    @property
    @abstractmethod
    def _is_open(self) -> bool: ...

    @abstractmethod
    async def _connect(self) -> None:
        """Open the socket or port; `OSError` on failure."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Close what `_connect` opened; a second call does nothing."""

    @abstractmethod
    def _split(self, source: Source, data: bytes) -> list[Frame]:
        """The frames that these bytes complete."""
