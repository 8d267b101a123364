"""A document that others read again and again, such as aircraft.json: served by HTTP, or in a file."""

import asyncio
import contextlib
from abc import abstractmethod
from pathlib import Path
from urllib.parse import urlsplit

from companion.errors import LinkDownError, LinkError
from companion.links import Link, OnFrames
from companion.links.sockets import error_text

_LONGEST_REQUEST_BYTES, _LONGEST_REQUEST_S = 16_384, 5.0
_HEAD = (
    "HTTP/1.1 {status}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\n"
    "Connection: close\r\n\r\n"
)


class _DocumentOutput(Link):
    """A link on which each piece that is sent takes the place of the one before."""

    def __init__(self, address: str) -> None:
        super().__init__(address)
        self._closed = asyncio.Event()

    async def run(self, on_frames: OnFrames) -> None:  # noqa: ARG002 - nothing arrives
        """Wait for `close`."""
        await self.open()
        await self._closed.wait()

    def close(self) -> None:
        """Close for good; `run` returns. A second call does nothing."""
        self._closed.set()

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Replace the document."""


class DocumentFile(_DocumentOutput):
    """Writes the document to a file; readers see the old one or the new one, whole."""

    def __init__(self, address: str, path: str) -> None:
        super().__init__(address)
        self._path = Path(path)
        self._new_path = self._path.with_name(f"{self._path.name}.new")

    async def open(self) -> None:
        """`LinkDownError` if there is no such folder."""
        if not self._path.parent.is_dir():
            raise LinkDownError(f"{self.address}: no folder {self._path.parent}")

    def _send(self, data: bytes) -> None:
        try:
            self._new_path.write_bytes(data)
            self._new_path.replace(self._path)
        except OSError:
            self.counters.send_errors += 1
            return
        self.counters.sent_frames += 1
        self.counters.sent_bytes += len(data)


class DocumentServer(_DocumentOutput):
    """Serves the newest document at a URL; without one yet, the answer is 503."""

    def __init__(self, address: str, url: str) -> None:
        """`LinkError` for https: there is no certificate."""
        super().__init__(address)
        self._url = urlsplit(url)
        self._document: bytes | None = None
        self._server: asyncio.Server | None = None
        self._opening = asyncio.Lock()  # `open` and `run` at the same time
        if self._url.scheme != "http":
            raise LinkError(f"{address}: only http can be served here")

    async def open(self) -> None:
        """Listen; `LinkError` if the port is in use or forbidden."""
        async with self._opening:
            if self._server is None and not self._closed.is_set():
                await self._listen()

    async def _listen(self) -> None:
        host, port = self._url.hostname, self._url.port or 80
        try:
            self._server = await asyncio.start_server(self._answer, host, port, limit=_LONGEST_REQUEST_BYTES)
        except OSError as error:
            raise LinkError(f"{self.address}: {error_text(error)}") from error

    def close(self) -> None:
        """Close for good; `run` returns. A second call does nothing."""
        super().close()
        if self._server is not None:
            self._server.close()

    def _send(self, data: bytes) -> None:
        self._document = data
        self.counters.sent_frames += 1
        self.counters.sent_bytes += len(data)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        failures = (TimeoutError, OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError)
        with contextlib.suppress(*failures), contextlib.closing(writer):
            async with asyncio.timeout(_LONGEST_REQUEST_S):
                request = await reader.readuntil(b"\r\n\r\n")
                writer.write(self._answer_to(request))
                await writer.drain()

    def _answer_to(self, request: bytes) -> bytes:
        method, _, rest = request.decode("latin-1").partition(" ")
        path = urlsplit(rest.partition(" ")[0]).path
        document = self._document
        if method not in ("GET", "HEAD"):
            status = "405 Method Not Allowed"
        elif path != (self._url.path or "/"):
            status = "404 Not Found"
        else:
            status = "503 Service Unavailable" if document is None else "200 OK"
        body = document if document is not None and status.startswith("200") else b""
        head = _HEAD.format(status=status, length=len(body)).encode("ascii")
        return head if method == "HEAD" else head + body
