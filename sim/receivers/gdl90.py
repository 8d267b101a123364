"""A simulated GDL 90 receiver: heartbeat, ownship, its geometric altitude, and a report for each aircraft.

Sources: "GDL 90 Data Interface Specification", Garmin 560-1058-00 Rev A; for message 0x65 the extended one of
ForeFlight.
"""

import math
from typing import ClassVar

from companion.geodesy import course_deg
from companion.units import FOOT_M, KNOT_MPS
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission

_FLAG, _ESCAPE, _ESCAPED_BIT = 0x7E, 0x7D, 0x20
_POLYNOMIAL = 0x11021
_GPS_VALID, _INITIALIZED, _UTC_VALID = 0x80, 0x01, 0x01
_SECONDS_A_DAY = 86_400
_STEPS_A_DEGREE = 2**23 / 180.0
_UNKNOWN_ALTITUDE, _MAX_SPEED_KT, _MAX_CLIMB_STEPS = 0xFFF, 0xFFE, 510
_TRUE_TRACK, _AIRBORNE = 0x1, 0x8
_VERTICAL_FIGURE_M = 10


class Gdl90Encoder(ReceiverEncoder):
    """Each message is a datagram of its own; the device names itself once a second with its heartbeat."""

    format: ClassVar[str] = "gdl90"

    def __init__(self) -> None:
        self._second: int | None = None

    def encode(self, reception: Reception) -> list[bytes]:
        """The frames of this moment."""
        messages: list[bytes] = []
        if int(reception.time_s) != self._second:
            self._second = int(reception.time_s)
            messages += [_heartbeat(reception), _device()]
        if reception.own is not None:
            messages += [_target(0x0A, reception.own), _geometric_altitude(reception.own)]
        messages += [_target(0x14, one) for one in reception.heard]
        return [framed(message) for message in messages]


def framed(message: bytes) -> bytes:
    """A message with its checksum, escaped, between two flags."""
    frame = bytearray((_FLAG,))
    for byte in message + _remainder(message).to_bytes(2, "little"):
        frame += bytes((_ESCAPE, byte ^ _ESCAPED_BIT)) if byte in (_FLAG, _ESCAPE) else bytes((byte,))
    return bytes(frame) + bytes((_FLAG,))


def _remainder(message: bytes) -> int:
    """The message as a polynomial, divided by that of CRC-16-CCITT; no zero bits are appended."""
    remainder = 0
    for byte in message:
        for bit in range(7, -1, -1):
            remainder = remainder << 1 | byte >> bit & 1
            remainder ^= _POLYNOMIAL if remainder & 0x10000 else 0
    return remainder


def _heartbeat(reception: Reception) -> bytes:
    second = int(reception.time_s) % _SECONDS_A_DAY
    status = _INITIALIZED | (0 if reception.own is None else _GPS_VALID)
    heard = min(len(reception.heard), 1023)
    counts = bytes((heard >> 8, heard & 0xFF))
    start = bytes((0x00, status, second >> 16 << 7 | _UTC_VALID))
    return start + (second & 0xFFFF).to_bytes(2, "little") + counts


def _device() -> bytes:
    """ForeFlight's identification, with the ellipsoid as datum of the geometric altitude."""
    return b"\x65\x00\x01" + b"\xff" * 8 + b"Sim     " + b"Simulator       " + bytes(4)


def _target(message_id: int, one: Transmission) -> bytes:
    """A traffic or ownship report of an aircraft with an ICAO address."""
    indicators = _TRUE_TRACK | (0 if one.on_ground else _AIRBORNE)
    north_mps, east_mps, down_mps = one.velocity_mps
    speed_kt = min(round(math.hypot(north_mps, east_mps) / KNOT_MPS), _MAX_SPEED_KT)
    climb = round(-down_mps / FOOT_M * 60.0 / 64.0)
    climb = max(min(climb, _MAX_CLIMB_STEPS), -_MAX_CLIMB_STEPS) & 0xFFF
    track = round(course_deg(math.atan2(east_mps, north_mps)) * 256.0 / 360.0) % 256
    return b"".join(
        (
            bytes((message_id, 0x00)),
            one.icao.to_bytes(3),
            _angle(one.place.lat_deg),
            _angle(one.place.lon_deg),
            (_altitude(one.pressure_altitude_m) << 4 | indicators).to_bytes(2),
            bytes((one.nic << 4 | one.nacp,)),
            (speed_kt << 12 | climb).to_bytes(3),
            bytes((track, one.category)),
            one.callsign.encode("ascii", errors="replace")[:8].ljust(8),
            b"\x00",
        )
    )


def _angle(angle_deg: float) -> bytes:
    return (round(angle_deg * _STEPS_A_DEGREE) % 2**24).to_bytes(3)


def _altitude(metres: float) -> int:
    steps = round((metres / FOOT_M + 1000.0) / 25.0)
    return steps if 0 <= steps < _UNKNOWN_ALTITUDE else _UNKNOWN_ALTITUDE


def _geometric_altitude(own: Transmission) -> bytes:
    steps = max(min(round(own.place.altitude_m / (5.0 * FOOT_M)), 0x7FFF), -0x8000)
    return b"\x0b" + steps.to_bytes(2, signed=True) + _VERTICAL_FIGURE_M.to_bytes(2)
