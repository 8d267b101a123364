"""Telemetry logs: before each frame its time, big-endian microseconds since 1970 in 8 bytes; nothing else."""

import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from companion.errors import LogError
from companion.mavlink.append_file import AppendOnlyFile
from companion.mavlink.dialect import CRC_EXTRA
from companion.mavlink.framing import (
    CHECKSUM_BYTES,
    CRC_STEP,
    HEADER_V1_BYTES,
    HEADER_V2_BYTES,
    MAGIC_V1,
    MAGIC_V2,
    MAX_FRAME_BYTES,
    SIGNATURE_BYTES,
    SIGNED,
    Counters,
    Flaw,
    Frame,
    UnknownFrame,
    crc_extra_of,
    crc_of,
    frame_at,
    is_magic,
    new_frame,
    next_magic,
    unpack_v1,
    unpack_v2,
)

_STAMP_BYTES = 8
_unpack_stamp = struct.Struct(">Q").unpack_from
_CHUNK_BYTES = 1 << 20
# What it takes to judge a frame: all of it, and where the next record's frame would begin.
_FRAME_VIEW_BYTES = MAX_FRAME_BYTES + _STAMP_BYTES + 1
_RECORD_VIEW_BYTES = _STAMP_BYTES + _FRAME_VIEW_BYTES


def read_tlog(path: Path | str, only: Collection[int] | None = None) -> "TlogReader":
    """Open a log; a `LogError` says why it cannot be read. `only` names the message ids to hand over."""
    return TlogReader(Path(path), only)


class TlogReader:
    """The good frames of a log, each with its stamp [us] as written; what is wrong in between is counted.

    A frame without a stamp of its own carries that of the frame before, or 0. Stamps may jump and run
    backwards: what to believe of them is for the caller. With `only`, frames of other messages are checked
    and counted all the same, but not handed over, which is faster. `counters` tells about the newest pass
    over the file, also while it runs. The end of a file without any frame raises `LogError`.
    """

    def __init__(self, path: Path, only: Collection[int] | None = None) -> None:
        self.path = path
        self.counters = Counters()
        self.read_bytes = 0  # of the file, for a progress bar
        self._only: Collection[int] = CRC_EXTRA if only is None else only
        with _opened(path) as file:
            if not _read(file, path, 1):
                raise LogError(f"{path}: the file is empty")

    @property
    def messages(self) -> int:
        """How many good frames were read."""
        return self.counters.frames

    @property
    def bad_bytes(self) -> int:
        """How many bytes belong to no record."""
        return self.counters.bad_bytes

    @property
    def unknown(self) -> int:
        """How many frames are of messages that the dialect lacks."""
        return self.counters.unknown

    def __iter__(self) -> Iterator[tuple[int, Frame]]:
        self.counters = counters = Counters()
        with _opened(self.path) as file:
            window = _Window(file, self.path, counters)
            while window.fill():
                self.read_bytes = file.tell()
                yield from _intact_records(window, self._only, counters)
                record = window.find_record()
                if record is not None:
                    counters.frames += 1
                    if record[1].message_id in self._only:
                        yield record
        if not counters.frames:
            raise LogError(f"{self.path}: the file holds no MAVLink frame")


def _intact_records(
    window: "_Window", only: Collection[int], counters: Counters
) -> Iterator[tuple[int, Frame]]:
    """Record after record, up to the first place where anything is wrong, or near the end of the window.

    The same test as `frame_at`, written out: half of the time of a replay is spent in this loop.
    """
    data, position = window.data, window.position
    last = len(data) - _RECORD_VIEW_BYTES
    while position <= last:
        start = position + _STAMP_BYTES
        magic = data[start]
        if magic == MAGIC_V2:
            length, flags, _, sequence, system_id, component_id, message_id, high = unpack_v2(data, start + 1)
            message_id |= high << 16
            checksum_at = start + HEADER_V2_BYTES + length
            end = checksum_at + (CHECKSUM_BYTES + SIGNATURE_BYTES if flags else CHECKSUM_BYTES)
            if flags > SIGNED:
                break
        elif magic == MAGIC_V1:
            length, sequence, system_id, component_id, message_id = unpack_v1(data, start + 1)
            checksum_at = start + HEADER_V1_BYTES + length
            end = checksum_at + CHECKSUM_BYTES
        else:
            break
        extra = crc_extra_of(message_id)
        if extra is None:
            break
        crc = crc_of(data[start + 1 : checksum_at])
        if crc >> 8 ^ CRC_STEP[(crc ^ extra) & 0xFF] != data[checksum_at] | data[checksum_at + 1] << 8:
            break
        (time_us,) = _unpack_stamp(data, position)
        window.position = position = end
        window.time_us = time_us
        counters.frames += 1
        if message_id in only:
            raw = data[start:end]
            yield time_us, new_frame(Frame, (raw, message_id, system_id, component_id, sequence))


class _Window:
    """The part of a log that is in memory: everything before `position` is dealt with."""

    def __init__(self, file: BinaryIO, path: Path, counters: Counters) -> None:
        self.data = b""
        self.position = 0
        self.time_us = 0
        self._file = file
        self._path = path
        self._counters = counters
        self._at_end = False

    def fill(self) -> bool:
        """Have a whole record in view, unless the file ends before; false when nothing is left."""
        while not self._at_end and len(self.data) - self.position < _RECORD_VIEW_BYTES:
            chunk = _read(self._file, self._path, _CHUNK_BYTES)
            self._at_end = not chunk
            self.data = self.data[self.position :] + chunk
            self.position = 0
        return self.position < len(self.data)

    def find_record(self) -> tuple[int, Frame] | None:
        """The next record, wherever it stands; `None` at the end, and after a frame of an unknown message."""
        gap = 0  # from `position` to the place under test: at most a stamp, what is before that is given up
        while self.fill():
            at = next_magic(self.data, self.position + gap)
            self._skip(at - _STAMP_BYTES)
            gap = at - self.position
            if at == len(self.data):
                if self._at_end:
                    self._skip(at)
                continue
            if not self._at_end and len(self.data) - at < _FRAME_VIEW_BYTES:
                continue
            found = frame_at(self.data, at)
            if isinstance(found, Frame):
                self._claim_stamp(at)
                self.position = at + len(found.raw)
                return self.time_us, found
            if isinstance(found, UnknownFrame) and self._record_may_follow(at + found.size):
                self._claim_stamp(at)
                self.position = at + found.size
                self._counters.unknown += 1
                return None
            if found is Flaw.BAD_CRC:
                self._counters.bad_crc += 1
            gap += 1
        return None

    def _claim_stamp(self, frame_start: int) -> None:
        """Take the stamp before a frame, if there is room for one."""
        if frame_start - self.position == _STAMP_BYTES:
            (self.time_us,) = _unpack_stamp(self.data, self.position)
        else:
            self._skip(frame_start)

    def _record_may_follow(self, end: int) -> bool:
        return end == len(self.data) or is_magic(self.data, end + _STAMP_BYTES) or is_magic(self.data, end)

    def _skip(self, to: int) -> None:
        """Give up the bytes before `to` as bad."""
        if to > self.position:
            self._counters.bad_bytes += to - self.position
            self.position = to


class TlogWriter:
    """A new log, as ground stations play it; `AppendOnlyFile` says what a crash or a full disk does to it."""

    def __init__(self, path: Path) -> None:
        self._file = AppendOnlyFile(path)

    @property
    def path(self) -> Path:
        """Where the log is."""
        return self._file.path

    @property
    def size(self) -> int:
        """How many bytes it has."""
        return self._file.size

    @property
    def failures(self) -> int:
        """How often the disk refused."""
        return self._file.failures

    @property
    def problem(self) -> str | None:
        """The newest error of the disk."""
        return self._file.problem

    def write(self, time_us: int, raw: bytes) -> None:
        """Add one frame; with the operating system on return. Never raises for what the disk does."""
        self._file.append((time_us & 0xFFFF_FFFF_FFFF_FFFF).to_bytes(_STAMP_BYTES, "big") + raw)

    def sync(self) -> None:
        """Bring everything onto the disk; slow, for a thread of its own."""
        self._file.sync()

    def close(self) -> None:
        """Bring everything onto the disk and close."""
        self._file.close()


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def _read(file: BinaryIO, path: Path, size: int) -> bytes:
    try:
        return file.read(size)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
