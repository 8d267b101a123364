"""Mode S messages as Beast binary (TCP port 30005), or as lines of hexadecimal digits (AVR, port 30002).

Source: "Mode-S Beast data output formats" (Günter Köllner, jetvision): an escape byte, the type, a time of
12 MHz in six bytes, the signal level and the message, with escape bytes within doubled. AVR lines begin with
`*`, or with `@` and the same time, and end with a semicolon.
"""

import re
from collections import Counter
from typing import Final, NamedTuple

from companion.mavlink.facts import RECEIVER, Traffic
from companion.sources.decoder import Decoder, Heard

_ESCAPE: Final = 0x1A
_TIME_BYTES: Final = 6
_HEADER_BYTES: Final = _TIME_BYTES + 1
_MODE_AC_BYTES: Final = 2
# The length of the messages by type: Mode A or C, Mode S short and long.
_MESSAGE_BYTES: Final = {ord("1"): _MODE_AC_BYTES, ord("2"): 7, ord("3"): 14}
# Frames that are no messages: settings of the receiver ("4"), positions ("5") and marks of readsb.
_OTHER_TYPES: Final = frozenset({ord("4"), ord("5"), 0xE3, 0xE4, 0xE8})
_STARTS: Final = re.compile(rb"[\x1a*@]")
_LINE: Final = re.compile(rb"(?:\*|@(?P<time>[0-9A-Fa-f]{12}))(?P<message>(?:[0-9A-Fa-f]{2})+);")
_LINE_SO_FAR: Final = re.compile(rb"[*@][0-9A-Fa-f]*")
_MAX_LINE_BYTES: Final = 1 + 2 * (_TIME_BYTES + 14) + 1
# The time that the dump1090 family gives to positions from multilateration ("MLAT" in its last bytes).
_MLAT_TIME: Final = 0xFF004D4C4154


class BeastFrame(NamedTuple):
    """A received message: the counter of 12 MHz at its reception (`None` without), and the signal level."""

    message: bytes
    time: int | None = None
    signal: int | None = None


class BeastFramer:
    """Splits a stream into frames. What is kept between two pieces is shorter than one frame."""

    def __init__(self, bad: Counter[str]) -> None:
        self._bad = bad
        self._rest = b""
        self._is_other = False

    def restart(self) -> None:
        """Forget the incomplete frame."""
        self._rest, self._is_other = b"", False

    def feed(self, data: bytes) -> list[BeastFrame]:
        """The frames that a piece of the stream completes."""
        stream = self._rest + data
        at, frames = 0, []
        while at < len(stream):
            taken, frame = self._next(stream, at)
            if taken == 0:
                break
            at += taken
            if frame is not None:
                frames.append(frame)
        self._rest = stream[at:]
        return frames

    def _next(self, stream: bytes, at: int) -> tuple[int, BeastFrame | None]:
        """The bytes that were understood, 0 if more are needed, and a frame if they are one."""
        if stream[at] == _ESCAPE:
            return self._binary(stream, at)
        if stream[at : at + 1] in (b"*", b"@") and not self._is_other:
            return self._line(stream, at)
        return self._skip(stream, at, "not a frame")

    def _skip(self, stream: bytes, at: int, reason: str) -> tuple[int, None]:
        """Skip all up to what may be the start of a frame."""
        found = _STARTS.search(stream, at + 1)
        end = len(stream) if found is None else found.start()
        if stream[at:end].strip() and not self._is_other:
            self._bad[reason] += 1
        return end - at, None

    def _binary(self, stream: bytes, at: int) -> tuple[int, BeastFrame | None]:
        if at + 1 >= len(stream):
            return 0, None
        kind = stream[at + 1]
        if kind == _ESCAPE:
            return 2, None  # a doubled escape byte within something that was skipped
        length = _MESSAGE_BYTES.get(kind)
        self._is_other = kind in _OTHER_TYPES
        if length is None:
            if not self._is_other:
                self._bad["unknown type of frame"] += 1
            return 2, None
        taken, content = _unescaped(stream, at + 2, _HEADER_BYTES + length)
        if content is None:
            return 0, None
        if len(content) < _HEADER_BYTES + length:
            self._bad["truncated"] += 1
            return 2 + taken, None
        time = int.from_bytes(content[:_TIME_BYTES], "big")
        return 2 + taken, BeastFrame(content[_HEADER_BYTES:], time, content[_TIME_BYTES])

    def _line(self, stream: bytes, at: int) -> tuple[int, BeastFrame | None]:
        whole = stream[at : at + _MAX_LINE_BYTES]
        found = _LINE.match(whole)
        if found is not None:
            message = bytes.fromhex(found["message"].decode("ascii"))
            time = None if found["time"] is None else int(found["time"], 16)
            if len(message) in _MESSAGE_BYTES.values():
                return found.end(), BeastFrame(message, time)
        elif len(whole) < _MAX_LINE_BYTES and _LINE_SO_FAR.fullmatch(whole):
            return 0, None
        return self._skip(stream, at, "bad line")


def _unescaped(stream: bytes, at: int, length: int) -> tuple[int, bytes | None]:
    """The bytes taken and their content: shorter if a new frame begins within, `None` if more are needed."""
    plain = stream[at : at + length]
    if _ESCAPE not in plain:
        return (length, plain) if len(plain) == length else (0, None)
    content, here = bytearray(), at
    while len(content) < length:
        if here >= len(stream):
            return 0, None
        if stream[here] == _ESCAPE:
            if here + 1 >= len(stream):
                return 0, None
            if stream[here + 1] != _ESCAPE:
                break
            here += 1
        content.append(stream[here])
        here += 1
    return here - at, bytes(content)


class BeastDecoder(Decoder):
    """Decodes Mode S messages of a receiver, or of readsb and dump1090."""

    format = "beast"
    title = "Beast (Mode S)"
    lacks = "positions of aircraft without ADS-B"

    def __init__(self) -> None:
        super().__init__()
        # Only who has such a receiver pays for the library that decodes Mode S.
        from companion.sources.mode_s import ModeSDecoder

        self._framer = BeastFramer(self.counters.bad)
        self._mode_s = ModeSDecoder(self.counters)

    def restart(self) -> None:
        self._framer.restart()

    def feed(self, data: bytes, received_s: float) -> list[Heard]:
        heard: list[Heard] = []
        for frame in self._framer.feed(data):
            if len(frame.message) == _MODE_AC_BYTES:
                self.counters.messages += 1  # no address: it cannot be told whose altitude that is
                continue
            is_mlat = frame.time == _MLAT_TIME
            for report in self._mode_s.decode(frame.message, received_s, is_mlat=is_mlat):
                self.counters.reports += 1
                heard.append(Traffic(RECEIVER, report))
        return heard
