"""The names of a recording's files: `companion-20260101-120000.tlog`, its next part `….part2.tlog`.

Only what is named so is ever deleted or completed.
"""

import itertools
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

SUFFIXES = (".tlog", ".jsonl", ".mcap")
_PATTERN = re.compile(
    r"companion-(?P<started>\d{8}-\d{6})(?:-(?P<count>\d{1,9}))?(?:\.part(?P<part>\d{1,9}))?"
    r"(?P<suffix>\.tlog|\.jsonl|\.mcap)",
    re.ASCII,
)


@dataclass(frozen=True, slots=True, order=True)
class PartName:
    """One part of a recording; the order is that of recording."""

    started: str
    count: int = 1  # of those that began in the same second
    part: int = 1

    @property
    def stem(self) -> str:
        """The name of its files, without suffix."""
        again = "" if self.count == 1 else f"-{self.count}"
        later = "" if self.part == 1 else f".part{self.part}"
        return f"companion-{self.started}{again}{later}"

    def next(self) -> "PartName":
        """The part after this one."""
        return replace(self, part=self.part + 1)

    def next_free(self, directory: Path) -> "PartName":
        """The next part of which no file is there."""
        name = self.next()
        while name.taken(directory):
            name = name.next()
        return name

    def path(self, directory: Path, suffix: str) -> Path:
        """One of its files."""
        return directory / f"{self.stem}{suffix}"

    def taken(self, directory: Path) -> bool:
        """Whether any of its files is there; a part of a set is enough."""
        return any(self.path(directory, suffix).exists() for suffix in SUFFIXES)

    @staticmethod
    def of(file_name: str) -> "PartName | None":
        """Whose file this is; `None` for what is named otherwise, as by nobody of ours."""
        match = _PATTERN.fullmatch(file_name)
        if match is None:
            return None
        name = PartName(match["started"], int(match["count"] or 1), int(match["part"] or 1))
        return name if f"{name.stem}{match['suffix']}" == file_name else None


def free_name(directory: Path, started_unix_s: float) -> PartName:
    """The first name that is not taken: a clock without battery starts twice at one time."""
    started = f"{datetime.fromtimestamp(started_unix_s, UTC):%Y%m%d-%H%M%S}"
    return next(
        name
        for name in (PartName(started, count) for count in itertools.count(1))
        if not name.taken(directory)
    )


def parts_in(directory: Path) -> dict[PartName, list[Path]]:
    """All parts in a folder, oldest first, each with those of its files that are there."""
    found: dict[PartName, list[Path]] = {}
    for path in sorted(_files(directory)):
        name = PartName.of(path.name)
        if name is not None:
            found.setdefault(name, []).append(path)
    return dict(sorted(found.items()))


def later_parts(path: Path) -> list[Path]:
    """The files that go on where this one ends, as far as they are there without a gap."""
    name = PartName.of(path.name)
    later: list[Path] = []
    while name is not None:
        name = name.next()
        following = name.path(path.parent, path.suffix)
        if not following.is_file():
            break
        later.append(following)
    return later


def _files(directory: Path) -> Iterable[Path]:
    return (path for path in directory.iterdir() if path.is_file() and not path.is_symlink())
