"""The log of a flight: written by a thread, so that no terminal, pipe or disk behind it delays the flight."""

import contextlib
import logging
import queue
import sys
import threading
import time
from typing import TextIO

# Lines that wait for a terminal that does not take them; more are dropped.
_MAX_WAITING = 1_000
_LONGEST_FLUSH_S = 1.0


class UnblockedHandler(logging.Handler):
    """Writes lines to a stream from a thread. A stream that is gone or stuck loses lines and does no harm."""

    def __init__(self, stream: TextIO | None) -> None:
        super().__init__()
        self._stream = stream
        self._lines: queue.Queue[str] = queue.Queue(_MAX_WAITING)
        threading.Thread(target=self._write_all, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Queue a line; a record that cannot be formatted is reported by `logging` and stops nothing."""
        try:
            self._lines.put_nowait(f"{self.format(record)}\n")
        except queue.Full:
            pass
        except Exception:  # noqa: BLE001 - as every handler of `logging` does
            self.handleError(record)

    def flush(self) -> None:
        """Wait a moment until the lines so far are written."""
        until_s = time.monotonic() + _LONGEST_FLUSH_S
        while self._lines.unfinished_tasks and time.monotonic() < until_s:
            time.sleep(0.005)

    def _write_all(self) -> None:
        while True:
            line = self._lines.get()
            # The terminal is closed, the reader of the pipe is gone, or there never was a stream.
            with contextlib.suppress(OSError, ValueError, AttributeError):
                self._stream.write(line)  # type: ignore[union-attr]
                self._stream.flush()  # type: ignore[union-attr]
            self._lines.task_done()


def log_without_waiting() -> None:
    """Log to stderr from now on."""
    handler = UnblockedHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    logging.basicConfig(level=logging.INFO, handlers=[handler])
