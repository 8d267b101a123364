"""Keeps a folder of recordings within its limit: the oldest go first."""

import contextlib
from collections.abc import Collection
from pathlib import Path

from companion.mavlink.append_file import is_being_written
from companion.recording.names import parts_in


def remove_oldest(directory: Path, max_total_bytes: int, but: Collection[Path] = ()) -> list[Path]:
    """Delete whole parts until no more is there than that; what was deleted.

    Never what is being written, by us (`but`) or by another process, and nothing that is not named as
    recordings are.
    """
    parts = parts_in(directory)
    sizes = {path: _size(path) for paths in parts.values() for path in paths}
    total, removed = sum(sizes.values()), []
    for paths in parts.values():
        if total <= max_total_bytes:
            break
        if any(path in but or is_being_written(path) for path in paths):
            continue
        for path in paths:
            with contextlib.suppress(OSError):
                path.unlink()
                removed.append(path)
                total -= sizes[path]
    return removed


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
