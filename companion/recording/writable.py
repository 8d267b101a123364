"""Whether files can be written, found out before the work instead of at its end or in flight."""

import contextlib
import tempfile
from pathlib import Path


def why_not_writable(path: Path) -> str | None:
    """The reason why a file cannot be written; `None` if it can. Leaves an existing file as it is."""
    if not path.parent.is_dir():
        return f"there is no folder {path.parent}"
    if path.is_dir():
        return "this is a folder, not a file"
    if path.exists() and not path.is_file():
        return None  # a device
    try:
        if path.exists():
            with path.open("ab"):
                return None
        with path.open("xb"):
            pass
    except OSError as error:
        return error.strerror or str(error)
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def why_no_new_file(folder: Path, *, made: bool = False) -> str | None:
    """The reason why no file can be created in a folder; `made`: the folder itself may be missing yet."""
    if made:
        while not folder.exists() and folder.parent != folder:
            folder = folder.parent
    if not folder.is_dir():
        return f"there is no folder {folder}"
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"0")
    except OSError as error:
        return error.strerror or str(error)
    return None
