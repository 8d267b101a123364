"""Traffic from an ADS-B receiver (ADSB_VEHICLE), and our own transponder (UAVIONIX_ADSB_OUT_CFG)."""

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, OwnTransponder, Sender, Traffic
from companion.mavlink.translate.wire import (
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

_UNKNOWN_AGE_S = 255


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
    )
    return Traffic(sender, report)


def _squawk(code: int) -> int | None:
    """A transponder code of four digits from 0 to 7; `None` for any other value."""
    digits = f"{code:04d}"
    return code if len(digits) == 4 and max(digits) <= "7" else None


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE: _traffic,
    mavlink.MAVLINK_MSG_ID_UAVIONIX_ADSB_OUT_CFG: _own_transponder,
}
