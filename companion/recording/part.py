"""One part of a recording: a tlog, the decisions as JSON lines, and the same and more as MCAP."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from companion.mavlink.append_file import AppendOnlyFile
from companion.mavlink.tlog import TlogWriter
from companion.recording.mcap_file import McapFile, Note
from companion.recording.names import PartName


class Part:
    """The three files while they are written. `LogError` when one of them cannot be created."""

    def __init__(self, directory: Path, name: PartName) -> None:
        self.name = name
        with ExitStack() as undo:
            self.tlog = TlogWriter(name.path(directory, ".tlog"))
            undo.callback(self.tlog.close)
            self.lines = AppendOnlyFile(name.path(directory, ".jsonl"))
            undo.callback(self.lines.close)
            self.mcap = McapFile(name.path(directory, ".mcap"))
            undo.pop_all()

    @property
    def paths(self) -> tuple[Path, ...]:
        """Where they are."""
        return self.tlog.path, self.lines.path, self.mcap.path

    @property
    def problem(self) -> str | None:
        """Why something is missing in one of them."""
        return self.tlog.problem or self.lines.problem or self.mcap.problem

    @property
    def largest_bytes(self) -> int:
        """The size of the largest of them."""
        return max(self.tlog.size, self.lines.size, self.mcap.size)

    def sync(self, notes: Sequence[Note]) -> None:
        """Bring everything onto the disk, these notes too; slow."""
        self.mcap.flush(notes)
        self.tlog.sync()
        self.lines.sync()
        self.mcap.sync()

    def close(self) -> None:
        """Bring everything onto the disk and close."""
        self.tlog.close()
        self.lines.close()
        self.mcap.close()
