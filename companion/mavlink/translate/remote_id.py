"""Remote ID of unmanned aircraft: OPEN_DRONE_ID_LOCATION, _BASIC_ID, and _MESSAGE_PACK with both in one.

Sources: common.xml of MAVLink (unknown values, accuracies); "Open Drone ID" in the MAVLink developer guide
(routing); ASTM F3411-22a, section 5.4.5 (messages within a pack, accuracies as 95 % bounds).
"""

from collections import namedtuple
from dataclasses import replace
from struct import Struct
from typing import Final, NamedTuple

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, ReceiverOwnship, Sender, Traffic
from companion.mavlink.translate.wire import Translation, angle_rad, is_altitude, position_deg, printable
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource

# Components that transmit our Remote ID and receive that of others.
_RECEIVERS = range(mavlink.MAV_COMP_ID_ODID_TXRX_1, mavlink.MAV_COMP_ID_ODID_TXRX_3 + 1)

_UNKNOWN_ALTITUDE_M = -1000.0
_MAX_SPEED_CMPS, _MAX_CLIMB_CMPS = 25_425, 6_200  # 25,500 and 6,300 mean unknown

# 95 % bounds by enumeration. Inside a circle of 2.448 sigma lie 95 %, on an axis within 1.960 sigma.
_RADIAL_95, _AXIS_95 = 2.448, 1.960
_HORIZONTAL_M: Final = dict(
    enumerate((18_520.0, 7_408.0, 3_704.0, 1_852.0, 926.0, 555.6, 185.2, 92.6, 30.0, 10.0, 3.0, 1.0), start=1)
)
_VERTICAL_M: Final = dict(enumerate((150.0, 45.0, 25.0, 10.0, 3.0, 1.0), start=1))
_SPEED_MPS: Final = dict(enumerate((10.0, 3.0, 1.0, 0.3), start=1))

# A message within a pack: its type in the upper half of the first byte, and 24 bytes of content.
_PACKED_BYTES, _MAX_PACKED = 25, 9
_PACKED_BASIC_ID, _PACKED_LOCATION = 0, 1
_PACKED_LOCATION_LAYOUT = Struct("<xBBBbiiHHHBBHBx")
_SLOW_CMPS, _FAST_CMPS = 25, 75
_WEST_CDEG, _SPEED_CODES = 18_000, 255

# The fields of OPEN_DRONE_ID_LOCATION that are used, in its units.
_Location = namedtuple(
    "_Location",
    "status direction speed_horizontal speed_vertical latitude longitude altitude_barometric"
    " altitude_geodetic horizontal_accuracy vertical_accuracy barometer_accuracy speed_accuracy",
)


class _BasicId(NamedTuple):
    id_type: int
    ua_type: int
    uas_id: bytes


def _location(message: Message, sender: Sender, received_s: float) -> Fact:
    """The position of another aircraft, or of the sender itself."""
    return _fact(_report(message, _key(message, sender), received_s), message, sender)


def _basic_id(message: Message, sender: Sender, received_s: float) -> Fact | None:
    """Name and kind of another aircraft; `None` for those of the sender itself, which say nothing of it."""
    if not _is_of_other(message):
        return None
    report = TrafficReport(TrafficSource.REMOTE_ID, _key(message, sender), received_s, kind=TrafficKind.UAV)
    identity = _BasicId(message.id_type, message.ua_type, bytes(message.uas_id))
    return Traffic(sender, _identified(report, identity))


def _message_pack(message: Message, sender: Sender, received_s: float) -> Fact | None:
    """Position, name and kind of an aircraft; `None` if the pack has no position."""
    location: _Location | None = None
    identity: _BasicId | None = None
    if message.single_message_size != _PACKED_BYTES:
        return None
    packed = bytes(message.messages)
    for start in range(0, min(message.msg_pack_size, _MAX_PACKED) * _PACKED_BYTES, _PACKED_BYTES):
        one = packed[start : start + _PACKED_BYTES]
        if one[0] >> 4 == _PACKED_LOCATION:
            location = _unpacked_location(one)
        elif one[0] >> 4 == _PACKED_BASIC_ID and identity is None:
            identity = _BasicId(one[1] >> 4, one[1] & 0x0F, one[2:22])
    if location is None:
        return None
    report = _report(location, _key(message, sender, identity), received_s)
    return _fact(report if identity is None else _identified(report, identity), message, sender)


def _fact(report: TrafficReport, message: Message, sender: Sender) -> Fact:
    """Traffic, unless the sender speaks of itself.

    Receivers fill `id_or_mac`, or send as one of three components of their own. Our autopilot sends its own
    position to our transmitter with an empty field (AP_OpenDroneID of ArduPilot, the streams of PX4).
    """
    if _is_of_other(message) or sender.component_id in _RECEIVERS:
        return Traffic(sender, report)
    return ReceiverOwnship(sender, report)


def _is_of_other(message: Message) -> bool:
    return any(bytes(message.id_or_mac))


def _key(message: Message, sender: Sender, identity: _BasicId | None = None) -> str:
    """The key of the aircraft: by `id_or_mac`, otherwise by its own name, or the address of the sender."""
    if _is_of_other(message):
        return f"RID-{_text(bytes(message.id_or_mac))}"
    if identity is not None and any(identity.uas_id):
        return f"RID-{_text(identity.uas_id)}"
    return f"RID-{sender.system_id}.{sender.component_id}"


def _text(name: bytes) -> str:
    """A serial number or an address as sent in ASCII; any other bytes in hexadecimal."""
    name = name.rstrip(b"\0")
    return name.decode("ascii") if all(0x21 <= letter <= 0x7E for letter in name) else name.hex().upper()


def _report(message: Message | _Location, key: str, received_s: float) -> TrafficReport:
    """The fields that are not marked as unknown.

    The time stamp counts from the full hour of UTC, and our clock need not be UTC: the time of reception is
    used, at most a second after the measurement (ASTM F3411 allows no older data). PX4 (seen up to 1.18)
    sends its altitude above the sea as the geodetic one, a reason to prefer the barometric one.
    """
    position = position_deg(message.latitude, message.longitude)
    pressure_m, ellipsoid_m = _altitude_m(message.altitude_barometric), _altitude_m(message.altitude_geodetic)
    vertical = message.vertical_accuracy if pressure_m is None else message.barometer_accuracy
    return TrafficReport(
        source=TrafficSource.REMOTE_ID,
        key=key,
        time_s=received_s,
        lat_deg=None if position is None else position[0],
        lon_deg=None if position is None else position[1],
        altitude_m=ellipsoid_m if pressure_m is None else pressure_m,
        altitude_reference=(
            AltitudeReference.GEOMETRIC if pressure_m is None else AltitudeReference.BAROMETRIC
        ),
        course_rad=angle_rad(message.direction),
        ground_speed_mps=_speed_mps(message.speed_horizontal, _MAX_SPEED_CMPS),
        climb_mps=_speed_mps(message.speed_vertical, _MAX_CLIMB_CMPS),
        kind=TrafficKind.UAV,
        airborne=message.status != mavlink.MAV_ODID_STATUS_GROUND,
        position_sigma_m=_sigma(_HORIZONTAL_M.get(message.horizontal_accuracy), _RADIAL_95),
        altitude_sigma_m=_sigma(_VERTICAL_M.get(vertical), _AXIS_95),
        velocity_sigma_mps=_sigma(_SPEED_MPS.get(message.speed_accuracy), _RADIAL_95),
        geometric_altitude_m=None if pressure_m is None else ellipsoid_m,
    )


def _identified(report: TrafficReport, identity: _BasicId) -> TrafficReport:
    """The report with name and kind. Only serial numbers and registrations can be read by people."""
    is_obstacle = identity.ua_type == mavlink.MAV_ODID_UA_TYPE_GROUND_OBSTACLE
    readable = (mavlink.MAV_ODID_ID_TYPE_SERIAL_NUMBER, mavlink.MAV_ODID_ID_TYPE_CAA_REGISTRATION_ID)
    return replace(
        report,
        kind=TrafficKind.OBSTACLE if is_obstacle else TrafficKind.UAV,
        callsign=printable(identity.uas_id) if identity.id_type in readable else None,
    )


def _altitude_m(metres: float) -> float | None:
    return metres if is_altitude(metres) and metres > _UNKNOWN_ALTITUDE_M else None


def _speed_mps(speed_cmps: int, most_cmps: int) -> float | None:
    return speed_cmps / 100.0 if abs(speed_cmps) <= most_cmps else None


def _sigma(bound: float | None, factor: float) -> float | None:
    """The standard deviation to a 95 % bound."""
    return None if bound is None else bound / factor


def _unpacked_location(packed: bytes) -> _Location:
    """The fields of a location message in the form that is transmitted, in the units of MAVLink."""
    flags, direction, speed, climb, lat_e7, lon_e7, pressure, ellipsoid, _, heights, speeds, _, _ = (
        _PACKED_LOCATION_LAYOUT.unpack(packed)
    )
    slow_cmps = _SLOW_CMPS * speed
    is_fast, is_west = flags & 0x01, flags & 0x02
    return _Location(
        status=flags >> 4,
        direction=direction * 100 + (_WEST_CDEG if is_west else 0),
        speed_horizontal=_SPEED_CODES * _SLOW_CMPS + _FAST_CMPS * speed if is_fast else slow_cmps,
        speed_vertical=climb * 50,
        latitude=lat_e7,
        longitude=lon_e7,
        altitude_barometric=pressure / 2.0 + _UNKNOWN_ALTITUDE_M,
        altitude_geodetic=ellipsoid / 2.0 + _UNKNOWN_ALTITUDE_M,
        horizontal_accuracy=heights & 0x0F,
        vertical_accuracy=heights >> 4,
        barometer_accuracy=speeds >> 4,
        speed_accuracy=speeds & 0x0F,
    )


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION: _location,
    mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_BASIC_ID: _basic_id,
    mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK: _message_pack,
}
