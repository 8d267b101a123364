"""From messages to facts: the one place that knows the wire's units, sentinels, flags and traps.

Whatever a sender marked as invalid, left unset, or could not mean becomes `None`; a message that says nothing
usable becomes no fact at all. No message that can be decoded makes this raise.
"""

import functools
import math
import struct
from collections import namedtuple
from collections.abc import Callable, Sequence
from itertools import islice
from typing import Any

from companion.mavlink import mission_facts
from companion.mavlink.control import CONTROL
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AirData,
    CommandResult,
    Fact,
    Heartbeat,
    LandedState,
    NavigationTarget,
    OwnPosition,
    OwnTransponder,
    Parameter,
    PressureAltitude,
    Sender,
    Traffic,
    Wind,
)
from companion.mavlink.framing import Frame
from companion.mavlink.parameters import parameter_value
from companion.mavlink.text import printable
from companion.model import AltitudeReference, TrafficKind, TrafficReport

_UINT16_MAX = 0xFFFF
_INT16_MAX = 0x7FFF
_INT32_MAX = 0x7FFF_FFFF
_FULL_CIRCLE_CDEG = 36_000
# ADS-B encodes -1,000 to 126,700 ft; what is far outside was never measured.
_LOWEST_TRAFFIC_M = -1_000.0
_HIGHEST_TRAFFIC_M = 40_000.0
_FASTEST_MPS = 200.0
_SEA_LEVEL_HPA = 1_013.25
_LOWEST_PRESSURE_HPA, _HIGHEST_PRESSURE_HPA = 230.0, 1_100.0  # 11 km, and below the Dead Sea

_KINDS = {
    14: TrafficKind.UAV,
    17: TrafficKind.SURFACE_VEHICLE,
    18: TrafficKind.SURFACE_VEHICLE,
    19: TrafficKind.OBSTACLE,
    20: TrafficKind.OBSTACLE,  # cluster obstacle and line obstacle: in DO-260B, not in MAVLink's enumeration
    21: TrafficKind.OBSTACLE,
}


def to_fact(message: Message, received_s: float) -> Fact | None:
    """What a message said; `None` if it is none of `WANTED`, or says nothing that can be used."""
    translate = _TRANSLATIONS.get(message.get_msgId())
    if translate is None:
        return None
    return translate(message, _sender(message.get_srcSystem(), message.get_srcComponent()), received_s)


def frame_to_fact(frame: Frame, received_s: float) -> Fact | None:
    """The same straight from a frame, several times as fast as by way of pymavlink's message."""
    translate = _TRANSLATIONS.get(frame.message_id)
    if translate is None:
        return None
    layout, fields, arrays = _LAYOUTS[frame.message_id]
    payload = frame.payload.ljust(layout.size, b"\0")  # MAVLink 2 cuts off the zeros at the end
    values = layout.unpack_from(payload)
    message = fields._make(_with_arrays(values, arrays) if arrays else values)
    return translate(message, _sender(frame.system_id, frame.component_id), received_s)


def _with_arrays(values: tuple[Any, ...], lengths: Sequence[int]) -> list[Any]:
    """Fields in a row with those of each array put together; `lengths` has 0 for what is no array."""
    left = iter(values)
    return [list(islice(left, length)) if length else next(left) for length in lengths]


@functools.lru_cache(maxsize=256)
def _sender(system_id: int, component_id: int) -> Sender:
    return Sender(system_id, component_id)


def _heartbeat(message: Message, sender: Sender, _received_s: float) -> Fact:
    return Heartbeat(
        sender=sender,
        vehicle_type=message.type,
        autopilot=message.autopilot,
        armed=bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        custom_mode=message.custom_mode,
        system_status=message.system_status,
    )


def _own_position(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`vz` is positive down; without a fix autopilots send 0, 0."""
    place = _place_deg(message.lat, message.lon)
    if place is None:
        return None
    return OwnPosition(
        sender=sender,
        boot_time_s=message.time_boot_ms / 1000.0,
        lat_deg=place[0],
        lon_deg=place[1],
        altitude_m=message.alt / 1000.0,
        height_above_home_m=message.relative_alt / 1000.0,
        velocity_mps=(message.vx / 100.0, message.vy / 100.0, message.vz / 100.0),
        heading_rad=_angle_rad(message.hdg),
    )


def _air_data(message: Message, sender: Sender, _received_s: float) -> Fact:
    airspeed_mps = message.airspeed
    measured = 0.0 <= airspeed_mps <= _FASTEST_MPS  # false for NaN too
    return AirData(sender, airspeed_mps if measured else None)


def _pressure_altitude(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """The standard atmosphere (ICAO Doc 7488) below 11 km: h = T0 / L (1 - (p / p0)^(L R / g))."""
    if not _LOWEST_PRESSURE_HPA <= message.press_abs <= _HIGHEST_PRESSURE_HPA:
        return None
    ratio = message.press_abs / _SEA_LEVEL_HPA
    return PressureAltitude(sender, 44_330.77 * (1.0 - ratio**0.190_263))


def _wind(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`direction` is where the wind comes from, in degrees."""
    if not (math.isfinite(message.direction) and math.isfinite(message.speed)):
        return None
    from_rad = math.radians(message.direction)
    return Wind(sender, -message.speed * math.cos(from_rad), -message.speed * math.sin(from_rad))


def _wind_cov(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`wind_x`, `wind_y` are where the air goes (north, east), NaN when unknown."""
    if not (math.isfinite(message.wind_x) and math.isfinite(message.wind_y)):
        return None
    return Wind(sender, message.wind_x, message.wind_y)


def _landed_state(message: Message, sender: Sender, _received_s: float) -> Fact:
    known = mavlink.MAV_LANDED_STATE_UNDEFINED < message.landed_state < mavlink.MAV_LANDED_STATE_ENUM_END
    return LandedState(sender, message.landed_state if known else None)


def _navigation_target(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """Only the frames GLOBAL and GLOBAL_INT give the altitude above mean sea level."""
    if message.type_mask & (
        mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    ):
        return None
    place = _place_deg(message.lat_int, message.lon_int)
    if place is None:
        return None
    absolute = message.coordinate_frame in (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
    ignored = message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
    given = absolute and not ignored and _LOWEST_TRAFFIC_M <= message.alt <= _HIGHEST_TRAFFIC_M
    return NavigationTarget(sender, place[0], place[1], message.alt if given else None)


def _command_result(message: Message, sender: Sender, _received_s: float) -> Fact:
    """MAVLink 1, and senders who do not fill them in, leave the target fields 0."""
    target = None
    if message.target_system:
        target = Sender(message.target_system, message.target_component)
    return CommandResult(sender, message.command, message.result, target)


def _parameter(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    name = printable(message.param_id)
    value = parameter_value(message.param_value, message.param_type)
    if not name or value is None:
        return None
    return Parameter(sender, name, value)


def _own_transponder(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """An address is 24 bits, and 0 is none."""
    return OwnTransponder(sender, message.ICAO) if 0 < message.ICAO <= 0xFF_FFFF else None


def _traffic(message: Message, sender: Sender, received_s: float) -> Fact:
    """A field counts if its flag is set and it does not hold its "unknown" value.

    `heading` is the course over ground, `ver_velocity` is positive up, `squawk` is four octal digits written
    in decimal. Receivers without a fix set the flag all the same and send 0, 0.
    """
    flags = message.flags
    place = None
    if flags & mavlink.ADSB_FLAGS_VALID_COORDS:
        place = _place_deg(message.lat, message.lon)
    geometric = message.altitude_type == mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC
    report = TrafficReport(
        icao=message.ICAO_address,
        time_s=received_s - message.tslc,
        lat_deg=None if place is None else place[0],
        lon_deg=None if place is None else place[1],
        altitude_m=_traffic_altitude_m(message) if flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE else None,
        altitude_reference=AltitudeReference.GEOMETRIC if geometric else AltitudeReference.BAROMETRIC,
        course_rad=_angle_rad(message.heading) if flags & mavlink.ADSB_FLAGS_VALID_HEADING else None,
        ground_speed_mps=(
            _unless(_UINT16_MAX, message.hor_velocity) if flags & mavlink.ADSB_FLAGS_VALID_VELOCITY else None
        ),
        climb_mps=(
            _unless(_INT16_MAX, message.ver_velocity)
            if flags & mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
            else None
        ),
        callsign=printable(message.callsign) if flags & mavlink.ADSB_FLAGS_VALID_CALLSIGN else None,
        squawk=_squawk(message.squawk) if flags & mavlink.ADSB_FLAGS_VALID_SQUAWK else None,
        kind=_KINDS.get(message.emitter_type, TrafficKind.AIRCRAFT),
        simulated=bool(flags & mavlink.ADSB_FLAGS_SIMULATED),
    )
    return Traffic(sender, report)


def _traffic_altitude_m(message: Message) -> float | None:
    altitude_m: float = message.altitude / 1000.0
    return altitude_m if _LOWEST_TRAFFIC_M <= altitude_m <= _HIGHEST_TRAFFIC_M else None


def _place_deg(lat_e7: int, lon_e7: int) -> tuple[float, float] | None:
    """Latitude and longitude [deg]; `None` outside the globe, INT32_MAX included, and at 0, 0."""
    lat_deg, lon_deg = lat_e7 / 1e7, lon_e7 / 1e7
    if abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0 or (lat_e7 == 0 and lon_e7 == 0):
        return None
    return lat_deg, lon_deg


def _angle_rad(angle_cdeg: int) -> float | None:
    """Centidegrees in [0, 36000) as radians; anything else is unknown, UINT16_MAX included."""
    return math.radians(angle_cdeg / 100.0) if angle_cdeg < _FULL_CIRCLE_CDEG else None


def _unless(unknown: int, speed_cmps: int) -> float | None:
    """A speed [m/s], unless it is the value that stands for unknown."""
    return None if speed_cmps == unknown else speed_cmps / 100.0


def _squawk(code: int) -> int | None:
    """A transponder code has four digits of 0 to 7; anything else was garbled on its way."""
    digits = f"{code:04d}"
    return code if len(digits) == 4 and max(digits) <= "7" else None


_TRANSLATIONS: dict[int, Callable[[Message, Sender, float], Fact | None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _own_position,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _air_data,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: _pressure_altitude,
    mavlink.MAVLINK_MSG_ID_WIND: _wind,
    mavlink.MAVLINK_MSG_ID_WIND_COV: _wind_cov,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _landed_state,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: _navigation_target,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK: _command_result,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: _parameter,
    mavlink.MAVLINK_MSG_ID_UAVIONIX_ADSB_OUT_CFG: _own_transponder,
    mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: _traffic,
    **CONTROL,
    **mission_facts.TRANSLATIONS,
}


def _layout(kind: Any) -> tuple[struct.Struct, Any, tuple[int, ...]]:
    """How a message's payload unpacks, its fields, and lengths of its arrays (none: empty)."""
    texts = {name for name, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True) if type_ == "char"}
    lengths = zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    arrays = tuple(0 if name in texts else length for name, length in lengths)
    return kind.unpacker, namedtuple(kind.msgname, kind.ordered_fieldnames), arrays if any(arrays) else ()


_LAYOUTS = {wanted: _layout(mavlink.mavlink_map[wanted]) for wanted in _TRANSLATIONS} | mission_facts.LAYOUTS

WANTED: frozenset[int] = frozenset(_TRANSLATIONS)
"""Ids of the messages worth decoding."""
