"""Small files that one run leaves to the next: read, replaced and set aside without ever waiting for a path.

A path may hold anything: a FIFO would be waited for, and a device or an endless file read for ever.
"""

import os
import stat
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


def writing_problem(path: Path) -> str | None:
    """The reason why the file cannot be replaced, found by writing beside it; `None` when it can."""
    trial = path.with_name(f"{path.name}.try")
    try:
        _require_replaceable(path)
        replace_small(trial, b"", durable=False)
        trial.unlink()
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
