"""Traffic from an ADS-B receiver (ADSB_VEHICLE), and our own transponder (UAVIONIX_ADSB_OUT_CFG)."""

import math

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, OwnTransponder, Sender, Traffic
from companion.mavlink.translate.wire import (
    FULL_CIRCLE_CDEG,
    INT16_MAX,
    UINT16_MAX,
    Translation,
    altitude_m,
    angle_rad,
    position_deg,
    printable,
    speed_mps,
)
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource, adsb_key

EMITTER_KINDS = {
    14: TrafficKind.UAV,
    17: TrafficKind.SURFACE_VEHICLE,
    18: TrafficKind.SURFACE_VEHICLE,
    19: TrafficKind.OBSTACLE,
    20: TrafficKind.OBSTACLE,  # cluster obstacle and line obstacle: in DO-260B, not in MAVLink's enumeration
    21: TrafficKind.OBSTACLE,
}
"""The kinds by emitter category; any other category is an aircraft."""

_EMITTERS = {TrafficKind.UAV: 14, TrafficKind.SURFACE_VEHICLE: 18, TrafficKind.OBSTACLE: 19}
_UNKNOWN_AGE_S = 255
_CALLSIGN_BYTES = 8


def _own_transponder(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """An address has 24 bits; 0 means none."""
    return OwnTransponder(sender, message.ICAO) if 0 < message.ICAO <= 0xFF_FFFF else None


def _traffic(message: Message, sender: Sender, received_s: float) -> Fact:
    """A field is used if its flag is set and it does not have its "unknown" value.

    `heading` is the course over ground, `ver_velocity` is positive up, `squawk` is four octal digits written
    in decimal. Receivers without a fix send 0, 0 with the flag set. Geometric altitudes are above the
    ellipsoid, as in DO-260B.
    """
    flags = message.flags
    position = None
    if flags & mavlink.ADSB_FLAGS_VALID_COORDS:
        position = position_deg(message.lat, message.lon)
    geometric = message.altitude_type == mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC
    report = TrafficReport(
        source=TrafficSource.ADSB,
        key=adsb_key(message.ICAO_address),
        icao=message.ICAO_address,
        # The largest age means an unknown one: what changes is new.
        time_s=received_s - (0 if message.tslc == _UNKNOWN_AGE_S else message.tslc),
        lat_deg=None if position is None else position[0],
        lon_deg=None if position is None else position[1],
        altitude_m=altitude_m(message.altitude) if flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE else None,
        altitude_reference=AltitudeReference.GEOMETRIC if geometric else AltitudeReference.BAROMETRIC,
        course_rad=angle_rad(message.heading) if flags & mavlink.ADSB_FLAGS_VALID_HEADING else None,
        ground_speed_mps=(
            speed_mps(message.hor_velocity, UINT16_MAX) if flags & mavlink.ADSB_FLAGS_VALID_VELOCITY else None
        ),
        climb_mps=(
            speed_mps(message.ver_velocity, INT16_MAX)
            if flags & mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
            else None
        ),
        callsign=printable(message.callsign) if flags & mavlink.ADSB_FLAGS_VALID_CALLSIGN else None,
        squawk=_squawk(message.squawk) if flags & mavlink.ADSB_FLAGS_VALID_SQUAWK else None,
        kind=EMITTER_KINDS.get(message.emitter_type, TrafficKind.AIRCRAFT),
        simulated=bool(flags & mavlink.ADSB_FLAGS_SIMULATED),
        age_step_s=1.0,  # `tslc` counts whole seconds
    )
    return Traffic(sender, report)


def vehicle_message(report: TrafficReport, age_s: float) -> Message:
    """ADSB_VEHICLE for a report with an address, a position and an altitude, `age_s` old.

    The altitude has to be above mean sea level, as the definition of the field says. ArduPilot
    (`AP_ADSB::get_location`) and PX4 (`AdsbConflict`) compare it with their own, whatever `altitude_type` is;
    this says what it was measured with. Unknown values are 0 and have no flag: readers that ignore the flags
    take the usual "invalid" values for 655 m/s.
    """
    lat_deg, lon_deg, height_m = report.lat_deg, report.lon_deg, report.altitude_m
    if report.icao is None or lat_deg is None or lon_deg is None or height_m is None:
        raise ValueError("a report without address, position or altitude cannot be sent")
    barometric = report.altitude_reference is AltitudeReference.BAROMETRIC
    course_rad, ground_mps, climb_mps = report.course_rad, report.ground_speed_mps, report.climb_mps
    callsign = (report.callsign or "").encode("ascii", errors="ignore")[:_CALLSIGN_BYTES]
    known = {
        mavlink.ADSB_FLAGS_VALID_COORDS: True,
        mavlink.ADSB_FLAGS_VALID_ALTITUDE: True,
        mavlink.ADSB_FLAGS_BARO_VALID: barometric,
        mavlink.ADSB_FLAGS_VALID_HEADING: course_rad is not None,
        mavlink.ADSB_FLAGS_VALID_VELOCITY: ground_mps is not None,
        mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID: climb_mps is not None,
        mavlink.ADSB_FLAGS_VALID_CALLSIGN: bool(callsign),
        mavlink.ADSB_FLAGS_VALID_SQUAWK: report.squawk is not None,
        mavlink.ADSB_FLAGS_SIMULATED: report.simulated,
    }
    return mavlink.MAVLink_adsb_vehicle_message(
        ICAO_address=report.icao,
        lat=round(lat_deg * 1e7),
        lon=round(lon_deg * 1e7),
        altitude_type=(
            mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH if barometric else mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC
        ),
        altitude=round(height_m * 1000.0),
        heading=round(math.degrees(course_rad or 0.0) * 100.0) % FULL_CIRCLE_CDEG,
        hor_velocity=min(round((ground_mps or 0.0) * 100.0), UINT16_MAX - 1),
        ver_velocity=max(min(round((climb_mps or 0.0) * 100.0), INT16_MAX - 1), -INT16_MAX),
        callsign=callsign,
        emitter_type=_EMITTERS.get(report.kind, 0),
        tslc=min(int(age_s), _UNKNOWN_AGE_S - 1),
        flags=sum(flag for flag, is_known in known.items() if is_known),
        squawk=report.squawk or 0,
    )


def _squawk(code: int) -> int | None:
    """A transponder code of four digits from 0 to 7; `None` for any other value."""
    digits = f"{code:04d}"
    return code if len(digits) == 4 and max(digits) <= "7" else None


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: _traffic,
    mavlink.MAVLINK_MSG_ID_UAVIONIX_ADSB_OUT_CFG: _own_transponder,
}
