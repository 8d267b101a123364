"""Links whose bytes come by callbacks: they wait in a bounded queue until `run` takes them."""

import asyncio
import errno
import os
from abc import abstractmethod
from collections import deque
from typing import Generic, TypeVar

from companion.errors import LinkDownError, LinkError
from companion.links.link import Link, OnFrames
from companion.mavlink.framing import Frame

_MAX_WAITING = 512  # about a second of a busy link
_MAX_WAITING_BYTES = 1 << 20
_BYTES_AT_ONCE = 32_768  # junk costs a microsecond a byte: however much there is, ticks come in between
# Waiting does not help: another program has the port, or the system forbids it.
_HOPELESS = frozenset({errno.EADDRINUSE, errno.EACCES, errno.EPERM})

Source = TypeVar("Source")


class QueuedLink(Link, Generic[Source]):
    """Opening, receiving and closing; whoever holds the socket calls `arrived` and `failed`.

    The frames are handed over from `run` and not from the event loop's callback, because there an error in
    `on_frames` would be logged and forgotten instead of stopping the service.
    """

    def __init__(self, address: str, *, listen_only: bool = False) -> None:
        super().__init__(address, listen_only=listen_only)
        self.closed = False
        self._waiting: deque[tuple[Source, bytes]] = deque()
        self._waiting_bytes = 0
        self._failure: str | None = None
        self._news = asyncio.Event()
        self._opening = asyncio.Lock()  # `open` and `run` may meet: one socket, not two

    async def open(self) -> None:
        """Get ready to send and receive; a second time does nothing."""
        async with self._opening:
            if not (self.closed or self._is_open):
                await self._open()

    async def run(self, on_frames: OnFrames) -> None:
        """Hand over the frames that arrive, those of one datagram together, until `close`."""
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
            await self._news.wait()
            self._news.clear()

    def close(self) -> None:
        """Stop for good; `run` returns. A second time does nothing."""
        self.closed = True
        self._disconnect()
        self._news.set()

    def arrived(self, source: Source, data: bytes) -> None:
        """A datagram, or the next piece of a stream, came in."""
        if len(self._waiting) >= _MAX_WAITING or self._waiting_bytes + len(data) > _MAX_WAITING_BYTES:
            self.counters.dropped += 1
            return
        self._waiting.append((source, data))
        self._waiting_bytes += len(data)
        self._news.set()

    def failed(self, reason: str) -> None:
        """Nothing will come in any more, unless it is opened again."""
        self._failure = reason
        self._news.set()

    async def _open(self) -> None:
        try:
            await self._connect()
        except UnicodeError as error:
            raise LinkError(f"{self.address}: this is no host name") from error
        except OSError as error:
            kind = LinkError if error.errno in _HOPELESS else LinkDownError
            raise kind(f"{self.address}: {in_words(error)}") from error
        if self.closed:  # meanwhile
            self._disconnect()

    def _hand_over(self, on_frames: OnFrames) -> None:
        received_before = self.counters.received_bytes
        while self._waiting and not self.closed:
            if self.counters.received_bytes - received_before >= _BYTES_AT_ONCE:
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
        """Open the socket or port; `OSError` when that fails."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Let go of what `_connect` opened; a second time does nothing."""

    @abstractmethod
    def _split(self, source: Source, data: bytes) -> list[Frame]:
        """The frames that these bytes complete."""


def in_words(error: OSError) -> str:
    """Why it failed, without numbers and addresses: those of a name that is not found are negative."""
    if isinstance(error, TimeoutError):
        return "no answer"
    if error.errno is not None and error.errno > 0:
        return os.strerror(error.errno)
    return error.strerror or str(error) or type(error).__name__
