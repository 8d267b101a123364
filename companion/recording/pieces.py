"""What receivers sent, in the log: each piece as TUNNEL frames, which are never sent on a link.

The payload of each frame is a header and a part of the piece's content: the address of the receiver, preceded
by its length, and the bytes that it sent, deflated (zlib) where that makes them shorter.
"""

import json
import struct
import zlib
from collections.abc import Set
from typing import NamedTuple

from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Sender
from companion.mavlink.framing import Frame, make_frame
from companion.sources.receiver import Piece

TUNNEL: int = mavlink.MAVLINK_MSG_ID_TUNNEL
_PAYLOAD_TYPE = 0xCA90  # of the range for private use, from 32768 on
# MAVLink's fields: payload type, target system and component (all), length of the payload.
_fields = struct.Struct("<HBBB")
# Ours: version and flags, number of the piece, number of the part, number of parts. All wrap around.
_header = struct.Struct("<BHHH")
_VERSION, _DEFLATED, _BEGINS = 0x10, 0x01, 0x02
_PAYLOAD_BYTES = 128
_PART_BYTES = _PAYLOAD_BYTES - _header.size
_MAX_PARTS = 0xFFFF
_MAX_CONTENT_BYTES = 9 << 20  # above the largest document
# A number that is further ahead than this is of another recording, and no loss.
_MAX_LOST = 1000
# Pieces with this address are notes of ours: what the log cannot say about links.
NOTES = "companion"
_MOST_SENDERS = 1024


def is_piece(frame: Frame) -> bool:
    """Whether a frame is a part of a recorded piece."""
    return frame.message_id == TUNNEL and frame.payload[:2] == _PAYLOAD_TYPE.to_bytes(2, "little")


class PieceWriter:
    """Divides pieces into frames; one for a recording."""

    def __init__(self) -> None:
        self._number = 0
        self._sequence = 0

    def frames(self, piece: Piece, sender: Sender) -> list[bytes]:
        """The frames of a piece, with `sender` as their sender; none if it is too large."""
        name = piece.address.encode()[:255]
        content = bytes((len(name),)) + name + piece.data
        flags = _VERSION | (_BEGINS if piece.begins else 0)
        if len(content) > _PART_BYTES and len(deflated := zlib.compress(content, 1)) < len(content):
            content, flags = deflated, flags | _DEFLATED
        number, self._number = self._number, (self._number + 1) & 0xFFFF
        parts = range(0, len(content), _PART_BYTES)
        if len(parts) > _MAX_PARTS:
            return []
        return [
            self._frame(
                _header.pack(flags, number, index, len(parts)) + content[start : start + _PART_BYTES], sender
            )
            for index, start in enumerate(parts)
        ]

    def _frame(self, payload: bytes, sender: Sender) -> bytes:
        sequence, self._sequence = self._sequence, (self._sequence + 1) & 0xFF
        payload = _fields.pack(_PAYLOAD_TYPE, 0, 0, len(payload)) + payload
        return make_frame(TUNNEL, payload, sequence, *sender)


class PieceReader:
    """Joins frames to pieces again. `lost` counts pieces of which a part is damaged or missing."""

    def __init__(self) -> None:
        self.lost = 0
        self._number: int | None = None
        self._parts: list[bytes] | None = None  # of the piece with this number; `None`: complete, or given up

    def add(self, frame: Frame) -> Piece | None:
        """The piece that this frame (see `is_piece`) completes; `None` if it completes none."""
        payload = frame.payload.ljust(_fields.size + _PAYLOAD_BYTES, b"\0")
        length = _fields.unpack_from(payload)[3]
        flags, number, index, count = _header.unpack_from(payload, _fields.size)
        if flags & 0xF0 != _VERSION or index >= count:
            self.lost += 1
            return None
        parts = self._parts_before(number, index)
        if parts is None:
            return None
        parts.append(payload[_fields.size + _header.size : _fields.size + length])
        if len(parts) < count:
            return None
        self._parts = None
        piece = _piece_of(b"".join(parts), flags)
        self.lost += piece is None
        return piece

    def _parts_before(self, number: int, index: int) -> list[bytes] | None:
        """The parts of this piece before this one; `None` if one is missing, or this one is a copy."""
        if number != self._number:
            ahead = 1 if self._number is None else (number - self._number) & 0xFFFF
            self.lost += (ahead - 1 if ahead <= _MAX_LOST else 0) + (self._parts is not None)
            self._number, self._parts = number, []
        if self._parts is None or index < len(self._parts):
            return None
        if index > len(self._parts):
            self._parts = None
            self.lost += 1
        return self._parts


class HeardElsewhere(NamedTuple):
    """The MAVLink senders of traffic on links of their own, and whether another receiver works."""

    senders: Set[tuple[int, int]]
    receiver_works: bool

    def to_piece(self) -> Piece:
        """The same as a piece of a recording."""
        note = {"elsewhere": sorted(self.senders)[:_MOST_SENDERS], "receiver_works": self.receiver_works}
        return Piece(NOTES, json.dumps(note, separators=(",", ":")).encode(), begins=False)

    @classmethod
    def of_piece(cls, piece: Piece) -> "HeardElsewhere | None":
        """What a note says; `None` if it is damaged."""
        try:
            note = json.loads(piece.data)
            senders = frozenset((int(system), int(component)) for system, component in note["elsewhere"])
            return cls(senders, note["receiver_works"] is True)
        except (ValueError, KeyError, TypeError, RecursionError):
            return None


def _piece_of(content: bytes, flags: int) -> Piece | None:
    if flags & _DEFLATED:
        try:
            content = zlib.decompressobj().decompress(content, _MAX_CONTENT_BYTES)
        except zlib.error:
            return None
    length = content[0] if content else 0
    if not 0 < length < len(content):
        return None
    name, data = content[1 : 1 + length], content[1 + length :]
    try:
        return Piece(name.decode(), data, bool(flags & _BEGINS))
    except UnicodeDecodeError:
        return None
