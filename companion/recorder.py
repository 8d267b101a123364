"""The recorder: everything received and sent as a tlog, and beside it the decisions, a JSON line each."""

import asyncio
import itertools
from datetime import UTC, datetime
from pathlib import Path

from companion.errors import LogError
from companion.mavlink.append_only import AppendOnlyFile
from companion.mavlink.tlog import TlogWriter

_SYNC_PERIOD_S = 1.0  # what a power cut may take at most


class Recorder:
    """Records one run into a folder, as `companion-YYYYmmdd-HHMMSS.tlog` and `.jsonl` (UTC).

    What cannot be created raises `LogError`. After that the disk may fail: flying goes on, and `problem` says
    what is wrong.
    """

    def __init__(self, directory: Path, started_unix_s: float) -> None:
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self.tlog_path, self.decisions_path = _free_names(directory, started_unix_s)
        except OSError as error:
            raise LogError(f"{directory}: cannot record here: {error.strerror}") from error
        self._tlog = TlogWriter(self.tlog_path)
        self._decisions = AppendOnlyFile(self.decisions_path)

    @property
    def problem(self) -> str | None:
        """Why something is missing from the record; `None` while nothing is."""
        return self._tlog.problem or self._decisions.problem

    def received(self, time_us: int, raw: bytes) -> None:
        """A frame came in."""
        self._tlog.write(time_us, raw)

    def sent(self, time_us: int, raw: bytes) -> None:
        """A frame went out."""
        self._tlog.write(time_us, raw)

    def decision(self, line: str) -> None:
        """A decision, or whatever else is worth a JSON line."""
        self._decisions.append(f"{line}\n".encode(errors="backslashreplace"))

    async def run(self) -> None:
        """Bring everything onto the disk once a second, until cancelled."""
        while True:
            await asyncio.sleep(_SYNC_PERIOD_S)
            await asyncio.to_thread(self._sync)

    def close(self) -> None:
        """Bring everything onto the disk and close; what comes later is not recorded."""
        self._tlog.close()
        self._decisions.close()

    def _sync(self) -> None:
        self._tlog.sync()
        self._decisions.sync()


def _free_names(directory: Path, started_unix_s: float) -> tuple[Path, Path]:
    """The first pair of names of which neither is taken: a clock without battery starts twice at one time."""
    started = datetime.fromtimestamp(started_unix_s, UTC)
    stem = f"companion-{started:%Y%m%d-%H%M%S}"
    for name in itertools.chain([stem], (f"{stem}-{count}" for count in itertools.count(2))):
        paths = directory / f"{name}.tlog", directory / f"{name}.jsonl"
        if not any(path.exists() for path in paths):
            break
    return paths
