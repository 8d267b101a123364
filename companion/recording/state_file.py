"""State files: small files that one run leaves to the next, replaced as a whole, so never read in part."""

import logging
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from companion.files import read_small, reason, replace_small, set_aside, why_not_replaceable
from companion.mavlink.dialect import mavlink
from companion.output.notice import Condition

_log = logging.getLogger("companion")


class StateFile:
    """A text file that is replaced as a whole. The first disk error is logged; none is raised.

    `problem` is the reason why it cannot be written, `set_aside_because` why the file of the former run was
    not used; both are `None` without a problem. What is at the path cannot keep the caller waiting.
    """

    _durable, _kind = False, "state"

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problem: str | None = None
        self.set_aside_because: str | None = None

    def try_writing(self) -> None:
        """Find out now whether it can be written, and not when it is needed."""
        problem = why_not_replaceable(self._path)
        if problem is not None:
            self._failed(problem)

    def read(self) -> tuple[str, float] | None:
        """The text and its age [s]; `None` if there is no usable file. An unusable one is set aside.

        The age is that of the file, because the clock may have been set since the last run.
        """
        try:
            age_s = time.time() - self._path.stat().st_mtime
            return read_small(self._path).decode("utf-8"), age_s
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            self.set_aside(reason(error))
        except UnicodeDecodeError:
            self.set_aside("damaged")
        return None

    def set_aside(self, why: str) -> None:
        """Rename the file, as its content cannot be used."""
        bad = set_aside(self._path)
        self.set_aside_because = why
        _log.error("%s: %s, not used%s", self._path, why, "" if bad is None else f"; it is now {bad.name}")

    def conditions(self) -> Iterator[Condition]:
        """What the operator should know of this file."""
        severity = mavlink.MAV_SEVERITY_WARNING
        if self.problem is not None:
            text = f"Avoidance: {self._kind} not saved: {self.problem}"
            yield Condition(f"{self._kind} not saved", severity, text, f"Avoidance: {self._kind} saved again")
        if self.set_aside_because is not None:
            text = f"Avoidance: old {self._kind} not used: {self.set_aside_because}"
            yield Condition(f"old {self._kind}", severity, text, matters=False)

    def write(self, text: str | None) -> None:
        """Replace the text; `None` removes the file."""
        try:
            if text is None:
                self._path.unlink(missing_ok=True)
                return
            replace_small(self._path, text.encode(), durable=self._durable)
        except OSError as error:
            self._failed(reason(error))
        else:
            self.problem = None

    def _failed(self, why: str) -> None:
        if self.problem is None:
            _log.error("%s: cannot be written: %s", self._path, why)
        self.problem = why


class DurableStateFile(StateFile):
    """A state file that survives a power cut: the new text is on the disk before it replaces the old one.

    This may take seconds on a memory card, so a thread does it, in order, and the flight does not wait.
    """

    _durable, _kind = True, "settings"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="state file")

    def write(self, text: str | None) -> None:
        """Replace the text as soon as possible; not allowed after `close`."""
        self._writer.submit(super().write, text)

    def close(self) -> None:
        """Wait until everything is written."""
        self._writer.shutdown()
