"""The few words that one run leaves to the next, in files that are whole at any moment."""

import logging
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

_log = logging.getLogger("companion")


class StateFile:
    """Writes anew as a whole or not at all; a disk that fails is told once, and flying goes on."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failed = False

    def read(self) -> tuple[str, float] | None:
        """What the last run left and how long ago [s], `None` when it left nothing.

        The age is that of the file: the time that the last run believed in may have been set since.
        """
        try:
            age_s = time.time() - self._path.stat().st_mtime
            return self._path.read_text(encoding="utf-8"), age_s
        except (OSError, UnicodeDecodeError):
            return None

    def keep(self, text: str | None) -> None:
        """Replace what is kept; `None` removes it."""
        try:
            if text is None:
                self._path.unlink(missing_ok=True)
                return
            fresh = self._path.with_name(f"{self._path.name}.new")
            self._write(fresh, text)
            os.replace(fresh, self._path)  # noqa: PTH105 - atomic, and says so
        except OSError as error:
            if not self._failed:
                _log.error("%s: cannot be written: %s", self._path, error.strerror)
            self._failed = True

    def _write(self, path: Path, text: str) -> None:
        path.write_text(text, encoding="utf-8")


class DurableStateFile(StateFile):
    """For what must outlast a power cut too: on the disk before it takes the place of what was there.

    That may take a second, on a card more, and the aircraft is flown meanwhile: a thread does it, in order.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="keeper")

    def keep(self, text: str | None) -> None:
        """As soon as can be; after `close` nothing is kept any more."""
        self._writer.submit(super().keep, text)

    def close(self) -> None:
        """Wait until everything is kept."""
        self._writer.shutdown()

    def _write(self, path: Path, text: str) -> None:
        with path.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
