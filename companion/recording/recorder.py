"""The recorder: all that is received and sent as a tlog, the decisions as JSON lines, and as MCAP once more,
with what a display shows and what was told.
"""

import asyncio
import json
import threading
from collections import deque
from pathlib import Path

from companion.errors import LogError
from companion.recording import (
    DECISION,
    STATE,
    TEXT,
    Note,
    Part,
    Topic,
    complete_all,
    free_name,
    remove_oldest,
)

_SYNC_PERIOD_S = 1.0  # what a power cut may take at most
_TIDY_PERIODS = 10  # between two looks at how much there is in the folder
# What waits for a disk that does not answer; more is lost, and told.
_LONGEST_WAITING_BYTES = 64 << 20

MB = 1_000_000


class Recorder:
    """Records one run into a folder, as `companion-YYYYmmdd-HHMMSS.tlog`, `.jsonl` and `.mcap` (UTC).

    What cannot be created raises `LogError`. After that the disk may fail: flying goes on, and `problem` says
    what is wrong. Before a file has `max_file_bytes` a new part begins, `….part2.tlog` and so on. When all
    recordings in the folder have more than `max_total_bytes`, the oldest are deleted.

    Whoever flies calls what comes before `run`: it is written where the system keeps it in memory, or waits
    for the thread. Bringing it onto the disk, and all else, is done in threads.
    """

    def __init__(
        self,
        directory: Path,
        started_unix_s: float,
        *,
        max_file_bytes: int = 256 * MB,
        max_total_bytes: int = 4096 * MB,
    ) -> None:
        self._directory = directory
        self._max_file_bytes, self._max_total_bytes = max_file_bytes, max_total_bytes
        try:
            directory.mkdir(parents=True, exist_ok=True)
            name = free_name(directory, started_unix_s)
        except OSError as error:
            raise LogError(f"{directory}: cannot record here: {error.strerror}") from error
        self._part = Part(directory, name)
        self._ended: list[Part] = []  # closed a second later: a frame may be on its way into one
        self._size_before = 0
        self._syncs = 0
        self._problem: str | None = None
        self._notes: deque[Note] = deque()
        self._noted_bytes = self._flushed_bytes = 0  # each counted by one thread
        self._closed = False
        self._lock = threading.Lock()  # `close` must not overtake what a thread does

    @property
    def tlog_path(self) -> Path:
        """Where the log of the messages is; of the newest part."""
        return self._part.tlog.path

    @property
    def decisions_path(self) -> Path:
        """Where the lines of the decisions are."""
        return self._part.lines.path

    @property
    def mcap_path(self) -> Path:
        """Where the MCAP file is."""
        return self._part.mcap.path

    @property
    def problem(self) -> str | None:
        """Why something is missing from the record; `None` while nothing is."""
        return self._part.problem or self._problem

    def received(self, time_us: int, raw: bytes) -> None:
        """A frame came in."""
        self._part.tlog.write(time_us, raw)

    def sent(self, time_us: int, raw: bytes) -> None:
        """A frame went out."""
        self._part.tlog.write(time_us, raw)

    def decision(self, time_us: int, line: str) -> None:
        """A decision, one line of JSON."""
        self._part.lines.append(f"{line}\n".encode(errors="backslashreplace"))
        self._note(DECISION, time_us, line)

    def state(self, time_us: int, line: str) -> None:
        """What a display shows, as JSON."""
        self._note(STATE, time_us, line)

    def text(self, time_us: int, severity: int, text: str) -> None:
        """What the operator was told."""
        self._note(TEXT, time_us, json.dumps({"time_us": time_us, "severity": severity, "text": text}))

    async def run(self) -> None:
        """Bring everything onto the disk once a second, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(asyncio.to_thread(self._tidy), name="tidy")
            while True:
                await asyncio.sleep(_SYNC_PERIOD_S)
                await asyncio.to_thread(self._sync)

    def close(self) -> None:
        """Bring everything onto the disk and close; what comes later is not recorded."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            for part in self._ended:
                part.close()
            self._part.sync(self._take_notes())
            self._part.close()

    def _note(self, topic: Topic, time_us: int, text: str) -> None:
        """Have it written within a second."""
        if self._noted_bytes - self._flushed_bytes > _LONGEST_WAITING_BYTES:
            self._problem = f"{self.mcap_path}: the disk does not keep up"
        elif not self._closed:
            self._noted_bytes += len(text)
            self._notes.append(Note(topic, time_us, text))

    def _take_notes(self) -> list[Note]:
        notes = [self._notes.popleft() for _ in range(len(self._notes))]
        self._flushed_bytes += sum(len(note.text) for note in notes)
        return notes

    def _sync(self) -> None:
        with self._lock:
            if self._closed:
                return
            for part in self._ended:
                part.close()
            self._ended.clear()
            self._part.sync(self._take_notes())
            self._syncs += 1
            if self._is_full() or self._syncs % _TIDY_PERIODS == 0:
                self._make_room()

    def _is_full(self) -> bool:
        """Begin a new part when the files would not hold what the next two seconds may bring."""
        size = self._part.largest_bytes
        growth, self._size_before = size - self._size_before, size
        if size + 2 * growth <= self._max_file_bytes:
            return False
        try:
            following = Part(self._directory, self._part.name.next_free(self._directory))
        except (LogError, OSError) as error:
            self._problem = str(error)  # the files grow on
            return False
        self._problem = self._part.problem or self._problem
        self._ended.append(self._part)
        self._part, self._size_before = following, 0
        return True

    def _make_room(self) -> None:
        """Delete what is too much in the folder."""
        ours = [path for part in (self._part, *self._ended) for path in part.paths]
        try:
            remove_oldest(self._directory, self._max_total_bytes, but=ours)
        except OSError as error:
            self._problem = f"{self._directory}: {error.strerror}"

    def _tidy(self) -> None:
        """What former runs left: the oldest deleted, what was cut off completed."""
        self._make_room()
        try:
            complete_all(self._directory, but=self._part.paths, go_on=lambda: not self._closed)
        except OSError as error:
            self._problem = f"{self._directory}: {error.strerror}"
        except Exception as error:  # noqa: BLE001 - as in `Runtime._guarded`, and to less effect
            # An old file that nobody can make sense of is no reason to give the aircraft back.
            self._problem = f"{self._directory}: an old recording cannot be completed: {error!r}"
