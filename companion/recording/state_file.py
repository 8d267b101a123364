"""State files: small files that one run leaves to the next, replaced as a whole, so never read in part."""

import logging
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

_log = logging.getLogger("companion")


class StateFile:
    """A text file that is replaced as a whole. The first disk error is logged; none is raised."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failed = False

    def read(self) -> tuple[str, float] | None:
        """The text and its age [s]; `None` if there is no readable file.

        The age is that of the file, because the clock may have been set since the last run.
        """
        try:
            age_s = time.time() - self._path.stat().st_mtime
            return self._path.read_text(encoding="utf-8"), age_s
        except (OSError, UnicodeDecodeError):
            return None

    def write(self, text: str | None) -> None:
        """Replace the text; `None` removes the file."""
        try:
            if text is None:
                self._path.unlink(missing_ok=True)
                return
            new = self._path.with_name(f"{self._path.name}.new")
            self._write_new(new, text)
            os.replace(new, self._path)  # noqa: PTH105 - documented to be atomic
        except OSError as error:
            if not self._failed:
                _log.error("%s: cannot be written: %s", self._path, error.strerror)
            self._failed = True

    def _write_new(self, path: Path, text: str) -> None:
        path.write_text(text, encoding="utf-8")


class DurableStateFile(StateFile):
    """A state file that survives a power cut: the new text is on the disk before it replaces the old one.

    This may take seconds on a memory card, so a thread does it, in order, and the flight does not wait.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="state file")

    def write(self, text: str | None) -> None:
        """Replace the text as soon as possible; not allowed after `close`."""
        self._writer.submit(super().write, text)

    def close(self) -> None:
        """Wait until everything is written."""
        self._writer.shutdown()

    def _write_new(self, path: Path, text: str) -> None:
        with path.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
