"""Writes the MCAP file of a recording: JSON messages with their schemas, in compressed chunks.

A file that ends after a whole chunk is readable. A file that was closed also has a summary, with which other
programs open it quickly.
"""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from mcap.writer import CompressionType, Writer

from companion import __version__
from companion.mavlink.append_file import AppendOnlyFile
from companion.recording.schemas import TOPICS, Topic

LIBRARY = f"companion {__version__}"
_LAST_NS = 0xFFFF_FFFF_FFFF_FFFF


class McapMessage(NamedTuple):
    """A JSON message on a topic, with its time."""

    topic: Topic
    time_us: int
    text: str


class McapWriter:
    """A new file, as safe as an `AppendOnlyFile`; `LogError` if it cannot be created.

    Not thread-safe.
    """

    def __init__(self, path: Path) -> None:
        self._file = AppendOnlyFile(path)
        self._buffer = _Buffer()
        self._complete = True  # the file has everything that the writer wrote
        self._closed = False
        self._begin()
        self._append()

    @property
    def path(self) -> Path:
        """The path of the file."""
        return self._file.path

    @property
    def size(self) -> int:
        """The size of the file in bytes."""
        return self._file.size

    @property
    def problem(self) -> str | None:
        """The newest disk error."""
        return self._file.problem

    def write(self, messages: Sequence[McapMessage]) -> None:
        """Append the messages as one chunk, whole or not at all."""
        if self._closed:
            return
        for topic, time_us, text in messages:
            time_ns = min(max(time_us, 0) * 1000, _LAST_NS)
            data = text.encode(errors="backslashreplace")
            self._writer.add_message(self._channels[topic.name], time_ns, data, time_ns)
        self._writer.flush()
        self._append()

    def sync(self) -> None:
        """Write everything to the disk; this may take long."""
        self._file.sync()

    def close(self) -> None:
        """Add the summary and close; a second call does nothing."""
        if not self._closed and self._complete:
            self._writer.finish()
            self._append()
        self._closed = True
        self._file.close()

    def _begin(self) -> None:
        """Start a new library writer, whose first chunk has the schemas."""
        self._buffer.clear()
        self._writer = Writer(self._buffer, compression=CompressionType.LZ4)
        self._writer.start(library=LIBRARY)
        self._head = self._buffer.take()
        self._channels = {
            topic.name: self._writer.register_channel(
                topic.name,
                "json",
                self._writer.register_schema(topic.schema_name, "jsonschema", topic.schema_text),
            )
            for topic in TOPICS
        }

    def _append(self) -> None:
        """Move the buffered bytes to the file."""
        data = self._buffer.take()
        failures = self._file.failures
        self._file.append(data if self._file.size else self._head + data)
        if self._file.failures > failures:
            # A summary would count bytes that are missing. Without one the file is like a truncated file; its
            # next chunk must be readable without the missing one.
            self._complete = False
            self._begin()


class _Buffer(io.BytesIO):
    """Bytes of the library writer that are not in the file yet; positions count from the file's start."""

    def __init__(self) -> None:
        super().__init__()
        self._taken = 0

    def tell(self) -> int:
        """The position of the next byte in the file."""
        return self._taken + super().tell()

    def take(self) -> bytes:
        """Remove and return the buffered bytes."""
        data = self.getvalue()
        self._taken += len(data)
        self._empty()
        return data

    def clear(self) -> None:
        """Start a new file."""
        self._taken = 0
        self._empty()

    def _empty(self) -> None:
        self.seek(0)
        self.truncate()
