"""The recorder: frames as a tlog, decisions as JSON lines; decisions, states and operator texts as MCAP."""

import asyncio
import json
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from companion.errors import LogError
from companion.mavlink.append_file import AppendOnlyFile
from companion.mavlink.facts import Sender
from companion.mavlink.tlog import TlogWriter
from companion.recording.folder import PartName, free_name, remove_oldest
from companion.recording.mcap_writer import McapMessage, McapWriter
from companion.recording.pieces import PieceWriter
from companion.recording.repair import repair_all
from companion.recording.schemas import DECISION, STATE, TEXT, Topic
from companion.sources.receiver import Piece

_SYNC_PERIOD_S = 1.0  # a power cut may cost this much
_SYNCS_PER_CLEANUP = 10
# Messages that wait for a disk that does not answer; more are dropped, and reported as a problem.
_MAX_WAITING_BYTES = 64 << 20

MB = 1_000_000


class _Part:
    """The open files of one part of a recording; `LogError` if one of them cannot be created."""

    def __init__(self, directory: Path, name: PartName) -> None:
        self.name = name
        with ExitStack() as undo:
            self.tlog = TlogWriter(name.path(directory, ".tlog"))
            undo.callback(self.tlog.close)
            self.lines = AppendOnlyFile(name.path(directory, ".jsonl"))
            undo.callback(self.lines.close)
            self.mcap = McapWriter(name.path(directory, ".mcap"))
            undo.pop_all()

    @property
    def paths(self) -> tuple[Path, ...]:
        """The paths of the files."""
        return self.tlog.path, self.lines.path, self.mcap.path

    @property
    def problem(self) -> str | None:
        """The newest disk error of one of the files."""
        return self.tlog.problem or self.lines.problem or self.mcap.problem

    @property
    def largest_bytes(self) -> int:
        """The size of the largest file."""
        return max(self.tlog.size, self.lines.size, self.mcap.size)

    def sync(self, messages: Sequence[McapMessage]) -> None:
        """Write everything to the disk, including these messages; this may take long."""
        self.mcap.write(messages)
        self.tlog.sync()
        self.lines.sync()
        self.mcap.sync()

    def close(self) -> None:
        """Write everything to the disk and close."""
        self.tlog.close()
        self.lines.close()
        self.mcap.close()


class Recorder:
    """Records one run into a folder, as `companion-YYYYmmdd-HHMMSS.tlog`, `.jsonl` and `.mcap` (UTC).

    `LogError` if the files cannot be created. Later disk errors do not stop the flight: `problem` has them.
    Before a file reaches `max_file_bytes` a new part begins, `….part2.tlog` and so on. When all recordings in
    the folder exceed `max_total_bytes`, the oldest are deleted.

    The methods before `run` are called by the event loop: they only write to the operating system's memory,
    or queue for the thread. Syncing to the disk, and everything else, is done in threads.
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
        self._part = _Part(directory, name)
        self._ended: list[_Part] = []  # closed a second later: a frame may be just being written to one
        self._pieces = PieceWriter()
        self._size_before = 0
        self._syncs = 0
        self._problem: str | None = None
        self._waiting: deque[McapMessage] = deque()
        self._queued_bytes = self._written_bytes = 0  # each is changed by one thread only
        self._closed = False
        self._lock = threading.Lock()  # `close` waits for the work of a thread

    @property
    def tlog_path(self) -> Path:
        """The path of the message log, in the newest part."""
        return self._part.tlog.path

    @property
    def decisions_path(self) -> Path:
        """The path of the decisions as JSON lines, in the newest part."""
        return self._part.lines.path

    @property
    def mcap_path(self) -> Path:
        """The path of the MCAP file, in the newest part."""
        return self._part.mcap.path

    @property
    def problem(self) -> str | None:
        """The reason why the recording is incomplete; `None` if it is complete."""
        return self._part.problem or self._problem

    def received(self, time_us: int, raw: bytes) -> None:
        """Record a received frame."""
        self._part.tlog.write(time_us, raw)

    def heard(self, time_us: int, piece: Piece, us: Sender) -> None:
        """Record what a receiver sent, as frames of ours that are not sent."""
        self._part.tlog.write_together(time_us, self._pieces.frames(piece, us))

    def sent(self, time_us: int, raw: bytes) -> None:
        """Record a sent frame."""
        self._part.tlog.write(time_us, raw)

    def decision(self, time_us: int, line: str) -> None:
        """Record a decision, one line of JSON."""
        self._part.lines.append(f"{line}\n".encode(errors="backslashreplace"))
        self._queue(DECISION, time_us, line)

    def state(self, time_us: int, line: str) -> None:
        """Record the state that a display shows, as JSON."""
        self._queue(STATE, time_us, line)

    def text(self, time_us: int, severity: int, text: str) -> None:
        """Record a text to the operator."""
        self._queue(TEXT, time_us, json.dumps({"time_us": time_us, "severity": severity, "text": text}))

    async def run(self) -> None:
        """Write everything to the disk once a second, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(asyncio.to_thread(self._clean_up), name="clean up")
            while True:
                await asyncio.sleep(_SYNC_PERIOD_S)
                await asyncio.to_thread(self._sync)

    def close(self) -> None:
        """Write everything to the disk and close; nothing is recorded after that."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            for part in self._ended:
                part.close()
            self._part.sync(self._take_waiting())
            self._part.close()

    def _queue(self, topic: Topic, time_us: int, text: str) -> None:
        """Queue a message for the next sync."""
        if self._queued_bytes - self._written_bytes > _MAX_WAITING_BYTES:
            self._problem = f"{self.mcap_path}: the disk does not keep up"
        elif not self._closed:
            self._queued_bytes += len(text)
            self._waiting.append(McapMessage(topic, time_us, text))

    def _take_waiting(self) -> list[McapMessage]:
        messages = [self._waiting.popleft() for _ in range(len(self._waiting))]
        self._written_bytes += sum(len(message.text) for message in messages)
        return messages

    def _sync(self) -> None:
        with self._lock:
            if self._closed:
                return
            for part in self._ended:
                part.close()
            self._ended.clear()
            self._part.sync(self._take_waiting())
            self._syncs += 1
            if self._begin_part_if_full() or self._syncs % _SYNCS_PER_CLEANUP == 0:
                self._remove_oldest()

    def _begin_part_if_full(self) -> bool:
        """Begin a new part if the files could not hold two more seconds; True if one was begun."""
        size = self._part.largest_bytes
        growth, self._size_before = size - self._size_before, size
        if size + 2 * growth <= self._max_file_bytes:
            return False
        try:
            following = _Part(self._directory, self._part.name.next_free(self._directory))
        except (LogError, OSError) as error:
            self._problem = str(error)  # the present files continue to grow
            return False
        self._problem = self._part.problem or self._problem
        self._ended.append(self._part)
        self._part, self._size_before = following, 0
        return True

    def _remove_oldest(self) -> None:
        ours = [path for part in (self._part, *self._ended) for path in part.paths]
        try:
            remove_oldest(self._directory, self._max_total_bytes, keep=ours)
        except OSError as error:
            self._problem = f"{self._directory}: {error.strerror}"

    def _clean_up(self) -> None:
        """Delete the oldest recordings, and repair those of former runs that were cut off."""
        self._remove_oldest()
        try:
            repair_all(self._directory, skip=self._part.paths, go_on=lambda: not self._closed)
        except OSError as error:
            self._problem = f"{self._directory}: {error.strerror}"
        except Exception as error:  # noqa: BLE001 - the broad `except` of this thread, as in `Runtime._guarded`
            # An old file that cannot be repaired must not end the flight.
            self._problem = f"{self._directory}: an old recording cannot be repaired: {error!r}"
