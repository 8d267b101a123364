"""A file that only grows: it survives a killed process, and disk errors do not interrupt the caller."""

import contextlib
import fcntl
import os
import threading
from pathlib import Path

from companion.errors import LogError


class AppendOnlyFile:
    """A new file of whole records; `LogError` if it cannot be created.

    When `append` returns, the operating system has the record, so that it survives the end of this process;
    after `sync` it survives a power cut. Once the file is open, disk errors are not raised: a record written
    in part is removed again and counted in `failures`, and `problem` has the newest error. An open file is
    locked, see `is_being_written`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.failures = 0
        self.problem: str | None = None
        self._size = 0
        self._lock = threading.Lock()  # `sync` runs in another thread, and `close` must wait for it
        try:
            self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError as error:
            raise LogError(f"{path}: exists already and is not overwritten") from error
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}") from error
        with contextlib.suppress(OSError):  # some file systems have no locks
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._open = True

    @property
    def size(self) -> int:
        """The size of the file in bytes."""
        return self._size

    def append(self, record: bytes) -> None:
        """Add a record, whole or not at all; does nothing after `close`."""
        if not self._open:
            return
        written = 0
        try:
            while written < len(record):
                written += os.write(self._descriptor, record[written:] if written else record)
        except OSError as error:
            self._count_failure(error)
            if written:
                self._remove_partial_record()
            return
        self._size += written

    def sync(self) -> None:
        """Write everything to the disk; this may take long, so call it outside the event loop's thread."""
        with self._lock:
            if self._open:
                try:
                    os.fdatasync(self._descriptor)
                except OSError as error:
                    self._count_failure(error)

    def close(self) -> None:
        """Write everything to the disk and close; a second call does nothing."""
        self.sync()
        with self._lock:
            if self._open:
                self._open = False
                try:
                    os.close(self._descriptor)
                except OSError as error:
                    self._count_failure(error)

    def _remove_partial_record(self) -> None:
        """Remove the part of a record that was written; readers could not parse it."""
        try:
            os.ftruncate(self._descriptor, self._size)
        except OSError as error:
            self._count_failure(error)

    def _count_failure(self, error: OSError) -> None:
        self.failures += 1
        self.problem = f"{self.path}: {error.strerror}"


def is_being_written(path: Path) -> bool:
    """Whether a living process has this file open as an `AppendOnlyFile`."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
