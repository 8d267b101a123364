"""The folder of recordings: names of files and parts, and the deletion of the oldest.

A file is `companion-20260101-120000.tlog`, its next part `companion-20260101-120000.part2.tlog`. Files with
other names are never deleted or changed.
"""

import contextlib
import itertools
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from companion.mavlink.append_file import is_being_written
from companion.small_file import writing_problem

SUFFIXES = (".tlog", ".jsonl", ".mcap")
_PATTERN = re.compile(
    r"companion-(?P<started>\d{8}-\d{6})(?:-(?P<count>\d{1,9}))?(?:\.part(?P<part>\d{1,9}))?"
    r"(?P<suffix>\.tlog|\.jsonl|\.mcap)",
    re.ASCII,
)


@dataclass(frozen=True, slots=True, order=True)
class PartName:
    """The name of one part of a recording; sorted by time of recording."""

    started: str
    count: int = 1  # of the recordings that began in the same second
    part: int = 1

    @property
    def stem(self) -> str:
        """The file name without suffix."""
        count = "" if self.count == 1 else f"-{self.count}"
        part = "" if self.part == 1 else f".part{self.part}"
        return f"companion-{self.started}{count}{part}"

    def next(self) -> "PartName":
        """The name of the next part."""
        return replace(self, part=self.part + 1)

    def next_free(self, directory: Path) -> "PartName":
        """The first later part without a file in the folder."""
        name = self.next()
        while name.exists_in(directory):
            name = name.next()
        return name

    def path(self, directory: Path, suffix: str) -> Path:
        """The path of the file with this suffix."""
        return directory / f"{self.stem}{suffix}"

    def exists_in(self, directory: Path) -> bool:
        """Whether the folder has at least one file of this part."""
        return any(self.path(directory, suffix).exists() for suffix in SUFFIXES)

    @staticmethod
    def parse(file_name: str) -> "PartName | None":
        """The part that a file belongs to; `None` if its name is not one that Companion gives."""
        match = _PATTERN.fullmatch(file_name)
        if match is None:
            return None
        name = PartName(match["started"], int(match["count"] or 1), int(match["part"] or 1))
        return name if f"{name.stem}{match['suffix']}" == file_name else None


def free_name(directory: Path, started_unix_s: float) -> PartName:
    """The first free name for this start; a clock without a battery may start twice at the same time."""
    started = f"{datetime.fromtimestamp(started_unix_s, UTC):%Y%m%d-%H%M%S}"
    return next(
        name
        for name in (PartName(started, count) for count in itertools.count(1))
        if not name.exists_in(directory)
    )


def parts_in(directory: Path) -> dict[PartName, list[Path]]:
    """All parts in a folder, oldest first, each with its files."""
    found: dict[PartName, list[Path]] = {}
    for path in sorted(_files(directory)):
        name = PartName.parse(path.name)
        if name is not None:
            found.setdefault(name, []).append(path)
    return dict(sorted(found.items()))


def later_parts(path: Path) -> list[Path]:
    """The files that continue this one, up to the first missing part."""
    name = PartName.parse(path.name)
    later: list[Path] = []
    while name is not None:
        name = name.next()
        following = name.path(path.parent, path.suffix)
        if not following.is_file():
            break
        later.append(following)
    return later


def recording_problem(directory: Path) -> str | None:
    """The reason why nothing can be recorded in a folder, `None` when it can; nothing is left behind.

    A folder that is missing would be made, so that its nearest parent counts.
    """
    nearest = next((each for each in (directory, *directory.absolute().parents) if each.exists()), directory)
    if not nearest.is_dir():
        return "not a folder"
    return writing_problem(nearest / "companion-recording")


def remove_oldest(directory: Path, max_total_bytes: int, keep: Collection[Path] = ()) -> list[Path]:
    """Delete whole parts, oldest first, until the rest fits; returns the deleted files.

    Parts that are being written, by us (`keep`) or by another process, are not deleted.
    """
    parts = parts_in(directory)
    sizes = {path: _size(path) for paths in parts.values() for path in paths}
    total, removed = sum(sizes.values()), []
    for paths in parts.values():
        if total <= max_total_bytes:
            break
        if any(path in keep or is_being_written(path) for path in paths):
            continue
        for path in paths:
            with contextlib.suppress(OSError):
                path.unlink()
                removed.append(path)
                total -= sizes[path]
    return removed


def _files(directory: Path) -> Iterable[Path]:
    return (path for path in directory.iterdir() if path.is_file() and not path.is_symlink())


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
