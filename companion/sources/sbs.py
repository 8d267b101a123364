"""SBS-1: the text lines that Kinetic's BaseStation serves at TCP port 30003, and readsb and dump1090 with it.

Source: "Socket Data and BaseStation", Barebones SBS article 42, tables of message types and fields; the
variants of dump1090 and readsb (an H behind geometric altitudes) and of mlat-client (MLAT lines, 26 fields).
"""

import re
from dataclasses import dataclass
from datetime import datetime
from typing import Final, NamedTuple

from companion.mavlink.facts import RECEIVER, Traffic
from companion.model import AltitudeReference, LatLon, TrafficReport, TrafficSource
from companion.sources.aircraft_table import AircraftTable
from companion.sources.decoder import Decoder, Heard
from companion.sources.identity import address_key, callsign, squawk
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

MAX_LINE_BYTES: Final = 512
_FIELDS: Final = 22
_SOURCES: Final = {"MSG": TrafficSource.ADSB, "MLAT": TrafficSource.MLAT}
# What BaseStation says of itself: selections, new aircraft and callsigns, status changes, clicks.
_OTHER_LINES: Final = frozenset({"SEL", "ID", "AIR", "STA", "CLK"})
_SURFACE_POSITION: Final = 2
_NUMBER: Final = re.compile(r"[+-]?[0-9]{1,7}(?:\.[0-9]{0,12})?")
_ADDRESS: Final = re.compile(r"~?[0-9A-Fa-f]{6}")
_ON_GROUND: Final = {"": False, "0": False, "-1": True, "1": True}
# ADS-B sends position and velocity twice a second each: older ones are not of the same moment.
_JOINED_S: Final = 3.0
# An aircraft without a position for this long is one of which only the altitude is known.
_NO_POSITION_S: Final = 10.0
_ALTITUDE_INTERVAL_S: Final = 1.0
# Lines that were generated longer ago are no traffic; BaseStation once delayed all lines by five minutes.
_DELAYED_S: Final = 60.0
# Both clocks of a line are the same one; a difference above is one between time zones.
_MAX_DELAY_S: Final = 890.0


class _BadLineError(Exception):
    """A line that cannot be used, and why."""


class _Line(NamedTuple):
    """What one line says; `None` for an empty field."""

    source: TrafficSource
    is_surface_position: bool
    address: int
    is_icao: bool
    delay_s: float
    callsign: str | None
    altitude_ft: float | None
    is_geometric: bool
    speed_kt: float | None
    course_deg: float | None
    position: LatLon | None
    climb_fpm: float | None
    squawk: int | None
    on_ground: bool


@dataclass(slots=True)
class _Aircraft:
    """What earlier lines said, with the times of those that change quickly."""

    callsign: str | None = None
    squawk: int | None = None
    speed_kt: float | None = None
    course_deg: float | None = None
    velocity_s: float = float("-inf")
    climb_fpm: float | None = None
    climb_s: float = float("-inf")
    position_s: float = float("-inf")
    altitude_s: float = float("-inf")


class SbsDecoder(Decoder):
    """Decodes SBS-1 lines: MSG,1 to MSG,8 combined for each address.

    The lines state the time in an unknown zone, so the time of reception counts; the difference between
    the two times of a line, of the message and of the line, is its delay.
    """

    format = "sbs"
    title = "SBS-1 (BaseStation)"
    lacks = "accuracy, category, geometric altitude"

    def __init__(self) -> None:
        super().__init__()
        self._rest = b""
        self._is_too_long = False
        self._delay_s = 0.0
        self._aircraft: AircraftTable[str, _Aircraft] = AircraftTable(_Aircraft)

    @property
    def status(self) -> str | None:
        if self._delay_s <= _DELAYED_S:
            return None
        return f"its lines are {self._delay_s:.0f} s old when they arrive"

    def restart(self) -> None:
        self._rest, self._is_too_long = b"", False

    def feed(self, data: bytes, received_s: float) -> list[Heard]:
        heard: list[Heard] = []
        for line in self._lines(data):
            try:
                parsed = _parse(line)
            except _BadLineError as problem:
                self.counters.bad[str(problem)] += 1
                continue
            self.counters.messages += 1
            report = None if parsed is None else self._report(parsed, received_s)
            if report is not None:
                self.counters.reports += 1
                heard.append(Traffic(RECEIVER, report))
        return heard

    def _lines(self, data: bytes) -> list[bytes]:
        """The whole lines without their ends; the rest is kept, up to the longest line."""
        *lines, rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        if lines and self._is_too_long:  # the end of a line whose beginning was thrown away
            lines[0], self._is_too_long = b"", False
        if len(rest) > MAX_LINE_BYTES:
            if not self._is_too_long:
                self.counters.bad["line too long"] += 1
            rest, self._is_too_long = b"", True
        self._rest = rest
        return [line for line in lines if line.strip()]

    def _report(self, line: _Line, received_s: float) -> TrafficReport | None:
        self._delay_s = line.delay_s
        if line.delay_s > _DELAYED_S:
            self.counters.bad["delayed by minutes"] += 1
            return None
        time_s = received_s - line.delay_s
        key = address_key(line.address, is_icao=line.is_icao)
        # Lines without an address may be about several aircraft: nothing of one is true of the next.
        aircraft = self._aircraft.heard(key, received_s) if key else _Aircraft()
        _remember(aircraft, line, time_s)
        if line.position is not None:
            aircraft.position_s = time_s
        elif not _is_altitude_alone(aircraft, line, time_s):
            return None
        else:
            aircraft.altitude_s = time_s
        return _traffic_report(aircraft, line, key, time_s)


def _parse(raw: bytes) -> _Line | None:
    """The content of a line; `None` for a line that is not about an aircraft's transmission."""
    if len(raw) > MAX_LINE_BYTES:
        raise _BadLineError("line too long")
    if not raw.isascii() or not raw.decode("ascii").isprintable():
        raise _BadLineError("not printable ASCII")
    fields = [field.strip() for field in raw.decode("ascii").split(",")]
    if fields[0] in _OTHER_LINES:
        return None
    source = _SOURCES.get(fields[0])
    if source is None:
        raise _BadLineError("unknown kind of line")
    if len(fields) < _FIELDS:
        raise _BadLineError("truncated")
    if source is TrafficSource.ADSB and any(fields[_FIELDS:]):
        raise _BadLineError("too many fields")
    if len(fields[1]) != 1 or fields[1] not in "12345678":
        raise _BadLineError("unknown kind of line")
    return _content(source, fields)


def _content(source: TrafficSource, fields: list[str]) -> _Line:
    """What the fields say, counted from 0; those that do not concern us are not looked at."""
    if not _ADDRESS.fullmatch(fields[4]):
        raise _BadLineError("bad address")
    if fields[21] not in _ON_GROUND:
        raise _BadLineError("bad flag")
    altitude = fields[11]
    is_surface_position = int(fields[1]) == _SURFACE_POSITION
    return _Line(
        source=source,
        is_surface_position=is_surface_position,
        address=int(fields[4].lstrip("~"), 16),
        is_icao=not fields[4].startswith("~"),
        delay_s=_delay_s(fields[6:10]),
        callsign=callsign(fields[10]),
        altitude_ft=_number(altitude.removesuffix("H"), ALTITUDE_FT),
        is_geometric=altitude.endswith("H"),
        speed_kt=_number(fields[12], SPEED_KT),
        course_deg=_number(fields[13], COURSE_DEG),
        position=_position(fields[14], fields[15]),
        climb_fpm=_number(fields[16].removesuffix("H"), CLIMB_FPM),
        squawk=squawk(fields[17]),
        on_ground=is_surface_position or _ON_GROUND[fields[21]],
    )


def _number(text: str, limits: Range) -> float | None:
    """A decimal number; `None` for an empty field."""
    if not text:
        return None
    if not _NUMBER.fullmatch(text):
        raise _BadLineError("not a number")
    value = float(text)
    if not limits.has(value):
        raise _BadLineError("out of range")
    return value


def _position(lat: str, lon: str) -> LatLon | None:
    """Latitude and longitude; `None` for empty ones, and for 0, 0, which means that it is unknown."""
    lat_deg, lon_deg = _number(lat, LATITUDE_DEG), _number(lon, LONGITUDE_DEG)
    if lat_deg is None or lon_deg is None or (lat_deg == 0.0 and lon_deg == 0.0):
        return None
    return lat_deg, lon_deg


def _delay_s(times: list[str]) -> float:
    """The time from the message to the line [s], from their dates and times; 0 if that is unknown."""
    if times[:2] == times[2:]:
        return 0.0
    try:
        generated, logged = (
            datetime.fromisoformat(f"{date.replace('/', '-')}T{time}")
            for date, time in (times[:2], times[2:])
        )
        delay_s = (logged - generated).total_seconds()
    except (ValueError, TypeError):
        return 0.0
    return delay_s if 0.0 <= delay_s < _MAX_DELAY_S else 0.0


def _remember(aircraft: _Aircraft, line: _Line, time_s: float) -> None:
    aircraft.callsign = line.callsign or aircraft.callsign
    aircraft.squawk = aircraft.squawk if line.squawk is None else line.squawk
    if line.speed_kt is not None:
        aircraft.speed_kt, aircraft.course_deg = line.speed_kt, line.course_deg
        aircraft.velocity_s = time_s
    if line.climb_fpm is not None:
        aircraft.climb_fpm, aircraft.climb_s = line.climb_fpm, time_s


def _is_altitude_alone(aircraft: _Aircraft, line: _Line, time_s: float) -> bool:
    """Whether the line's altitude is worth a report: there is no position, and none was a moment ago."""
    return (
        line.altitude_ft is not None
        and line.address != 0
        and time_s - aircraft.position_s > _NO_POSITION_S
        and time_s - aircraft.altitude_s >= _ALTITUDE_INTERVAL_S
    )


def _traffic_report(aircraft: _Aircraft, line: _Line, key: str, time_s: float) -> TrafficReport:
    """A position or an altitude, with the velocity if that is of the same moment.

    Surface positions have no altitude: one that stands there is from elsewhere.
    """
    has_velocity = abs(time_s - aircraft.velocity_s) <= _JOINED_S
    has_climb = abs(time_s - aircraft.climb_s) <= _JOINED_S
    return TrafficReport(
        source=TrafficSource.MODE_S if line.position is None else line.source,
        key=key,
        icao=line.address if key and line.is_icao else None,
        time_s=time_s,
        lat_deg=None if line.position is None else line.position[0],
        lon_deg=None if line.position is None else line.position[1],
        altitude_m=None if line.is_surface_position else metres(line.altitude_ft),
        altitude_reference=(
            AltitudeReference.GEOMETRIC if line.is_geometric else AltitudeReference.BAROMETRIC
        ),
        course_rad=course_rad(aircraft.course_deg) if has_velocity else None,
        ground_speed_mps=speed_mps(aircraft.speed_kt) if has_velocity else None,
        climb_mps=climb_mps(aircraft.climb_fpm) if has_climb else None,
        callsign=aircraft.callsign,
        squawk=aircraft.squawk,
        airborne=not line.on_ground,
    )
