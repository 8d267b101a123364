"""Reads the MCAP files of recordings; a truncated or damaged file is read up to the damage.

A file may hold anything: a length is accepted only if the file has that many bytes, a chunk only with the
right checksum. Reading ends at the first error.
"""

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, MessageIndex, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC
from zstandard import ZstdError

from companion.errors import LogError

_HEAD = struct.Struct("<BQ")
_KNOWN = frozenset(Opcode)
# A second of a thousand tracks is a tenth of this. Larger records were not written by Companion.
_MAX_RECORD_BYTES = 32 << 20
# The errors of the library and of the decompressors for bytes that they cannot read.
_DAMAGE = (McapError, ZstdError, struct.error, ValueError, RuntimeError, MemoryError, OverflowError)


class Entry(NamedTuple):
    """One message: topic, time and JSON."""

    topic: str
    time_us: int
    data: bytes


class RawRecord(NamedTuple):
    """A record as written in the file, and its position."""

    offset: int
    opcode: int
    body: bytes

    @property
    def end(self) -> int:
        """The position of the next record."""
        return self.offset + _HEAD.size + len(self.body)


class McapReader:
    """The messages of a file, in file order. After a pass, `closed` is True if the file has its end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.closed = False
        self.read_bytes = 0  # for a progress bar
        if not is_mcap(path):
            raise LogError(f"{path}: is not an MCAP file")

    def __iter__(self) -> Iterator[Entry]:
        self.closed = False
        channels: dict[int, str] = {}
        with _opened(self.path) as file:
            for record in _records(file, self.path):
                self.read_bytes = record.end
                self.closed = record.opcode == Opcode.FOOTER
                inside = parse(record)
                if inside is None or self.closed:
                    break
                for _, each in inside:
                    if isinstance(each, Channel):
                        channels[each.id] = each.topic
                    elif isinstance(each, Message) and each.channel_id in channels:
                        yield Entry(channels[each.channel_id], each.log_time // 1000, each.data)


def read_mcap(path: Path) -> McapReader:
    """Open a recording; `LogError` if it cannot be read."""
    return McapReader(path)


def is_mcap(path: Path) -> bool:
    """Whether a file begins like an MCAP file; `LogError` if it cannot be read."""
    with _opened(path) as file:
        try:
            return file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def _records(file: BinaryIO, path: Path) -> Iterator[RawRecord]:
    try:
        yield from raw_records(file)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def raw_records(file: BinaryIO) -> Iterator[RawRecord]:
    """The records of a file after its magic bytes, up to the first that is truncated or impossible."""
    size = file.seek(0, io.SEEK_END)
    offset = file.seek(len(MCAP0_MAGIC))
    while offset + _HEAD.size <= size:
        opcode, length = _HEAD.unpack(file.read(_HEAD.size))
        end = offset + _HEAD.size + length
        if opcode not in _KNOWN or length > _MAX_RECORD_BYTES or end > size:
            return
        body = file.read(length)
        if len(body) < length:
            return
        yield RawRecord(offset, opcode, body)
        offset = end


def parse(record: RawRecord) -> list[tuple[int, McapRecord]] | None:
    """The contents of a record, for a chunk all records in it, each with its offset; `None` if damaged."""
    try:
        if record.opcode == Opcode.CHUNK:
            return list(_in_chunk(chunk_of(record)))
        content = _content(record.opcode, record.body)
    except _DAMAGE:
        return None
    return [] if content is None else [(0, content)]


def chunk_of(record: RawRecord) -> Chunk:
    """The chunk, still compressed."""
    chunk: Chunk = Chunk.read(ReadDataStream(io.BytesIO(record.body)))
    return chunk


def index_of(record: RawRecord) -> MessageIndex | None:
    """The index of messages after a chunk; `None` if damaged."""
    try:
        index: MessageIndex = MessageIndex.read(ReadDataStream(io.BytesIO(record.body)))
    except _DAMAGE:
        return None
    return index


def _in_chunk(chunk: Chunk) -> Iterator[tuple[int, McapRecord]]:
    if chunk.uncompressed_size > _MAX_RECORD_BYTES:
        raise ValueError("too long")
    stream, size = get_chunk_data_stream(chunk)
    data = stream.read(size)
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("wrong checksum")
    at = 0
    while at < size:
        opcode, length = _HEAD.unpack_from(data, at)
        begin, end = at + _HEAD.size, at + _HEAD.size + length
        if end > size:
            raise ValueError("truncated")
        content = _content(opcode, data[begin:end])
        if content is not None:
            yield at, content
        at = end


def _content(opcode: int, body: bytes) -> McapRecord | None:
    stream = ReadDataStream(io.BytesIO(body))
    content: McapRecord | None = None
    match opcode:
        case Opcode.CHANNEL:
            content = Channel.read(stream)
        case Opcode.SCHEMA:
            content = Schema.read(stream)
        case Opcode.MESSAGE:
            content = Message.read(stream, len(body))
        case _:
            pass
    return content


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
