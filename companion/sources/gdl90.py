"""GDL 90: the binary messages of Stratux, SkyEcho, pingUSB and others, mostly over UDP port 4000.

Sources: "GDL 90 Data Interface Specification", Garmin 560-1058-00 Rev A (sections are cited below), and the
"GDL 90 Extended Specification" of ForeFlight for message 0x65.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar, Final

from fastcrc import crc16

from companion.mavlink.facts import RECEIVER, ReceiverOwnship, Traffic
from companion.mavlink.translate.adsb import EMITTER_KINDS
from companion.mavlink.translate.wire import printable
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, adsb_key
from companion.sources.accuracy import containment_m, position_sigma_m
from companion.sources.decoder import Decoder, Heard
from companion.units import FOOT_M, KNOT_MPS

_FLAG, _ESCAPE, _ESCAPED_BIT = b"\x7e", b"\x7d", 0x20
_CRC_BYTES = 2
# The longest message, an uplink (1 + 3 + 432 bytes), with its checksum and every byte escaped.
_MAX_FRAME_BYTES = 2 * (436 + _CRC_BYTES)

_HEARTBEAT, _OWNSHIP, _OWNSHIP_ALTITUDE, _TRAFFIC, _FOREFLIGHT = 0x00, 0x0A, 0x0B, 0x14, 0x65
# Bytes of each message that is used, with its identifier; all others are counted only.
_BYTES: Final = {_HEARTBEAT: 7, _OWNSHIP: 28, _OWNSHIP_ALTITUDE: 5, _TRAFFIC: 28}
_FOREFLIGHT_ID_BYTES = 39

# Address types (3.5.1.2). Type 6 is reserved there; receivers of 978 MHz pass the qualifier of DO-282B on.
_ICAO_TYPES = frozenset({0, 2})
_SURFACE_TYPES = frozenset({4, 5})  # surface vehicle, ground station beacon
_SOURCES: Final = {2: TrafficSource.TISB, 3: TrafficSource.TISB, 6: TrafficSource.ADSR}
_PREFIXES: Final = {1: "ANON-", 3: "TISB-", 4: "SURFACE-", 5: "BEACON-", 6: "ADSR-"}

_DEGREES = 180.0 / 2**23
_ALTITUDE_STEP_FT, _ALTITUDE_ZERO_FT, _NO_ALTITUDE = 25, -1000, 0xFFF
_NO_SPEED = 0xFFF
_CLIMB_STEP_MPS = 64.0 * FOOT_M / 60.0
_MAX_CLIMB_STEPS = 510  # 0x1FE, more than 32,576 ft/min; 0x800 means unknown
_TRACK_STEP_RAD = math.tau / 256.0
_TRUE_TRACK, _TRACK_TYPES, _EXTRAPOLATED, _AIRBORNE = 1, 3, 4, 8
_GEOMETRIC_STEP_M = 5.0 * FOOT_M

# An ownship report and the geometric altitude sent with it arrive within this time.
_SAME_MOMENT_S = 0.5
# A target that was measured within this time is not taken from extrapolated reports.
_MEASURED_S, _MAX_MEASURED = 60.0, 1000
# Stratux stands for one transponder without a position by eight targets around us, of these addresses.
_CIRCLE_ADDRESSES, _CIRCLE_CALLSIGNS = range(8), frozenset({"MODES", "MODE S"})


class Gdl90Decoder(Decoder):
    """Decodes a stream or datagrams; several messages in a datagram, or one in several, are both fine."""

    format: ClassVar[str] = "gdl90"
    title: ClassVar[str] = "GDL 90"
    lacks: ClassVar[str] = "age of positions, accuracy of velocity, geometric altitude of traffic, squawk"

    def __init__(self) -> None:
        super().__init__()
        self._rest = b""
        self._found_flag = False
        self._problems: list[str] = []
        self._altitude_is_above_sea = False
        self._ownship: TrafficReport | None = None
        self._measured_s: dict[str, float] = {}

    @property
    def status(self) -> str | None:
        """The problems in the last heartbeat."""
        return ", ".join(self._problems) or None

    def restart(self) -> None:
        """Forget the incomplete frame: the bytes up to the next flag belong to none."""
        self._rest, self._found_flag = b"", False

    def feed(self, data: bytes, received_s: float) -> list[Heard]:
        """The reports in the frames that these bytes complete."""
        heard: list[Heard] = []
        for frame in self._frames(data):
            message = self._message(frame)
            if message is not None:
                self.counters.messages += 1
                heard += self._translate(message, received_s)
        self.counters.reports += len(heard)
        return heard

    def _frames(self, data: bytes) -> Iterator[bytes]:
        """What stands between flags; frames may share a flag, or have one each (2.2.1)."""
        *whole, self._rest = (self._rest + data).split(_FLAG)
        if whole and not self._found_flag:
            self._found_flag = True
            self.counters.bad.update(["truncated"] if whole[0] else [])
            whole = whole[1:]
        for frame in whole:
            if len(frame) > _MAX_FRAME_BYTES:
                self.counters.bad["too long"] += 1
            elif frame:
                yield frame
        if len(self._rest) > _MAX_FRAME_BYTES:
            self.counters.bad["too long"] += 1
            self.restart()

    def _message(self, frame: bytes) -> bytes | None:
        """The message in a frame, without its checksum; `None` if the frame is damaged (2.2.3)."""
        raw = _unescaped(frame)
        reason = None
        if raw is None:
            reason = "wrong escape"
        elif len(raw) <= _CRC_BYTES:
            reason = "truncated"
        elif _checksum(raw[:-_CRC_BYTES]) != int.from_bytes(raw[-_CRC_BYTES:], "little"):
            reason = "wrong checksum"
        elif len(raw) - _CRC_BYTES != _BYTES.get(raw[0], len(raw) - _CRC_BYTES):
            reason = "wrong length"
        if raw is None or reason is not None:
            self.counters.bad[reason or ""] += 1
            return None
        return raw[:-_CRC_BYTES]

    def _translate(self, message: bytes, received_s: float) -> list[Heard]:
        match message[0]:
            case 0x14:
                return self._traffic(message, received_s)
            case 0x0A:
                self._ownship = self._target(message, received_s)
                return [ReceiverOwnship(RECEIVER, self._ownship)]
            case 0x0B:
                return self._ownship_altitude(message, received_s)
            case 0x00:
                self._problems = _problems(message[1])
            case 0x65 if len(message) == _FOREFLIGHT_ID_BYTES and message[1:3] == b"\x00\x01":
                self._altitude_is_above_sea = bool(message[-1] & 1)
            case _:
                pass
        return []

    def _traffic(self, message: bytes, received_s: float) -> list[Heard]:
        report = self._target(message, received_s)
        address = int.from_bytes(message[2:5])
        if address in _CIRCLE_ADDRESSES and report.callsign in _CIRCLE_CALLSIGNS:
            return self._circle(report, address)
        if message[12] & _EXTRAPOLATED and self._is_measured(report):
            self.counters.bad["extrapolated"] += 1
            return []
        if not message[12] & _EXTRAPOLATED:
            self._note_measured(report)
        return [Traffic(RECEIVER, report)]

    def _circle(self, report: TrafficReport, address: int) -> list[Heard]:
        """One report without a position for eight invented ones around us.

        Stratux (the European edition) draws a transponder without a position as a circle whose radius it
        guesses from the signal: https://github.com/stratux/stratux/issues/39 and issues/43.
        """
        if address != _CIRCLE_ADDRESSES[0]:
            self.counters.bad["invented position"] += 1
            return []
        unplaced = TrafficReport(
            source=TrafficSource.MODE_S,
            key="",
            time_s=report.time_s,
            altitude_m=report.altitude_m,
            altitude_reference=AltitudeReference.BAROMETRIC,
            climb_mps=report.climb_mps,
        )
        return [Traffic(RECEIVER, unplaced)]

    def _is_measured(self, report: TrafficReport) -> bool:
        """Whether the target was measured a short time ago, so that the picture extrapolates it by itself.

        An extrapolated report repeats old news as new (Stratux: for 20 s). A receiver that marks every report
        of a target so is still heard.
        """
        return report.time_s - self._measured_s.get(report.key, -math.inf) <= _MEASURED_S

    def _note_measured(self, report: TrafficReport) -> None:
        if report.key:
            self._measured_s.pop(report.key, None)
            self._measured_s[report.key] = report.time_s
            if len(self._measured_s) > _MAX_MEASURED:
                del self._measured_s[next(iter(self._measured_s))]

    def _target(self, message: bytes, received_s: float) -> TrafficReport:
        """A traffic report or an ownship report (3.5.1). The emergency code has no place in our reports.

        The alert bit is the receiver's own opinion: Stratux sets it for everything within 2 nautical miles,
        old versions for all traffic (https://github.com/cyoung/stratux/issues/580).
        """
        address_type = message[1] & 0x0F
        key, icao = _identity(address_type, int.from_bytes(message[2:5]))
        position = _position_deg(message[5:11])
        if position is None and any(message[5:11]):
            self.counters.bad["position outside the globe"] += 1
        altitude_steps = int.from_bytes(message[11:13]) >> 4
        speed_kt = int.from_bytes(message[14:16]) >> 4
        return TrafficReport(
            source=_SOURCES.get(address_type, TrafficSource.ADSB),
            key=key,
            icao=icao,
            time_s=received_s,
            lat_deg=None if position is None else position[0],
            lon_deg=None if position is None else position[1],
            altitude_m=_altitude_m(altitude_steps),
            altitude_reference=AltitudeReference.BAROMETRIC,
            course_rad=_course_rad(message[12], message[17]),
            ground_speed_mps=None if speed_kt == _NO_SPEED else speed_kt * KNOT_MPS,
            climb_mps=_climb_mps(int.from_bytes(message[15:17]) & 0xFFF),
            callsign=printable(message[19:27]),
            kind=_kind(address_type, message[18]),
            airborne=bool(message[12] & _AIRBORNE),
            position_sigma_m=position_sigma_m(message[13] & 0x0F),
            containment_m=containment_m(message[13] >> 4),
            alarm=int(message[1] >> 4 == 1),
        )

    def _ownship_altitude(self, message: bytes, received_s: float) -> list[Heard]:
        """The ownship report once more, with the geometric altitude that was sent after it (3.8).

        Its datum is the ellipsoid unless the receiver says otherwise in message 0x65; Stratux sends heights
        above the sea and says so (https://github.com/cyoung/stratux/pull/749).
        """
        own, altitude_m = self._ownship, int.from_bytes(message[1:3], signed=True) * _GEOMETRIC_STEP_M
        self._ownship = None
        if own is None or not 0.0 <= received_s - own.time_s <= _SAME_MOMENT_S:
            return []
        if not self._altitude_is_above_sea:
            return [ReceiverOwnship(RECEIVER, replace(own, geometric_altitude_m=altitude_m))]
        if own.altitude_m is not None:
            return []
        reference = AltitudeReference.SEA_LEVEL
        return [ReceiverOwnship(RECEIVER, replace(own, altitude_m=altitude_m, altitude_reference=reference))]


def _unescaped(frame: bytes) -> bytes | None:
    """The bytes of a frame after removal of its escapes; `None` if one of them escapes nothing."""
    first, *escaped = frame.split(_ESCAPE)
    if not all(escaped):
        return None
    return first + b"".join(bytes((part[0] ^ _ESCAPED_BIT,)) + part[1:] for part in escaped)


def _checksum(message: bytes) -> int:
    """The remainder of the message itself, without the 16 zero bits that CRC-16 usually appends (2.2.3)."""
    return crc16.xmodem(message[:-2]) ^ int.from_bytes(message[-2:])


def _problems(status: int) -> list[str]:
    """What the first status byte of a heartbeat says is wrong (3.1.1)."""
    problems = [] if status & 0x80 else ["no GPS fix"]
    problems += ["maintenance required"] if status & 0x40 else []
    return problems + (["GPS battery low"] if status & 0x08 else [])


def _identity(address_type: int, address: int) -> tuple[str, int | None]:
    """The key and the ICAO address; neither for address 0, which is none."""
    if address == 0:
        return "", None
    if address_type in _ICAO_TYPES:
        return adsb_key(address), address
    return f"{_PREFIXES.get(address_type, 'GDL90-')}{address:06X}", None


def _kind(address_type: int, emitter: int) -> TrafficKind:
    """The kind by address type and emitter category, whose numbers are those of MAVLink (3.5.1.10)."""
    if address_type in _SURFACE_TYPES:
        return TrafficKind.SURFACE_VEHICLE
    return EMITTER_KINDS.get(emitter, TrafficKind.AIRCRAFT)


def _position_deg(field: bytes) -> tuple[float, float] | None:
    """Latitude and longitude; `None` outside the globe and at 0, 0, which means no position (3.5.1.3)."""
    lat_deg = int.from_bytes(field[:3], signed=True) * _DEGREES
    lon_deg = int.from_bytes(field[3:], signed=True) * _DEGREES
    return (lat_deg, lon_deg) if any(field) and abs(lat_deg) <= 90.0 else None


def _altitude_m(steps: int) -> float | None:
    """A pressure altitude (3.5.1.4)."""
    return None if steps == _NO_ALTITUDE else (steps * _ALTITUDE_STEP_FT + _ALTITUDE_ZERO_FT) * FOOT_M


def _course_rad(indicators: int, track: int) -> float | None:
    """The course; `None` if the field holds a heading, which differs from it by the wind (3.5.1.5)."""
    return track * _TRACK_STEP_RAD if indicators & _TRACK_TYPES == _TRUE_TRACK else None


def _climb_mps(field: int) -> float | None:
    """A vertical speed of 12 bits with sign; `None` for 0x800, unknown, and the unused values (3.5.1.8)."""
    steps = field - 0x1000 if field & 0x800 else field
    return steps * _CLIMB_STEP_MPS if abs(steps) <= _MAX_CLIMB_STEPS else None
