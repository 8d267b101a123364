"""Traffic from unmanned traffic management: UTM_GLOBAL_POSITION."""

import math

from companion.geodesy import wrap_two_pi
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, Sender, Traffic
from companion.mavlink.translate.wire import UINT16_MAX, Translation, altitude_m, position_deg
from companion.model import AltitudeReference, TrafficKind, TrafficReport, TrafficSource

_SHOWN_DIGITS = 6


def _traffic(message: Message, sender: Sender, received_s: float) -> Fact:
    """A field is used if its flag is set; `alt` is above the ellipsoid, velocities are north-east-down.

    `relative_alt` is above a ground level that is not sent, so it is not used. `time` is the sender's
    clock, whose offset from ours is unknown: the time of reception is used.
    """
    flags = message.flags
    position = None
    if flags & mavlink.UTM_DATA_AVAIL_FLAGS_POSITION_AVAILABLE:
        position = position_deg(message.lat, message.lon)
    speed_mps = course_rad = climb_mps = None
    if flags & mavlink.UTM_DATA_AVAIL_FLAGS_HORIZONTAL_VELO_AVAILABLE:
        speed_mps = math.hypot(message.vx, message.vy) / 100.0
        course_rad = wrap_two_pi(math.atan2(message.vy, message.vx))
    if flags & mavlink.UTM_DATA_AVAIL_FLAGS_VERTICAL_VELO_AVAILABLE:
        climb_mps = -message.vz / 100.0
    known_altitude = flags & mavlink.UTM_DATA_AVAIL_FLAGS_ALTITUDE_AVAILABLE
    name = _name(message, sender)
    report = TrafficReport(
        source=TrafficSource.UTM,
        key=f"UTM-{name}",
        time_s=received_s,
        lat_deg=None if position is None else position[0],
        lon_deg=None if position is None else position[1],
        altitude_m=altitude_m(message.alt) if known_altitude else None,
        altitude_reference=AltitudeReference.GEOMETRIC,
        course_rad=course_rad,
        ground_speed_mps=speed_mps,
        climb_mps=climb_mps,
        callsign=f"UTM {name[-_SHOWN_DIGITS:]}",
        kind=TrafficKind.UAV,
        airborne=message.flight_state != mavlink.UTM_FLIGHT_STATE_GROUND,
        position_sigma_m=_sigma_m(message.h_acc),
        altitude_sigma_m=_sigma_m(message.v_acc),
    )
    return Traffic(sender, report)


def _name(message: Message, sender: Sender) -> str:
    """The id of the aircraft in hexadecimal without trailing zeros, otherwise the address of the sender."""
    if message.flags & mavlink.UTM_DATA_AVAIL_FLAGS_UAS_ID_AVAILABLE:
        uas_id = bytes(message.uas_id).rstrip(b"\0")
        if uas_id:
            return uas_id.hex().upper()
    return f"{sender.system_id}.{sender.component_id}"


def _sigma_m(accuracy_mm: int) -> float | None:
    """A standard deviation [m]; `None` for 0 and UINT16_MAX, which mean unknown."""
    return None if accuracy_mm in (0, UINT16_MAX) else accuracy_mm / 1000.0


TRANSLATIONS: dict[int, Translation] = {mavlink.MAVLINK_MSG_ID_UTM_GLOBAL_POSITION: _traffic}
