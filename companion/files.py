"""Files: whether a path can be written, and small files that one run leaves to the next.

A path may hold anything: a FIFO would be waited for, and a device or an endless file read for ever. Nothing
here waits for a path. What cannot be written is found out before the work, not at its end or in flight.
"""

import contextlib
import os
import stat
import tempfile
from pathlib import Path

MAX_BYTES = 1 << 16
_READ_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
# Without O_TRUNC: a FIFO or device in the way is found before anything is written.
_WRITE_FLAGS = os.O_WRONLY | os.O_CREAT | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
_NOT_A_FILE = "not a regular file"


def read_small(path: Path) -> bytes:
    """The content; `FileNotFoundError` without a file, `OSError` with its reason in `strerror` otherwise."""
    descriptor = os.open(path, _READ_FLAGS)
    try:
        mode = os.fstat(descriptor).st_mode
        if not stat.S_ISREG(mode):
            raise _error("a folder" if stat.S_ISDIR(mode) else _NOT_A_FILE)
        content = b""
        while len(content) <= MAX_BYTES:
            more = os.read(descriptor, MAX_BYTES + 1 - len(content))
            if not more:
                return content
            content += more
        raise _error(f"larger than {MAX_BYTES} bytes")
    finally:
        os.close(descriptor)


def replace_small(path: Path, content: bytes, *, durable: bool) -> None:
    """Replace the content as a whole; `durable`: it is on the disk before. `OSError` when that fails."""
    _require_replaceable(path)
    new = path.with_name(f"{path.name}.new")
    descriptor = os.open(new, _WRITE_FLAGS, 0o644)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise _error(_NOT_A_FILE)
        os.ftruncate(descriptor, 0)
        written = 0
        while written < len(content):
            written += os.write(descriptor, content[written:])
        if durable:
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
    os.replace(new, path)  # noqa: PTH105 - documented to be atomic


def why_not_writable(path: Path) -> str | None:
    """The reason why a file cannot be written; `None` if it can. Leaves an existing file as it is."""
    if (why := _why_no_place(path)) is not None:
        return why
    if path.exists() and not path.is_file():
        return None  # a device
    try:
        if path.exists():
            with path.open("ab"):
                return None
        with path.open("xb"):
            pass
    except OSError as error:
        return reason(error)
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def why_not_replaceable(path: Path) -> str | None:
    """The reason why `replace_small` would fail, found by writing beside the file; `None` if it would not."""
    if (why := _why_no_place(path)) is not None:
        return why
    trial = path.with_name(f"{path.name}.try")
    try:
        _require_replaceable(path)
        replace_small(trial, b"", durable=False)
        trial.unlink()
    except OSError as error:
        return reason(error)
    return None


def why_no_new_file(folder: Path) -> str | None:
    """The reason why no file can be created in a folder that may be missing yet; `None` if one can."""
    while not folder.exists() and folder.parent != folder:
        folder = folder.parent
    if not folder.is_dir():
        return f"there is no folder {folder}"
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"0")
    except OSError as error:
        return reason(error)
    return None


def set_aside(path: Path) -> Path | None:
    """Rename a file that cannot be used to `….bad`; its new path, `None` if it stays where it is.

    Devices and folders stay: they are not ours, and someone may have put them there on purpose.
    """
    bad = path.with_name(f"{path.name}.bad")
    try:
        mode = path.lstat().st_mode
        if stat.S_ISDIR(mode) or stat.S_ISCHR(mode) or stat.S_ISBLK(mode):
            return None
        os.replace(path, bad)  # noqa: PTH105 - replaces an older one
    except OSError:
        return None
    return bad


def reason(error: OSError) -> str:
    """The reason of an error, without the path."""
    return error.strerror or str(error)


def _why_no_place(path: Path) -> str | None:
    """The reason why no file can be at this path."""
    if not path.parent.is_dir():
        return f"there is no folder {path.parent}"
    return "this is a folder, not a file" if path.is_dir() else None


def _require_replaceable(path: Path) -> None:
    """`OSError` if something other than a file is there: as root, even a device would be replaced."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return
    if not stat.S_ISREG(mode):
        raise _error(_NOT_A_FILE)


def _error(words: str) -> OSError:
    return OSError(None, words)
