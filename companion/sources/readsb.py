"""aircraft.json: the document that readsb, tar1090 and dump1090-fa write every second, with all they hear.

Source: README-json.md of readsb (fields of aircraft.json; its section numbers are those of DO-260B), and the
older names of fields in dump1090-mutability. Documents of services with the same fields under `ac` are read.
"""

import json
import math
from typing import Any, Final

from companion.mavlink.facts import RECEIVER, Traffic
from companion.model import AltitudeReference, LatLon, TrafficKind, TrafficReport, TrafficSource
from companion.sources import accuracy
from companion.sources.aircraft_table import AircraftTable
from companion.sources.decoder import Decoder, Heard
from companion.sources.document_parts import LISTS, PART, divided
from companion.sources.identity import address_key, callsign, emitter_kind, squawk
from companion.sources.quantities import (
    ALTITUDE_FT,
    CLIMB_FPM,
    COURSE_DEG,
    LATITUDE_DEG,
    LONGITUDE_DEG,
    SPEED_KT,
    Range,
    climb_mps,
    course_rad,
    metres,
    speed_mps,
)

MAX_DOCUMENT_BYTES: Final = 8_000_000
MAX_AIRCRAFT: Final = 5_000
_SOURCES: Final = {
    "adsb": TrafficSource.ADSB,
    "adsr": TrafficSource.ADSR,
    "tisb": TrafficSource.TISB,
    "mlat": TrafficSource.MLAT,
    "mode": TrafficSource.MODE_S,
}
_ADDRESS_DIGITS: Final = frozenset("0123456789abcdefABCDEF")
# A position older than this is of no use, and below it a new one is told from the last by its time: readsb
# rounds ages to 0.1 s or less, and aircraft send their position twice a second.
_MAX_AGE: Final = Range(0.0, 30.0)
_SAME_POSITION_S: Final = 0.25
# An aircraft without a position for this long is one of which only the altitude is known.
_NO_POSITION_S: Final = 10.0
# A document made before the last one is a late copy of another; unless it is long before it, or several such
# documents follow one another: then a clock was set back.
_LATE_COPY_S: Final = 60.0
_MAX_LATE_COPIES: Final = 3
_UNCHANGED_S: Final = 10.0
_MILLISECONDS: Final = 1e11
_CONTAINMENT_M: Final = Range(0.1, 100_000.0)
_CODES: Final = Range(0, 15)
_Entry = dict[str, Any]


class _Reported:
    """The times of the newest position and altitude that were reported, on the clock of the documents."""

    __slots__ = ("altitude_s", "position_s")

    def __init__(self) -> None:
        self.position_s = self.altitude_s = -math.inf


class ReadsbDecoder(Decoder):
    """Decodes aircraft.json: one document a feed. A position is reported once, when it is new."""

    format = "readsb"
    title = "readsb (aircraft.json)"
    lacks = "positions between the documents, the age of velocities"

    def __init__(self) -> None:
        super().__init__()
        self._aircraft: AircraftTable[str, _Reported] = AircraftTable(_Reported)
        self._made_s: float | None = None
        self._part: int | None = None  # of the last document, if it was divided
        self._read = 0  # aircraft of its parts
        self._late_copies = 0
        self._changed_s = self._fed_s = -math.inf

    @property
    def status(self) -> str | None:
        unchanged_s = self._fed_s - self._changed_s
        if self._made_s is None or unchanged_s < _UNCHANGED_S:
            return None
        return f"the document has not changed for {unchanged_s:.0f} s"

    @staticmethod
    def divided(document: bytes) -> list[bytes]:
        return divided(document) if len(document) <= MAX_DOCUMENT_BYTES else [document]

    def restart(self) -> None:
        """Nothing to forget: each document is complete."""

    def feed(self, data: bytes, received_s: float) -> list[Heard]:
        self._fed_s = received_s
        document = self._document(data)
        if document is None:
            return []
        made_s = _seconds(document.get("now"))
        made_s = received_s if made_s is None else made_s
        part = document.get(PART)
        if not self._is_next_part(made_s, part):
            self._part = part if isinstance(part, int) else None
            if not self._is_new(made_s):
                return []
            self.counters.messages += 1
            self._read = 0
        self._made_s, self._changed_s = made_s, received_s
        heard: list[Heard] = []
        for entry in self._entries(document):
            report = self._report(entry, made_s, received_s)
            if report is not None:
                self.counters.reports += 1
                heard.append(Traffic(RECEIVER, report))
        return heard

    def _document(self, data: bytes) -> _Entry | None:
        """The document as JSON; `None` if it is none, or has no list of aircraft."""
        if len(data) > MAX_DOCUMENT_BYTES:
            self.counters.bad["document too large"] += 1
            return None
        try:
            document = json.loads(data)
        except (ValueError, RecursionError):
            self.counters.bad["not JSON"] += 1
            return None
        if not isinstance(document, dict) or not isinstance(_list_of_aircraft(document), list):
            self.counters.bad["no list of aircraft"] += 1
            return None
        return document

    def _is_next_part(self, made_s: float, part: object) -> bool:
        """Whether a document goes on with the last one."""
        if made_s != self._made_s or self._part is None or not isinstance(part, int) or part <= self._part:
            return False
        self._part = part
        return True

    def _is_new(self, made_s: float) -> bool:
        if self._made_s is None or made_s > self._made_s:
            self._late_copies = 0
            return True
        if made_s == self._made_s:
            return False
        self._late_copies += 1
        if made_s < self._made_s - _LATE_COPY_S or self._late_copies > _MAX_LATE_COPIES:
            # The times that were reported are on a clock that is no more.
            self._aircraft, self._late_copies = AircraftTable(_Reported), 0
            return True
        self.counters.bad["late copy of a document"] += 1
        return False

    def _entries(self, document: _Entry) -> list[_Entry]:
        """The aircraft in the document, as many as are read."""
        entries, room = _list_of_aircraft(document), max(MAX_AIRCRAFT - self._read, 0)
        self._read += len(entries)
        usable = [entry for entry in entries[:room] if isinstance(entry, dict)]
        if len(entries) > room:
            self.counters.bad["too many aircraft"] += len(entries) - room
        if len(usable) < len(entries[:room]):
            self.counters.bad["not an aircraft"] += len(entries[:room]) - len(usable)
        return usable

    def _report(self, entry: _Entry, made_s: float, received_s: float) -> TrafficReport | None:
        address = _address(entry.get("hex"))
        if address is None:
            self.counters.bad["bad address"] += 1
            return None
        key = address_key(address[0], is_icao=address[1])
        reported = self._aircraft.heard(key, received_s) if key else _Reported()
        position = _position(entry)
        age_s = _number(entry.get("seen_pos", entry.get("seen", 0.0)), _MAX_AGE)
        if position is not None and age_s is not None:
            if made_s - age_s <= reported.position_s + _SAME_POSITION_S:
                position = None  # reported before
            else:
                reported.position_s = made_s - age_s
                return _traffic_report(entry, address, position, received_s - age_s)
        return self._altitude_alone(entry, address, reported, (made_s, received_s))

    def _altitude_alone(
        self, entry: _Entry, address: tuple[int, bool], reported: _Reported, times: tuple[float, float]
    ) -> TrafficReport | None:
        """A report of the altitude of an aircraft without a position."""
        made_s, received_s = times
        age_s = _number(entry.get("seen", 0.0), _MAX_AGE)
        if age_s is None or address[0] == 0 or made_s - reported.position_s <= _NO_POSITION_S:
            return None
        if made_s - age_s <= reported.altitude_s + _SAME_POSITION_S:
            return None
        report = _traffic_report(entry, address, None, received_s - age_s)
        if report.altitude_m is None:
            return None
        reported.altitude_s = made_s - age_s
        return report


def _list_of_aircraft(document: _Entry) -> Any:
    return next((document[name] for name in LISTS if name in document), None)


def _seconds(value: object) -> float | None:
    """A time of the document [s]; some services write milliseconds."""
    number = _number(value, Range(0.0, 1e14))
    return number / 1000.0 if number is not None and number > _MILLISECONDS else number


def _number(value: object, limits: Range) -> float | None:
    """A number in the range; `None` for anything else. True and false are no numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not limits.has(value):
        return None
    return float(value)


def _code(value: object) -> int | None:
    """A category of accuracy or integrity."""
    number = _number(value, _CODES)
    return None if number is None else int(number)


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _address(value: object) -> tuple[int, bool] | None:
    """The address, and whether it is one of ICAO; `None` if it is none."""
    text = _text(value)
    digits = text.removeprefix("~")
    if len(digits) != 6 or not _ADDRESS_DIGITS.issuperset(digits):
        return None
    return int(digits, 16), digits == text


def _position(entry: _Entry) -> LatLon | None:
    """The position itself. `lastPosition` is an old one, `rr_lat` and `rr_lon` are that of the receiver."""
    lat_deg, lon_deg = _number(entry.get("lat"), LATITUDE_DEG), _number(entry.get("lon"), LONGITUDE_DEG)
    if lat_deg is None or lon_deg is None or (lat_deg == 0.0 and lon_deg == 0.0):
        return None
    return lat_deg, lon_deg


def _source(entry: _Entry, position: LatLon | None) -> TrafficSource:
    """How the position was obtained: fields from MLAT and TIS-B are listed, whatever the type."""
    if position is None:
        return TrafficSource.MODE_S
    for name, source in (("mlat", TrafficSource.MLAT), ("tisb", TrafficSource.TISB)):
        listed = entry.get(name)
        if isinstance(listed, list) and "lat" in listed:
            return source
    source = _SOURCES.get(_text(entry.get("type"))[:4], TrafficSource.ADSB)
    return TrafficSource.ADSB if source is TrafficSource.MODE_S else source


def _traffic_report(
    entry: _Entry, address: tuple[int, bool], position: LatLon | None, time_s: float
) -> TrafficReport:
    """A report of an entry, valid at `time_s`."""
    barometric = entry.get("alt_baro", entry.get("altitude"))
    barometric_m = metres(_number(barometric, ALTITUDE_FT))
    geometric_m = metres(_number(entry.get("alt_geom"), ALTITUDE_FT))
    is_barometric = barometric_m is not None
    nacp = _code(entry.get("nac_p"))
    return TrafficReport(
        source=_source(entry, position),
        key=address_key(address[0], is_icao=address[1]),
        icao=address[0] if address[0] and address[1] else None,
        time_s=time_s,
        lat_deg=None if position is None else position[0],
        lon_deg=None if position is None else position[1],
        altitude_m=barometric_m if is_barometric else geometric_m,
        altitude_reference=AltitudeReference.BAROMETRIC if is_barometric else AltitudeReference.GEOMETRIC,
        geometric_altitude_m=geometric_m if is_barometric else None,
        course_rad=course_rad(_number(entry.get("track"), COURSE_DEG)),
        ground_speed_mps=speed_mps(_number(entry.get("gs", entry.get("speed")), SPEED_KT)),
        climb_mps=_climb_mps(entry, is_barometric=is_barometric),
        callsign=callsign(_text(entry.get("flight"))),
        squawk=squawk(_text(entry.get("squawk"))),
        kind=_kind(entry),
        airborne=barometric != "ground",
        position_sigma_m=accuracy.position_sigma_m(nacp),
        altitude_sigma_m=None if is_barometric else accuracy.altitude_sigma_m(nacp),
        velocity_sigma_mps=accuracy.velocity_sigma_mps(_code(entry.get("nac_v"))),
        containment_m=_containment_m(entry),
        sil=_code(entry.get("sil")),
    )


def _climb_mps(entry: _Entry, *, is_barometric: bool) -> float | None:
    """The climb, of the same kind as the altitude if both are known."""
    names = ("baro_rate", "geom_rate", "vert_rate") if is_barometric else ("geom_rate", "baro_rate")
    for name in names:
        climb_fpm = _number(entry.get(name), CLIMB_FPM)
        if climb_fpm is not None:
            return climb_mps(climb_fpm)
    return None


def _containment_m(entry: _Entry) -> float | None:
    """The radius of containment: as it is stated, otherwise that of the category."""
    stated_m = _number(entry.get("rc"), _CONTAINMENT_M)
    return accuracy.containment_m(_code(entry.get("nic"))) if stated_m is None else stated_m


def _kind(entry: _Entry) -> TrafficKind:
    return emitter_kind(_text(entry.get("category")))
