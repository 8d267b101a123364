"""FLARM: the sentences of its data port, over a serial line or TCP. Positions are relative to the receiver.

Source: FTD-012 "Data Port Interface Control Document (ICD)" of FLARM Technology, data port versions 6 to 9;
sentences PFLAA, PFLAU, PFLAE. Any field of PFLAA may be empty.
"""

import math
import re
from collections.abc import Sequence
from typing import ClassVar, Final

from companion.geodesy import wrap_two_pi
from companion.mavlink.facts import RECEIVER, ReceiverOwnship, Traffic
from companion.mavlink.translate.wire import printable
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, Vec3, adsb_key
from companion.sources.decoder import Decoder, Heard
from companion.sources.nmea import (
    ReceiverPosition,
    SentenceSplitter,
    ellipsoid_altitude_m,
    hexadecimal,
    minimum_data,
    number,
    pressure_altitude_m,
)

_AIRCRAFT_FIELDS, _STATUS_FIELDS = 13, 10
_ADDRESS = re.compile(r"[0-9A-Fa-f]{6}")
_ICAO = "1"
# The sentence is limited to 16 bits, but Stratux sends ADS-B traffic that is farther away.
_MAX_DISTANCE_M, _MAX_CLIMB_MPS, _MAX_SPEED_MPS = 400_000.0, 200.0, 1_000.0

_SOURCES: Final = {
    1: TrafficSource.ADSB,
    3: TrafficSource.ADSR,
    4: TrafficSource.TISB,
    6: TrafficSource.MODE_S,
}
_KINDS: Final = {0xD: TrafficKind.UAV, 0xF: TrafficKind.OBSTACLE}
_OBSTACLE_ALARM = 3  # AlarmType of PFLAU
# Gliders, tugs, drop planes, piston and jet aircraft fly at no speed of 0; helicopters and balloons do.
_CANNOT_HOVER = frozenset({0x1, 0x2, 0x5, 0x8, 0x9})

# Measurements of the receiver itself that are older do not belong to the present sentence.
_CURRENT_S = 2.0
# A target that PFLAA reported within this time is not taken from PFLAU, which is coarser.
_REPORTED_S, _MAX_REPORTED = 5.0, 500

# Severity 2 is reduced function, 3 a device that does not work; the codes have the words of other sentences.
_REDUCED = 2
_ERRORS: Final = {
    0x11: "firmware expired",
    0x21: "supply voltage low",
    0x2A: "transponder receiver failed",
    0x31: "GPS failed",
    0x33: "GPS antenna failed",
    0x41: "radio failed",
    0x42: "another device has the same radio address",
    0x43: "wrong address",
    0x71: "pressure sensor failed",
    0x81: "obstacle database unusable",
    0x82: "obstacle database expired",
    0x120: "outside of its region",
}


class FlarmDecoder(Decoder):
    """Decodes a stream of sentences; those without a valid checksum are dropped."""

    format: ClassVar[str] = "flarm"
    title: ClassVar[str] = "FLARM"
    lacks: ClassVar[str] = (
        "absolute positions, a height reference (heights are relative, by GPS or by pressure), accuracy"
    )

    def __init__(self) -> None:
        super().__init__()
        self._sentences = SentenceSplitter(self.counters.bad)
        self._error: str | None = None
        self._problems: list[str] = []
        self._own: ReceiverPosition | None = None
        # Each with the time of its reception.
        self._pressure_altitude_m: tuple[float, float] | None = None
        self._ellipsoid_altitude_m: tuple[float, float] | None = None
        # Targets of PFLAA by the name in both sentences: time, key and ICAO address.
        self._reported: dict[str, tuple[float, str, int | None]] = {}

    @property
    def status(self) -> str | None:
        """The error that the device announced, and the problems in its last status."""
        return ", ".join(([self._error] if self._error else []) + self._problems) or None

    def restart(self) -> None:
        """Forget the incomplete sentence and the status: the device announces it again."""
        self._sentences.restart()
        self._error, self._problems = None, []

    def feed(self, data: bytes, received_s: float) -> list[Heard]:
        """The reports in the sentences that these bytes complete."""
        heard: list[Heard] = []
        for name, *fields in self._sentences.feed(data):
            self.counters.messages += 1
            try:
                fact = self._translate(name, fields, received_s)
            except ValueError as error:
                self.counters.bad[str(error)] += 1
                continue
            heard += [] if fact is None else [fact]
        self.counters.reports += len(heard)
        return heard

    def _translate(self, name: str, fields: list[str], received_s: float) -> Heard | None:
        """The report in a sentence. Raises `ValueError` with the reason if a field cannot be."""
        match name:
            case "PFLAA":
                return self._aircraft(fields, received_s)
            case "PFLAU":
                return self._status(fields, received_s)
            case "PFLAE":
                self._announce_error(fields)
            case "PGRMZ":
                altitude_m = pressure_altitude_m(fields)
                self._pressure_altitude_m = None if altitude_m is None else (received_s, altitude_m)
            case _ if len(name) == 5 and name.endswith("GGA"):
                altitude_m = ellipsoid_altitude_m(fields)
                self._ellipsoid_altitude_m = None if altitude_m is None else (received_s, altitude_m)
            case _ if len(name) == 5 and name.endswith("RMC"):
                self._own = minimum_data(fields, received_s)
                return None if self._own is None else self._ownship(self._own)
            case _:
                pass
        return None

    def _aircraft(self, fields: list[str], received_s: float) -> Heard:
        """PFLAA: one aircraft. Track, speed and climb are empty for aircraft that hide them (stealth mode).

        Without an east component the north one is an estimated distance in an unknown direction; the height
        of such a target is that of its transponder, by pressure.
        """
        values = (*fields, *[""] * _AIRCRAFT_FIELDS)[:_AIRCRAFT_FIELDS]
        alarm, north, east, up, id_type, name, track, _, speed, climb, kind, _, source = values
        up_m = _distance_m(up)
        relative_m = _relative_m(_distance_m(north), _distance_m(east), up_m)
        type_code = hexadecimal(kind) or 0
        speed_mps = number(speed, 0.0, _MAX_SPEED_MPS)
        track_deg = number(track, 0.0, 360.0)
        key, icao, callsign = _identity(id_type, name)
        self._note_reported(name, (received_s, key, icao))
        report = TrafficReport(
            source=_source(source, relative_m),
            key=key,
            icao=icao,
            time_s=received_s,
            altitude_m=self._altitude_m(up_m, received_s) if relative_m is None else None,
            altitude_reference=AltitudeReference.BAROMETRIC,
            course_rad=None if track_deg is None else wrap_two_pi(math.radians(track_deg)),
            ground_speed_mps=speed_mps,
            climb_mps=number(climb, -_MAX_CLIMB_MPS, _MAX_CLIMB_MPS),
            callsign=callsign,
            kind=_KINDS.get(type_code, TrafficKind.AIRCRAFT),
            airborne=not (speed_mps == 0.0 and type_code in _CANNOT_HOVER),
            relative_m=relative_m,
            alarm=int(number(alarm, 0, 3) or 0),
        )
        return Traffic(RECEIVER, report)

    def _status(self, fields: Sequence[str], received_s: float) -> Heard | None:
        """PFLAU: the state of the device, and the most dangerous target.

        The target is used if PFLAA does not report it: at low data rates and for obstacles there is none.
        """
        values = (*fields, *[""] * _STATUS_FIELDS)[:_STATUS_FIELDS]
        _, transmits, fix, power, alarm, bearing, alarm_type, up, distance, name = values
        self._problems = ["no GPS fix"] if fix == "0" else []
        self._problems += ["does not transmit"] if transmits == "0" else []
        self._problems += ["supply voltage low"] if power == "0" else []
        level = int(number(alarm, 0, 3) or 0)
        distance_m, up_m = _distance_m(distance), _distance_m(up)
        key, icao, callsign = _identity("", name)
        reported_s, key, icao = self._reported.get(name[:6], (-math.inf, key, icao))
        if distance_m is None or received_s - reported_s <= _REPORTED_S:
            return None
        is_obstacle = (hexadecimal(alarm_type) or 0) == _OBSTACLE_ALARM
        report = TrafficReport(
            source=TrafficSource.FLARM,
            key=key,
            icao=icao,
            time_s=received_s,
            callsign=callsign,
            kind=TrafficKind.OBSTACLE if is_obstacle else TrafficKind.AIRCRAFT,
            relative_m=self._ahead_m(number(bearing, -180.0, 360.0), distance_m, up_m, received_s),
            alarm=level,
        )
        return Traffic(RECEIVER, report)

    def _announce_error(self, fields: Sequence[str]) -> None:
        """PFLAE: the result of the device's test of itself; the text is there from version 7 on."""
        query, severity, code, text, *_ = (*fields, *[""] * 4)
        if query != "A":
            return
        level, number_ = number(severity, 0, 3) or 0, hexadecimal(code) or 0
        words = printable(text) or _ERRORS.get(number_, f"error {number_:X}")
        self._error = words if level >= _REDUCED else None

    def _ownship(self, own: ReceiverPosition) -> Heard:
        """The receiver's own position, with the altitudes that were sent with it."""
        pressure_m = self._current(self._pressure_altitude_m, own.time_s)
        ellipsoid_m = self._current(self._ellipsoid_altitude_m, own.time_s)
        report = TrafficReport(
            source=TrafficSource.FLARM,
            key="",
            time_s=own.time_s,
            lat_deg=own.lat_deg,
            lon_deg=own.lon_deg,
            altitude_m=ellipsoid_m if pressure_m is None else pressure_m,
            altitude_reference=(
                AltitudeReference.GEOMETRIC if pressure_m is None else AltitudeReference.BAROMETRIC
            ),
            course_rad=None if own.course_deg is None else wrap_two_pi(math.radians(own.course_deg)),
            ground_speed_mps=own.ground_speed_mps,
            geometric_altitude_m=None if pressure_m is None else ellipsoid_m,
        )
        return ReceiverOwnship(RECEIVER, report)

    def _ahead_m(
        self, bearing_deg: float | None, distance_m: float, up_m: float | None, received_s: float
    ) -> Vec3 | None:
        """A position by distance and bearing from our own track; `None` while that is unknown."""
        own = self._own
        if own is None or own.course_deg is None or received_s - own.time_s > _CURRENT_S:
            return None
        if bearing_deg is None or up_m is None:
            return None
        azimuth_rad = math.radians(own.course_deg + bearing_deg)
        return distance_m * math.cos(azimuth_rad), distance_m * math.sin(azimuth_rad), up_m

    def _altitude_m(self, up_m: float | None, received_s: float) -> float | None:
        """The pressure altitude of a target that is `up_m` above us; `None` while ours is unknown."""
        own_m = self._current(self._pressure_altitude_m, received_s)
        return None if own_m is None or up_m is None else own_m + up_m

    @staticmethod
    def _current(measured: tuple[float, float] | None, now_s: float) -> float | None:
        return measured[1] if measured is not None and now_s - measured[0] <= _CURRENT_S else None

    def _note_reported(self, name: str, reported: tuple[float, str, int | None]) -> None:
        self._reported.pop(name[:6], None)
        self._reported[name[:6]] = reported
        if len(self._reported) > _MAX_REPORTED:
            del self._reported[next(iter(self._reported))]


def _distance_m(text: str) -> float | None:
    return number(text, -_MAX_DISTANCE_M, _MAX_DISTANCE_M)


def _relative_m(north_m: float | None, east_m: float | None, up_m: float | None) -> Vec3 | None:
    """A position relative to us; `None` if a component is missing."""
    return None if north_m is None or east_m is None or up_m is None else (north_m, east_m, up_m)


def _source(text: str, relative_m: Vec3 | None) -> TrafficSource:
    """The surveillance, stated since version 9; otherwise a target without direction has a transponder."""
    unnamed = TrafficSource.MODE_S if relative_m is None else TrafficSource.FLARM
    source = number(text, 0, 255)
    return unnamed if source is None else _SOURCES.get(int(source), TrafficSource.FLARM)


def _identity(id_type: str, name: str) -> tuple[str, int | None, str | None]:
    """Key, ICAO address and callsign; addresses that the device drew by lot are new in every flight.

    Stratux appends the callsign behind an exclamation mark.
    """
    address, _, callsign = name.partition("!")
    if not address:
        return "", None, printable(callsign)
    if not _ADDRESS.fullmatch(address):
        raise ValueError("not an address")
    icao = int(address, 16)
    if icao == 0:
        return "", None, printable(callsign)
    if id_type == _ICAO:
        return adsb_key(icao), icao, printable(callsign)
    return f"FLARM-{icao:06X}", None, printable(callsign)
