"""Reads the MCAP files of recordings, also one that was cut off: everything before the cut.

A file from elsewhere may hold anything. Lengths are believed only as far as there are bytes, chunks only with
the right checksum; the first place that is wrong is the end.
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
# A second of a thousand tracks is a tenth of this; what is larger nobody of ours wrote.
_LONGEST_RECORD_BYTES = 32 << 20
# What the library and the decompressors raise for bytes that are something else.
_DAMAGE = (McapError, ZstdError, struct.error, ValueError, RuntimeError, MemoryError, OverflowError)


class Entry(NamedTuple):
    """One message: its topic, its time and its JSON."""

    topic: str
    time_us: int
    data: bytes


class RawRecord(NamedTuple):
    """A record as it stands in the file, and where."""

    offset: int
    opcode: int
    body: bytes

    @property
    def end(self) -> int:
        """Where the next one begins."""
        return self.offset + _HEAD.size + len(self.body)


class McapLog:
    """The messages of a file, in its order. After a pass, `whole` says whether it was properly ended."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.whole = False
        self.read_bytes = 0  # for a progress bar
        if not is_mcap(path):
            raise LogError(f"{path}: this is no MCAP file")

    def __iter__(self) -> Iterator[Entry]:
        self.whole = False
        channels: dict[int, str] = {}
        with _opened(self.path) as file:
            for record in _readable(file, self.path):
                self.read_bytes = record.end
                self.whole = record.opcode == Opcode.FOOTER
                inside = parsed(record)
                if inside is None or self.whole:
                    break
                for _, each in inside:
                    if isinstance(each, Channel):
                        channels[each.id] = each.topic
                    elif isinstance(each, Message) and each.channel_id in channels:
                        yield Entry(channels[each.channel_id], each.log_time // 1000, each.data)


def read_mcap(path: Path) -> McapLog:
    """Open a recording; `LogError` says why it cannot be."""
    return McapLog(path)


def is_mcap(path: Path) -> bool:
    """Whether a file begins as one; `LogError` when it cannot be read."""
    with _opened(path) as file:
        try:
            return file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC
        except OSError as error:
            raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def _readable(file: BinaryIO, path: Path) -> Iterator[RawRecord]:
    try:
        yield from raw_records(file)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error


def raw_records(file: BinaryIO) -> Iterator[RawRecord]:
    """The records of a file behind its magic, up to the first that is not whole or cannot be one."""
    size = file.seek(0, io.SEEK_END)
    offset = file.seek(len(MCAP0_MAGIC))
    while offset + _HEAD.size <= size:
        opcode, length = _HEAD.unpack(file.read(_HEAD.size))
        end = offset + _HEAD.size + length
        if opcode not in _KNOWN or length > _LONGEST_RECORD_BYTES or end > size:
            return
        body = file.read(length)
        if len(body) < length:
            return
        yield RawRecord(offset, opcode, body)
        offset = end


def parsed(record: RawRecord) -> list[tuple[int, McapRecord]] | None:
    """What a record holds, of a chunk all that is in it, each with its offset; `None` when it is damaged."""
    try:
        if record.opcode == Opcode.CHUNK:
            return list(_in_chunk(chunk_of(record)))
        one = _one(record.opcode, record.body)
    except _DAMAGE:
        return None
    return [] if one is None else [(0, one)]


def chunk_of(record: RawRecord) -> Chunk:
    """The chunk, still compressed."""
    chunk: Chunk = Chunk.read(ReadDataStream(io.BytesIO(record.body)))
    return chunk


def index_of(record: RawRecord) -> MessageIndex | None:
    """The index behind a chunk; `None` when it is damaged."""
    try:
        index: MessageIndex = MessageIndex.read(ReadDataStream(io.BytesIO(record.body)))
    except _DAMAGE:
        return None
    return index


def _in_chunk(chunk: Chunk) -> Iterator[tuple[int, McapRecord]]:
    if chunk.uncompressed_size > _LONGEST_RECORD_BYTES:
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
            raise ValueError("cut off")
        one = _one(opcode, data[begin:end])
        if one is not None:
            yield at, one
        at = end


def _one(opcode: int, body: bytes) -> McapRecord | None:
    stream = ReadDataStream(io.BytesIO(body))
    one: McapRecord | None = None
    match opcode:
        case Opcode.CHANNEL:
            one = Channel.read(stream)
        case Opcode.SCHEMA:
            one = Schema.read(stream)
        case Opcode.MESSAGE:
            one = Message.read(stream, len(body))
        case _:
            pass
    return one


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
