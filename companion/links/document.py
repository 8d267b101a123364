"""Documents that are read once a second, by HTTP or from a file, such as readsb's aircraft.json."""

import asyncio
import contextlib
import http.client
import os
import ssl
import stat
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import IO, TypeVar
from urllib.parse import urlsplit

from companion.address import DocumentAddress
from companion.errors import LinkDownError
from companion.links.content import Content
from companion.links.link import Link, OnFrames
from companion.links.sockets import error_text

_T = TypeVar("_T")
_MAX_BYTES = 8 << 20
_PART_BYTES = 1 << 16
# For a connection, and for the next bytes; the whole document has twice as long.
_LONGEST_SILENCE_S, _LONGEST_S = 2.0, 4.0
_LONGEST_REASON = 160
# A path may hold a FIFO, which would be waited for.
_READ_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC


class DocumentLink(Link):
    """Passes each new content of a document to its reader; one that did not change gives nothing.

    A thread reads it, so that neither a server nor a disk keeps the flight waiting.
    """

    def __init__(self, address: str, document: DocumentAddress, content: Content) -> None:
        super().__init__(address, listen_only=True, content=content)
        self._read = _reader_of(document)
        self._period_s = content.document_period_s
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="document")
        self._waiting: bytes | None = None  # read by `open`, for `run`
        self._last = b""
        self._closed = asyncio.Event()
        self._opening = asyncio.Lock()  # `open` and `run` at the same time

    async def open(self) -> None:
        """Read the document for the first time; does nothing if that was done."""
        async with self._opening:
            if self._waiting is None and not self._closed.is_set():
                self._waiting = await self._fetch()

    async def run(self, on_frames: OnFrames) -> None:
        """Pass each new content to the reader until `close`."""
        await self.open()
        reader, document = self.content.new_reader(self.counters), self._waiting
        self._waiting = None
        while document is not None and not self._closed.is_set():
            read_s = time.monotonic()
            if document != self._last:
                self._last = document
                self.counters.received_bytes += len(document)
                for part in await self._in_thread(partial(self.content.divide, document)):
                    frames = reader.feed(part)
                    if frames:
                        on_frames(frames, self)
                    await asyncio.sleep(0)  # ticks stay on time
            with contextlib.suppress(TimeoutError):
                wait_s = max(self._period_s - (time.monotonic() - read_s), 0.0)
                await asyncio.wait_for(self._closed.wait(), wait_s)
            if self._closed.is_set():  # perhaps at the same moment as the time was up
                return
            document = await self._fetch()

    def close(self) -> None:
        """Close for good; `run` returns. A second call does nothing."""
        self._closed.set()
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _send(self, data: bytes) -> None:
        """Never called: it only listens."""

    async def _in_thread(self, work: Callable[[], _T]) -> _T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    async def _fetch(self) -> bytes:
        try:
            return await self._in_thread(self._read)
        except (OSError, http.client.HTTPException, ValueError) as error:
            raise LinkDownError(f"{self.address}: {_reason(error)}") from error


class _SameScheme(urllib.request.HTTPRedirectHandler):
    """Follows redirects, but not from http to another scheme, such as that of files."""

    def redirect_request(
        self,
        req: urllib.request.Request,
        fp: IO[bytes],
        code: int,
        msg: str,
        headers: http.client.HTTPMessage,
        newurl: str,
    ) -> urllib.request.Request | None:
        """The request to follow; `OSError` if there must be none."""
        if urlsplit(newurl).scheme != req.type:
            fp.close()
            raise OSError(None, f"it redirects to {newurl}: use that address")
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def _reader_of(document: DocumentAddress) -> Callable[[], bytes]:
    if document.path is not None:
        path = document.path
        return lambda: _read_file(path)
    assert document.url is not None
    url = document.url
    # Receivers are near: no proxy.
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}), _SameScheme())
    return lambda: _read_url(opener, url)


def _read_file(path: str) -> bytes:
    descriptor = os.open(path, _READ_FLAGS)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(None, "not a regular file")
        content = bytearray()
        while part := os.read(descriptor, _PART_BYTES):
            content += part
            _refuse_larger(content)
        return bytes(content)
    finally:
        os.close(descriptor)


def _read_url(opener: urllib.request.OpenerDirector, url: str) -> bytes:
    until_s = time.monotonic() + _LONGEST_S
    with opener.open(url, timeout=_LONGEST_SILENCE_S) as answer:
        content = bytearray()
        while part := answer.read1(_PART_BYTES):
            content += part
            _refuse_larger(content)
            if time.monotonic() > until_s:
                raise TimeoutError
        if answer.length:  # what its header promised and did not come
            raise OSError(None, "the document was cut off")
        return bytes(content)


def _refuse_larger(content: bytearray) -> None:
    if len(content) > _MAX_BYTES:
        raise OSError(None, f"larger than {_MAX_BYTES >> 20} MB")


def _reason(error: Exception) -> str:
    if isinstance(error, urllib.error.HTTPError):
        error.close()
        return f"the server answers {error.code}"
    if isinstance(error, urllib.error.URLError) and isinstance(error.reason, OSError):
        error = error.reason
    if isinstance(error, ssl.SSLError):
        return f"TLS: {getattr(error, 'verify_message', None) or error.reason}"
    text = error_text(error) if isinstance(error, OSError) else f"no HTTP answer: {error!r}"
    # Parts of it are the words of the server.
    return "".join(each if each.isprintable() else " " for each in text[:_LONGEST_REASON])
