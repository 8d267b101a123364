"""The MCAP file of a recording: JSON messages with their schemas, in compressed chunks.

A file that ends after any whole chunk is readable; one that was closed has its summary too, by which other
programs open it at once.
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


class Note(NamedTuple):
    """A message to be: what there is to say on a topic at a time, in JSON."""

    topic: Topic
    time_us: int
    text: str


class McapFile:
    """A new file, as safe as `AppendOnlyFile`; what is noted reaches it by `flush`, one chunk a time.

    `LogError` when it cannot be created. One thread at a time.
    """

    def __init__(self, path: Path) -> None:
        self._file = AppendOnlyFile(path)
        self._made = _Made()
        self._whole = True  # nothing that the writer made is missing in the file
        self._closed = False
        self._begin()
        self._append()

    @property
    def path(self) -> Path:
        """Where it is."""
        return self._file.path

    @property
    def size(self) -> int:
        """How many bytes it has."""
        return self._file.size

    @property
    def problem(self) -> str | None:
        """The newest error of the disk."""
        return self._file.problem

    def flush(self, notes: Sequence[Note]) -> None:
        """Append these as a chunk, whole or not at all."""
        if self._closed:
            return
        for topic, time_us, text in notes:
            time_ns = min(max(time_us, 0) * 1000, _LAST_NS)
            data = text.encode(errors="backslashreplace")
            self._writer.add_message(self._channels[topic.name], time_ns, data, time_ns)
        self._writer.flush()
        self._append()

    def sync(self) -> None:
        """Bring everything onto the disk; slow."""
        self._file.sync()

    def close(self) -> None:
        """Add the summary and close; a second time does nothing."""
        if not self._closed and self._whole:
            self._writer.finish()
            self._append()
        self._closed = True
        self._file.close()

    def _begin(self) -> None:
        """A writer, which says its schemas in its first chunk."""
        self._made.clear()
        self._writer = Writer(self._made, compression=CompressionType.LZ4)
        self._writer.start(library=LIBRARY)
        self._head = self._made.take()
        self._channels = {
            topic.name: self._writer.register_channel(
                topic.name,
                "json",
                self._writer.register_schema(topic.schema_name, "jsonschema", topic.schema_text),
            )
            for topic in TOPICS
        }

    def _append(self) -> None:
        """What was made, onto the file."""
        made = self._made.take()
        failures = self._file.failures
        self._file.append(made if self._file.size else self._head + made)
        if self._file.failures > failures:
            # A summary would count bytes that are not there. Without it the file is one that was cut off, and
            # its next chunk stands for itself.
            self._whole = False
            self._begin()


class _Made(io.BytesIO):
    """What the writer made and nobody took yet; it counts from the beginning of the file."""

    def __init__(self) -> None:
        super().__init__()
        self._taken = 0

    def tell(self) -> int:
        """Where in the file the next byte goes."""
        return self._taken + super().tell()

    def take(self) -> bytes:
        """Everything since the last time."""
        made = self.getvalue()
        self._taken += len(made)
        self._empty()
        return made

    def clear(self) -> None:
        """Begin a file anew."""
        self._taken = 0
        self._empty()

    def _empty(self) -> None:
        self.seek(0)
        self.truncate()
