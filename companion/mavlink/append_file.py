"""A file that only grows: a killed process loses nothing of it, and a failing disk disturbs nobody."""

import contextlib
import fcntl
import os
import threading
from pathlib import Path

from companion.errors import LogError


class AppendOnlyFile:
    """A new file that takes whole records.

    Every record is with the operating system when `append` returns, so it survives the death of this process;
    `sync` makes it survive a power cut. Once open, no error of the disk is raised: a record that does not fit
    is taken back and counted in `failures`, and `problem` keeps the newest reason. While it is open it is
    locked: see `is_being_written`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.failures = 0
        self.problem: str | None = None
        self._size = 0
        self._lock = threading.Lock()  # `sync` runs in a thread of its own: `close` must not overtake it
        try:
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            raise LogError(f"{path}: exists already and is not overwritten") from error
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}") from error
        with contextlib.suppress(OSError):  # some file systems know no locks
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._open = True

    @property
    def size(self) -> int:
        """How many bytes it has."""
        return self._size

    def append(self, record: bytes) -> None:
        """Add a record whole or not at all; does nothing once closed."""
        if not self._open:
            return
        written = 0
        try:
            while written < len(record):
                written += os.write(self._descriptor, record[written:] if written else record)
        except OSError as error:
            self._failed(error)
            if written:
                self._take_back()
            return
        self._size += written

    def sync(self) -> None:
        """Bring everything onto the disk; may take long, so it is called off the event loop's thread."""
        with self._lock:
            if self._open:
                try:
                    os.fdatasync(self._descriptor)
                except OSError as error:
                    self._failed(error)

    def close(self) -> None:
        """Bring everything onto the disk and close; a second time does nothing."""
        self.sync()
        with self._lock:
            if self._open:
                self._open = False
                try:
                    os.close(self._descriptor)
                except OSError as error:
                    self._failed(error)

    def _take_back(self) -> None:
        """Remove the part of a record that did fit; a reader would stumble over it."""
        try:
            os.ftruncate(self._descriptor, self._size)
        except OSError as error:
            self._failed(error)

    def _failed(self, error: OSError) -> None:
        self.failures += 1
        self.problem = f"{self.path}: {error.strerror}"


def is_being_written(path: Path) -> bool:
    """Whether some process has this file open as an `AppendOnlyFile`; not that of one that was killed."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
