"""Frames: where each MAVLink message begins and ends in a run of bytes, verified by its checksum.

Reads MAVLink 1 and 2, including signed frames (signatures are kept, not verified), in live streams and logs.
If no frame begins at a byte, the search continues one byte later, so that junk never hides a good frame.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from fastcrc import crc16

from companion.mavlink.dialect import CRC_EXTRA, MAX_PAYLOAD, Message, mavlink

MAGIC_V1 = 0xFE
MAGIC_V2 = 0xFD
MAX_FRAME_BYTES = 280  # header 10, payload 255, checksum 2, signature 13

# The parts of `frame_at`, shared with the log reader, which has a faster copy of it.
HEADER_V1_BYTES = 6
HEADER_V2_BYTES = 10
CHECKSUM_BYTES = 2
SIGNATURE_BYTES = 13
SIGNED = 0x01
unpack_v1 = struct.Struct("<BBBBB").unpack_from  # length, sequence, system, component, message
unpack_v2 = struct.Struct("<BBBBBBHB").unpack_from  # length, 2 x flags, sequence, system, component, message
_pack_v2 = struct.Struct("<BBBBBBHB").pack
crc_extra_of = CRC_EXTRA.get
crc_of: Callable[[bytes], int] = crc16.mcrf4xx
# One more byte of the checksum: next = crc >> 8 ^ CRC_STEP[(crc ^ byte) & 0xFF].
CRC_STEP = tuple(crc16.mcrf4xx(bytes((byte,)), 0) for byte in range(256))
new_frame = tuple.__new__  # takes half the time of calling the class, in the hottest loop of a replay

_CRC_STEPS = frozenset(CRC_STEP)
_find_magic = re.compile(b"[\xfd\xfe]").search


class Frame(NamedTuple):
    """One message as received, with a correct checksum."""

    raw: bytes
    message_id: int
    system_id: int
    component_id: int
    sequence: int

    @property
    def signed(self) -> bool:
        """Whether a signature follows the checksum."""
        return self.raw[0] == MAGIC_V2 and bool(self.raw[2] & SIGNED)

    @property
    def payload(self) -> bytes:
        """The fields; MAVLink 2 cuts off the zeros at their end."""
        start = HEADER_V2_BYTES if self.raw[0] == MAGIC_V2 else HEADER_V1_BYTES
        return self.raw[start : start + self.raw[1]]


class UnknownFrame(NamedTuple):
    """Probably a frame of a message that the dialect lacks: its checksum matches some CRC_EXTRA."""

    size: int
    message_id: int
    system_id: int
    component_id: int
    sequence: int


class Flaw(Enum):
    """Why no frame begins at a position."""

    NO_FRAME = "no frame"
    BAD_CRC = "checksum wrong"
    CUT = "more bytes needed"


@dataclass(slots=True)
class Counters:
    """Counts of what was read. `bad_bytes` belong to no frame, or to a frame with a wrong checksum.

    `bad_crc` counts frames of known messages with a wrong checksum, `unknown` well-formed frames of messages
    that the dialect lacks, `undecodable` good frames that pymavlink refused.
    """

    frames: int = 0
    bad_bytes: int = 0
    bad_crc: int = 0
    unknown: int = 0
    undecodable: int = 0


@dataclass(slots=True)
class StreamCounters(Counters):
    """Counts of what was received on a link. `lost` frames are missing in the sequence numbers.

    They are not counted in logs, which mix links and directions that each have their own sequence numbers.
    """

    lost: int = 0


class LossMeter:
    """Counts missing frames by the sequence numbers of each (system, component).

    A number up to 32 behind the newest is a duplicate or late: nothing is counted, and a late frame stays
    counted as lost. A number further behind means a restart of the sender, or a loss of more than half a
    wrap; these cannot be distinguished, and counting starts again.
    """

    _LATE = 32
    _HALF_WRAP = 128

    def __init__(self) -> None:
        self._expected: dict[int, int] = {}

    def lost_before(self, system_id: int, component_id: int, sequence: int) -> int:
        """The number of frames missing between the previous frame of this sender and this one."""
        sender = system_id << 8 | component_id
        expected = self._expected.get(sender, sequence)
        if sequence == expected:
            self._expected[sender] = (sequence + 1) & 0xFF
            return 0
        missing = (sequence - expected) & 0xFF
        if missing >= 256 - self._LATE:
            return 0
        self._expected[sender] = (sequence + 1) & 0xFF
        return missing if missing < self._HALF_WRAP else 0


def make_frame(message_id: int, payload: bytes, sequence: int, system_id: int, component_id: int) -> bytes:
    """A MAVLink 2 frame of a message that the dialect has; the zeros at the end of `payload` are cut off."""
    payload = payload.rstrip(b"\0") or b"\0"
    body = _pack_v2(
        len(payload), 0, 0, sequence, system_id, component_id, message_id & 0xFFFF, message_id >> 16
    )
    body += payload
    crc = crc_of(body)
    checksum = crc >> 8 ^ CRC_STEP[(crc ^ CRC_EXTRA[message_id]) & 0xFF]
    return bytes((MAGIC_V2,)) + body + checksum.to_bytes(2, "little")


def frame_at(data: bytes, start: int) -> Frame | UnknownFrame | Flaw:
    """The frame that begins at `start`, or why there is none."""
    size = len(data)
    if start >= size:
        return Flaw.CUT
    magic = data[start]
    if magic == MAGIC_V2:
        if start + HEADER_V2_BYTES > size:
            return Flaw.CUT
        length, flags, _, sequence, system_id, component_id, message_id, high = unpack_v2(data, start + 1)
        if flags > SIGNED:  # a frame with an unknown flag must be dropped
            return Flaw.NO_FRAME
        if high:
            message_id |= high << 16
        checksum_at = start + HEADER_V2_BYTES + length
        end = checksum_at + (CHECKSUM_BYTES + SIGNATURE_BYTES if flags else CHECKSUM_BYTES)
    elif magic == MAGIC_V1:
        if start + HEADER_V1_BYTES > size:
            return Flaw.CUT
        length, sequence, system_id, component_id, message_id = unpack_v1(data, start + 1)
        checksum_at = start + HEADER_V1_BYTES + length
        end = checksum_at + CHECKSUM_BYTES
    else:
        return Flaw.NO_FRAME
    if end > size:
        return Flaw.CUT
    crc = crc_of(data[start + 1 : checksum_at])
    checksum = data[checksum_at] | data[checksum_at + 1] << 8
    extra = crc_extra_of(message_id)
    if extra is None:
        # Only one of 256 checksums matches any CRC_EXTRA.
        if (checksum ^ crc >> 8) not in _CRC_STEPS:
            return Flaw.NO_FRAME
        return UnknownFrame(end - start, message_id, system_id, component_id, sequence)
    if crc >> 8 ^ CRC_STEP[(crc ^ extra) & 0xFF] != checksum:
        return Flaw.BAD_CRC if length <= MAX_PAYLOAD[message_id] else Flaw.NO_FRAME
    return new_frame(Frame, (data[start:end], message_id, system_id, component_id, sequence))


def next_magic(data: bytes, start: int) -> int:
    """The first position at or after `start` where a frame could begin, or else the end of `data`."""
    found = _find_magic(data, start)
    return found.start() if found else len(data)


def is_magic(data: bytes, position: int) -> bool:
    """Whether a frame could begin at `position`."""
    return position < len(data) and data[position] in (MAGIC_V1, MAGIC_V2)


class FrameSplitter:
    """Splits bytes into frames: `feed` for streams, `feed_datagram` for independent datagrams.

    Between two calls of `feed` at most one unfinished frame (`MAX_FRAME_BYTES`) is kept.
    """

    def __init__(self, counters: StreamCounters | None = None) -> None:
        self.counters = StreamCounters() if counters is None else counters
        self._kept = b""
        self._losses = LossMeter()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames completed by the next bytes of the stream."""
        data = self._kept + data
        frames, taken = self._split(data, final=False)
        self._kept = data[taken:]
        return frames

    def flush(self) -> list[Frame]:
        """End the stream: drop the unfinished frame, and return the frames that it may have hidden."""
        data, self._kept = self._kept, b""
        return self._split(data, final=True)[0]

    def feed_datagram(self, data: bytes) -> list[Frame]:
        """The frames of one datagram; a truncated frame at its end does not affect later datagrams."""
        return self._split(data, final=True)[0]

    def _split(self, data: bytes, *, final: bool) -> tuple[list[Frame], int]:
        """The frames in `data`, and how many of its bytes were processed: all if `final`."""
        frames: list[Frame] = []
        counters = self.counters
        position, size = 0, len(data)
        while position < size:
            found = frame_at(data, position)
            if isinstance(found, Frame):
                frames.append(found)
                counters.lost += self._losses.lost_before(*found[2:])
                position += len(found.raw)
                continue
            if isinstance(found, UnknownFrame):
                end = position + found.size
                if end == size and not final:
                    break  # only the next bytes show whether it is a frame
                if end == size or is_magic(data, end):
                    counters.unknown += 1
                    counters.lost += self._losses.lost_before(*found[2:])
                    position = end
                    continue
            elif found is Flaw.CUT and not final:
                break
            elif found is Flaw.BAD_CRC:
                counters.bad_crc += 1
            skipped_to = next_magic(data, position + 1)
            counters.bad_bytes += skipped_to - position
            position = skipped_to
        counters.frames += len(frames)
        return frames, position


_decoder = mavlink.MAVLink(None)


def decode(frame: Frame, counters: Counters | None = None) -> Message | None:
    """The message in a frame; `None`, counted as `undecodable`, if pymavlink refuses its content."""
    try:
        return _decoder.decode(bytearray(frame.raw))
    except (mavlink.MAVError, struct.error, ValueError):
        if counters is not None:
            counters.undecodable += 1
        return None
