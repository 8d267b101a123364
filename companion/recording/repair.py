"""Repair: adds the missing summary to a recording that a crash cut off, so that other programs open it."""

import contextlib
import os
import zlib
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path
from struct import Struct
from typing import BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    MessageIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from companion.mavlink.append_file import is_being_written
from companion.recording.folder import parts_in
from companion.recording.mcap_reader import RawRecord, chunk_of, index_of, parse, raw_records

_COPIED_BYTES = 1 << 20
_CHECKSUM = Struct("<I")
_TEMPORARY_SUFFIX = ".completing"


def repair_all(
    directory: Path, skip: Collection[Path] = (), go_on: Callable[[], bool] = lambda: True
) -> list[Path]:
    """Repair the unfinished files in a folder that are not being written; returns the repaired files.

    A file that cannot be repaired, for example on a full disk, is left as it is. `go_on` is called between
    chunks; when it returns False, the repair is abandoned.
    """
    repaired: list[Path] = []
    for left in directory.glob(f"companion-*.mcap{_TEMPORARY_SUFFIX}"):
        with contextlib.suppress(OSError):  # a folder of that name
            left.unlink(missing_ok=True)
    for paths in parts_in(directory).values():
        for path in paths:
            if path.suffix == ".mcap" and path not in skip and not is_being_written(path):
                with contextlib.suppress(OSError):
                    if repair_file(path, go_on):
                        repaired.append(path)
    return repaired


def repair_file(path: Path, go_on: Callable[[], bool] = lambda: True) -> bool:
    """Add the summary to a file; False if it has one already, or has no whole chunk."""
    with path.open("rb") as file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC or _has_summary(file):
            return False
        summary = _Summary()
        for record in raw_records(file):
            if not summary.add(record):
                break
            if not go_on():
                return False
        if not summary.chunks:
            return False
        status = os.fstat(file.fileno())
        repaired = path.with_name(f"{path.name}{_TEMPORARY_SUFFIX}")
        try:
            with repaired.open("xb") as copy:
                _copy(file, copy, summary.end)
                copy.write(summary.end_of_file())
                copy.flush()
                os.fsync(copy.fileno())
            os.utime(repaired, ns=(status.st_atime_ns, status.st_mtime_ns))
            repaired.replace(path)
        except OSError:
            repaired.unlink(missing_ok=True)
            raise
    return True


def _has_summary(file: BinaryIO) -> bool:
    size = file.seek(0, os.SEEK_END)
    if size < 2 * len(MCAP0_MAGIC):
        return False
    file.seek(size - len(MCAP0_MAGIC))
    return file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC


def _copy(file: BinaryIO, copy: BinaryIO, size: int) -> None:
    file.seek(0)
    while size > 0:
        block = file.read(min(size, _COPIED_BYTES))
        if not block:
            raise OSError("the file became shorter")
        copy.write(block)
        size -= len(block)


class _Summary:
    """Collects the indexes and counts of the records of a file, for the summary at its end."""

    def __init__(self) -> None:
        self.end = len(MCAP0_MAGIC)
        self.chunks: list[ChunkIndex] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._missing_indexes: dict[int, MessageIndex] = {}  # of the newest chunk, by channel

    def add(self, record: RawRecord) -> bool:
        """Add a record; False if it does not belong to the data, which ends there."""
        match record.opcode:
            case Opcode.HEADER:
                pass
            case Opcode.CHUNK:
                # Each chunk is read: after a power cut the last one may have the right length but only zeros.
                inside = parse(record)
                if inside is None:
                    return False
                self._add_chunk(record, inside)
            case Opcode.MESSAGE_INDEX:
                index = index_of(record)
                if index is None or self._missing_indexes.pop(index.channel_id, None) is None:
                    return False
                self._add_index(index, record.offset, record.end)
            case _:
                return False
        self.end = record.end
        return True

    def _add_chunk(self, record: RawRecord, inside: list[tuple[int, McapRecord]]) -> None:
        self._missing_indexes = {}
        for offset, each in inside:
            match each:
                case Schema():
                    self._schemas[each.id] = each
                case Channel():
                    self._channels[each.id] = each
                case Message():
                    self._counts[each.channel_id] += 1
                    index = self._missing_indexes.setdefault(
                        each.channel_id, MessageIndex(each.channel_id, [])
                    )
                    index.records.append((each.log_time, offset))
                case _:
                    pass
        chunk = chunk_of(record)
        self.chunks.append(
            ChunkIndex(
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                chunk_start_offset=record.offset,
                chunk_length=record.end - record.offset,
                message_index_offsets={},
                message_index_length=0,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    def _add_index(self, index: MessageIndex, offset: int, end: int) -> None:
        self.chunks[-1].message_index_offsets[index.channel_id] = offset
        self.chunks[-1].message_index_length += end - offset

    def end_of_file(self) -> bytes:
        """The bytes after the data: missing indexes, summary and footer."""
        head = RecordBuilder()
        for index in self._missing_indexes.values():
            begin = self.end + head.count
            index.write(head)
            self._add_index(index, begin, self.end + head.count)
        DataEnd(0).write(head)
        start = self.end + head.count
        body, offsets = RecordBuilder(), []
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, list(self.chunks)),
        ]
        for opcode, records in groups:
            first = body.count
            for record in records:
                record.write(body)
            offsets.append(SummaryOffset(opcode, start + first, body.count - first))
        offsets_start = start + body.count
        for offset in offsets:
            offset.write(body)
        # The checksum covers the whole summary section, including this footer up to its last field.
        Footer(start, offsets_start, 0).write(body)
        summary = bytes(body.end())[: -_CHECKSUM.size]
        return bytes(head.end()) + summary + _CHECKSUM.pack(zlib.crc32(summary)) + MCAP0_MAGIC

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self.chunks),
            message_count=self._counts.total(),
            metadata_count=0,
            message_start_time=min(chunk.message_start_time for chunk in self.chunks),
            message_end_time=max(chunk.message_end_time for chunk in self.chunks),
            schema_count=len(self._schemas),
        )
