"""A simulated receiver that speaks MAVLink: an ADS-B receiver on the aircraft, and a Remote ID receiver."""

import math
from typing import ClassVar

from companion.geodesy import GeoPoint, course_deg
from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.model import Vec3
from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission

ADSB_RECEIVER = (1, 156)  # the MAVLink address of a receiver on the aircraft: MAV_COMP_ID_ADSB
REMOTE_ID_RECEIVER = (1, 236)  # MAV_COMP_ID_ODID_TXRX_1

# Flags of a good receiver; the recorded autopilot forwarded 287, the same without vertical velocity.
ALL_VALID = (
    mavlink.ADSB_FLAGS_VALID_COORDS
    | mavlink.ADSB_FLAGS_VALID_ALTITUDE
    | mavlink.ADSB_FLAGS_VALID_HEADING
    | mavlink.ADSB_FLAGS_VALID_VELOCITY
    | mavlink.ADSB_FLAGS_VALID_CALLSIGN
    | mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
    | mavlink.ADSB_FLAGS_BARO_VALID
)
_SQUAWK_VFR = 1200
_CALLSIGN_BYTES = 8
_INT16_MAX, _UINT16_MAX = 32_767, 65_535
_NAME_BYTES = 20
_MAX_SPEED_CMPS, _MAX_CLIMB_CMPS = 25_425, 6_200
_SECONDS_AN_HOUR = 3600.0
_UNKNOWN_HEIGHT_M = -1000.0


def adsb_vehicle(
    icao: int,
    callsign: str,
    place: GeoPoint,
    velocity_mps: Vec3,
    *,
    category: int = 1,
    barometric: bool = False,
    age_s: float = 0.0,
    flags: int = ALL_VALID,
) -> Message:
    """ADSB_VEHICLE of the receiver on the aircraft; the altitude of `place` is barometric or geometric."""
    north_mps, east_mps, down_mps = velocity_mps
    message = mavlink.MAVLink_adsb_vehicle_message(
        ICAO_address=icao,
        lat=round(place.lat_deg * 1e7),
        lon=round(place.lon_deg * 1e7),
        altitude_type=0 if barometric else 1,
        altitude=round(place.altitude_m * 1000.0),
        heading=_course_cdeg(velocity_mps),
        hor_velocity=min(round(math.hypot(north_mps, east_mps) * 100.0), _UINT16_MAX),
        ver_velocity=max(min(round(-down_mps * 100.0), _INT16_MAX), -_INT16_MAX),
        callsign=callsign.encode("ascii", errors="replace")[:_CALLSIGN_BYTES],
        emitter_type=category,
        tslc=min(int(age_s), 255),
        flags=flags,
        squawk=_SQUAWK_VFR,
    )
    header = message.get_header()
    header.srcSystem, header.srcComponent = ADSB_RECEIVER
    return message


class MavlinkEncoder(ReceiverEncoder):
    """Sends ADSB_VEHICLE with pressure altitudes, one frame in a datagram."""

    format: ClassVar[str] = "mavlink"

    def __init__(self) -> None:
        self._encoder = Encoder()

    def encode(self, reception: Reception) -> list[bytes]:
        """The frames of this moment."""
        return [self._encoder.encode(_report(one), *ADSB_RECEIVER) for one in reception.heard]


class RemoteIdEncoder(ReceiverEncoder):
    """Sends OPEN_DRONE_ID_BASIC_ID and OPEN_DRONE_ID_LOCATION, one frame in a datagram."""

    format: ClassVar[str] = "remoteid"

    def __init__(self) -> None:
        self._encoder = Encoder()

    def encode(self, reception: Reception) -> list[bytes]:
        """The frames of this moment."""
        messages = [m for one in reception.heard for m in (_basic_id(one), _location(one, reception.time_s))]
        return [self._encoder.encode(message, *REMOTE_ID_RECEIVER) for message in messages]


def _report(one: Transmission) -> Message:
    place = GeoPoint(one.place.lat_deg, one.place.lon_deg, one.pressure_altitude_m)
    return adsb_vehicle(
        one.icao,
        one.callsign,
        place,
        one.velocity_mps,
        category=one.category,
        barometric=True,
        age_s=one.age_s,
    )


def _basic_id(one: Transmission) -> Message:
    return mavlink.MAVLink_open_drone_id_basic_id_message(
        target_system=0,
        target_component=0,
        id_or_mac=_address(one),
        id_type=mavlink.MAV_ODID_ID_TYPE_SERIAL_NUMBER,
        ua_type=mavlink.MAV_ODID_UA_TYPE_AEROPLANE,
        uas_id=_padded(one.callsign),
    )


def _location(one: Transmission, time_s: float) -> Message:
    north_mps, east_mps, down_mps = one.velocity_mps
    return mavlink.MAVLink_open_drone_id_location_message(
        target_system=0,
        target_component=0,
        id_or_mac=_address(one),
        status=mavlink.MAV_ODID_STATUS_GROUND if one.on_ground else mavlink.MAV_ODID_STATUS_AIRBORNE,
        direction=_course_cdeg(one.velocity_mps),
        speed_horizontal=min(round(math.hypot(north_mps, east_mps) * 100.0), _MAX_SPEED_CMPS),
        speed_vertical=max(min(round(-down_mps * 100.0), _MAX_CLIMB_CMPS), -_MAX_CLIMB_CMPS),
        latitude=round(one.place.lat_deg * 1e7),
        longitude=round(one.place.lon_deg * 1e7),
        altitude_barometric=one.pressure_altitude_m,
        altitude_geodetic=one.place.altitude_m,
        height_reference=mavlink.MAV_ODID_HEIGHT_REF_OVER_TAKEOFF,
        height=_UNKNOWN_HEIGHT_M,
        horizontal_accuracy=mavlink.MAV_ODID_HOR_ACC_10_METER,
        vertical_accuracy=mavlink.MAV_ODID_VER_ACC_10_METER,
        barometer_accuracy=mavlink.MAV_ODID_VER_ACC_10_METER,
        speed_accuracy=mavlink.MAV_ODID_SPEED_ACC_1_METERS_PER_SECOND,
        timestamp=(time_s - one.age_s) % _SECONDS_AN_HOUR,
        timestamp_accuracy=mavlink.MAV_ODID_TIME_ACC_0_1_SECOND,
    )


def _course_cdeg(velocity_mps: Vec3) -> int:
    return round(course_deg(math.atan2(velocity_mps[1], velocity_mps[0])) * 100.0) % 36_000


def _address(one: Transmission) -> list[int]:
    """The address of its radio, made from its ICAO address."""
    return _padded(f"02D0D0{one.icao:06X}")


def _padded(text: str) -> list[int]:
    return list(text.encode("ascii", errors="replace")[:_NAME_BYTES].ljust(_NAME_BYTES, b"\0"))
