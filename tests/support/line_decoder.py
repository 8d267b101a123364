"""A small format for tests of what lies between a receiver and the engine: one line of text a message.

`T,address,lat,lon,altitude,course,speed` is traffic (degrees, metres, m/s), `O,...` the receiver's own
aircraft, `H` a heartbeat, `S,words` a problem of the receiver, `!` an error that a decoder must not raise.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from companion.mavlink.facts import RECEIVER, ReceiverOwnship, Traffic
from companion.model import TrafficReport, TrafficSource, adsb_key
from companion.sources.decoder import Decoder, Heard
from companion.sources.registry import FORMATS, Format

_MAX_LINE = 200


class LineDecoder(Decoder):
    format = "gdl90"
    title = "GDL 90"
    lacks = "everything but lines"

    def __init__(self) -> None:
        super().__init__()
        self._rest = b""
        self._status: str | None = None
        self.restarts = 0

    @property
    def status(self) -> str | None:
        return self._status

    def restart(self) -> None:
        self.restarts += 1
        self._rest = b""

    def feed(self, data: bytes, received_s: float) -> list[Heard]:
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-_MAX_LINE:]
        return [fact for line in lines if (fact := self._line(line, received_s)) is not None]

    def _line(self, line: bytes, received_s: float) -> Heard | None:
        if line.startswith(b"!"):
            raise ZeroDivisionError("a bug of the decoder")
        try:
            kind, *fields = line.decode("ascii").split(",")
            if kind in ("T", "O"):
                report = _report(fields, received_s)
                self.counters.messages += 1
                self.counters.reports += 1
                return Traffic(RECEIVER, report) if kind == "T" else ReceiverOwnship(RECEIVER, report)
            if kind == "S":
                self._status = fields[0] or None
            elif kind != "H":
                self.counters.bad["unknown line"] += 1
                return None
        except (ValueError, IndexError):
            self.counters.bad["not a number"] += 1
            return None
        self.counters.messages += 1
        return None


class LineDocumentDecoder(LineDecoder):
    format = "readsb"
    title = "readsb"


def _report(fields: list[str], received_s: float) -> TrafficReport:
    icao, (lat, lon, altitude_m, course_deg, speed_mps) = int(fields[0], 16), map(float, fields[1:6])
    return TrafficReport(
        TrafficSource.ADSB,
        adsb_key(icao),
        received_s,
        lat,
        lon,
        altitude_m,
        course_rad=math.radians(course_deg),
        ground_speed_mps=speed_mps,
        icao=icao,
    )


def traffic_line(icao: int, lat_deg: float, lon_deg: float, altitude_m: float = 884.0) -> bytes:
    return b"T,%06X,%.6f,%.6f,%.1f,180,60\n" % (icao, lat_deg, lon_deg, altitude_m)


@contextmanager
def line_formats() -> Iterator[None]:
    """`gdl90` and `readsb` are lines of text meanwhile."""
    here = __name__
    lines = {
        "gdl90": Format(f"{here}:LineDecoder"),
        "readsb": Format(f"{here}:LineDocumentDecoder", documents=True),
    }
    with patch.dict(FORMATS, lines):
        yield
