"""Telemetry logs: frames, each preceded by its time in 8 bytes (big-endian microseconds since 1970)."""

import struct
from collections.abc import Collection, Iterator, Sequence
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
# The bytes needed to judge a frame: the frame, and the position where the next one would begin.
_FRAME_VIEW_BYTES = MAX_FRAME_BYTES + _STAMP_BYTES + 1
_RECORD_VIEW_BYTES = _STAMP_BYTES + _FRAME_VIEW_BYTES


def read_tlog(path: Path | str, only: Collection[int] | None = None) -> "TlogReader":
    """Open a log; `LogError` if it cannot be read. `only`: the ids of the messages to return."""
    return TlogReader(Path(path), only)


class TlogReader:
    """The good frames of a log, each with its time stamp [us] as written; bytes between them are counted.

    A frame without a stamp has that of the frame before it, or 0. Stamps may jump and run backwards; that is
    left to the caller. With `only`, frames of other messages are checked and counted but not returned, which
    is faster. `counters` are those of the newest pass over the file, also while it runs. `LogError` at
    the end of a file without any frame.
    """

    def __init__(self, path: Path, only: Collection[int] | None = None) -> None:
        self.path = path
        self.counters = Counters()
        self.read_bytes = 0  # for a progress bar
        self._only: Collection[int] = CRC_EXTRA if only is None else only
        with _opened(path) as file:
            if not _read(file, path, 1):
                raise LogError(f"{path}: the file is empty")

    @property
    def messages(self) -> int:
        """The number of good frames read."""
        return self.counters.frames

    @property
    def bad_bytes(self) -> int:
        """The number of bytes that belong to no record."""
        return self.counters.bad_bytes

    @property
    def unknown(self) -> int:
        """The number of frames of messages that the dialect lacks."""
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
    """The records up to the first that is damaged, or to the end of the window.

    A copy of `frame_at`, inlined because a replay spends half of its time in this loop.
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
    """The part of a log that is in memory; everything before `position` has been processed."""

    def __init__(self, file: BinaryIO, path: Path, counters: Counters) -> None:
        self.data = b""
        self.position = 0
        self.time_us = 0
        self._file = file
        self._path = path
        self._counters = counters
        self._at_end = False

    def fill(self) -> bool:
        """Read until a whole record is in `data` or the file ends; False when nothing is left."""
        while not self._at_end and len(self.data) - self.position < _RECORD_VIEW_BYTES:
            chunk = _read(self._file, self._path, _CHUNK_BYTES)
            self._at_end = not chunk
            self.data = self.data[self.position :] + chunk
            self.position = 0
        return self.position < len(self.data)

    def find_record(self) -> tuple[int, Frame] | None:
        """The next record, wherever it begins; `None` at the end, and after a frame of an unknown message."""
        gap = 0  # from `position` to the byte under test; at most a stamp, bytes before that are skipped
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
                self._read_stamp(at)
                self.position = at + len(found.raw)
                return self.time_us, found
            if isinstance(found, UnknownFrame) and self._record_may_follow(at + found.size):
                self._read_stamp(at)
                self.position = at + found.size
                self._counters.unknown += 1
                return None
            if found is Flaw.BAD_CRC:
                self._counters.bad_crc += 1
            gap += 1
        return None

    def _read_stamp(self, frame_start: int) -> None:
        """Use the eight bytes before a frame as its stamp, if there are as many."""
        if frame_start - self.position == _STAMP_BYTES:
            (self.time_us,) = _unpack_stamp(self.data, self.position)
        else:
            self._skip(frame_start)

    def _record_may_follow(self, end: int) -> bool:
        return end == len(self.data) or is_magic(self.data, end + _STAMP_BYTES) or is_magic(self.data, end)

    def _skip(self, to: int) -> None:
        """Skip the bytes before `to`, and count them as bad."""
        if to > self.position:
            self._counters.bad_bytes += to - self.position
            self.position = to


class TlogWriter(AppendOnlyFile):
    """A new log in the format of ground stations."""

    def write(self, time_us: int, raw: bytes) -> None:
        """Append one frame with its time stamp."""
        self.append(_stamp(time_us) + raw)

    def write_together(self, time_us: int, frames: Sequence[bytes]) -> None:
        """Append frames with the same time stamp, all or none."""
        stamp = _stamp(time_us)
        self.append(b"".join([stamp + raw for raw in frames]))


def _stamp(time_us: int) -> bytes:
    return (time_us & 0xFFFF_FFFF_FFFF_FFFF).to_bytes(_STAMP_BYTES, "big")


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
