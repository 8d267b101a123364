"""Sentences of NMEA 0183: lines with checksums, the fields of a sentence, and a receiver's own position.

Source: NMEA 0183 as described in FTD-012 "Data Port Interface Control Document" of FLARM; sentences RMC, GGA
and PGRMZ.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor

from companion.units import FOOT_M, KNOT_MPS

# FLARM's longest sentences have about 120 bytes.
_MAX_LINE_BYTES = 256
# Python's own conversions accept more: "nan", "1_000", digits of other scripts.
_NUMBER = re.compile(r"[+-]?\d{1,9}(\.\d{0,9})?", re.ASCII)
_HEXADECIMAL = re.compile(r"[0-9A-Fa-f]{1,8}")
_CHECKSUM = re.compile(rb"[0-9A-Fa-f]{2}")
_DEGREES_MINUTES = re.compile(r"(\d{1,3})(\d\d(?:\.\d{0,9})?)", re.ASCII)


class SentenceSplitter:
    """Splits a stream into sentences: name and fields. `bad` counts the lines that are none, by reason."""

    def __init__(self, bad: Counter[str]) -> None:
        self._bad = bad
        self._rest = b""
        self._is_skipping = False

    def restart(self) -> None:
        """Forget the incomplete line."""
        self._rest, self._is_skipping = b"", False

    def feed(self, data: bytes) -> Iterator[list[str]]:
        """The sentences in the lines that these bytes complete; the checksum is required."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if lines and self._is_skipping:
            self._is_skipping = False
            lines = lines[1:]
        for line in lines:
            sentence = self._sentence(line.strip())
            if sentence:
                yield sentence
        if len(self._rest) > _MAX_LINE_BYTES:
            self._bad.update([] if self._is_skipping else ["too long"])
            self._rest, self._is_skipping = b"", True

    def _sentence(self, line: bytes) -> list[str]:
        """Name and fields; nothing for an empty or damaged line.

        What stands before the last `$` is a line whose end was lost.
        """
        before, dollar, body = line.rpartition(b"$")
        reason = None
        if len(line) > _MAX_LINE_BYTES:
            reason = "too long"
        elif not dollar:
            reason = "no sentence" if line else None
        elif not (body[-3:-2] == b"*" and _CHECKSUM.fullmatch(body[-2:])):
            reason = "no checksum"
        elif reduce(xor, body[:-3], 0) != int(body[-2:], 16):
            reason = "wrong checksum"
        if reason is not None or not line:
            self._bad.update([reason] if reason else [])
            return []
        self._bad.update(["truncated"] if before else [])
        return body[:-3].decode("latin-1").split(",")


def number(text: str, low: float, high: float) -> float | None:
    """A decimal number; `None` for an empty field.

    Raises `ValueError` with the reason for anything else, and for a number outside the limits.
    """
    if not text:
        return None
    if not _NUMBER.fullmatch(text):
        raise ValueError("not a number")
    value = float(text)
    if not low <= value <= high:
        raise ValueError("out of range")
    return value


def hexadecimal(text: str) -> int | None:
    """A hexadecimal number of at most 32 bits; `None` for an empty field, `ValueError` for anything else."""
    if not text:
        return None
    if not _HEXADECIMAL.fullmatch(text):
        raise ValueError("not a number")
    return int(text, 16)


@dataclass(slots=True)
class ReceiverPosition:
    """The last of each of the receiver's own measurements, with the time of its reception."""

    time_s: float
    lat_deg: float
    lon_deg: float
    ground_speed_mps: float | None
    course_deg: float | None


def minimum_data(fields: Sequence[str], received_s: float) -> ReceiverPosition | None:
    """The position in the fields of an RMC sentence; `None` without a fix. Raises like `number`."""
    _, valid, lat, north, lon, east, speed_kt, course_deg, *_ = (*fields, *[""] * 8)
    lat_deg, lon_deg = _angle_deg(lat, north, "NS", 90.0), _angle_deg(lon, east, "EW", 180.0)
    if valid != "A" or lat_deg is None or lon_deg is None:
        return None
    speed = number(speed_kt, 0.0, 2000.0)
    return ReceiverPosition(
        received_s,
        lat_deg,
        lon_deg,
        None if speed is None else speed * KNOT_MPS,
        number(course_deg, 0.0, 360.0),
    )


def ellipsoid_altitude_m(fields: Sequence[str]) -> float | None:
    """Altitude above the ellipsoid in the fields of GGA; `None` without a fix. Raises like `number`."""
    *_, quality, _, _, above_sea, _, separation = (*fields, *[""] * 11)[:11]
    altitude_m, separation_m = number(above_sea, -2e3, 1e5), number(separation, -200.0, 200.0)
    if quality in ("", "0") or altitude_m is None or separation_m is None:
        return None
    return altitude_m + separation_m


def pressure_altitude_m(fields: Sequence[str]) -> float | None:
    """Pressure altitude in the fields of PGRMZ; `None` if it is not by pressure. Raises like `number`.

    The last field is 2 for a barometer; Garmin's devices send 3 for an altitude by satellites.
    """
    value, unit, kind, *_ = (*fields, *[""] * 3)
    altitude_ft = number(value, -5e3, 2e5)
    return altitude_ft * FOOT_M if altitude_ft is not None and unit in ("F", "f") and kind == "2" else None


def _angle_deg(text: str, side: str, sides: str, most_deg: float) -> float | None:
    """An angle of degrees and minutes, negative on the second of two sides; `None` for an empty field."""
    if not text:
        return None
    match = _DEGREES_MINUTES.fullmatch(text)
    if match is None or len(side) != 1 or side not in sides:
        raise ValueError("not a number")
    angle_deg = int(match[1]) + float(match[2]) / 60.0
    if float(match[2]) >= 60.0 or angle_deg > most_deg:
        raise ValueError("out of range")
    return -angle_deg if side == sides[1] else angle_deg
