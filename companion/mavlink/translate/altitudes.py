"""What our heights are measured against: SCALED_PRESSURE, GPS_RAW_INT."""

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import Fact, GeoidSeparation, PressureAltitude, Sender
from companion.mavlink.translate.wire import Translation

_SEA_LEVEL_HPA = 1_013.25
_LOWEST_PRESSURE_HPA, _HIGHEST_PRESSURE_HPA = 230.0, 1_100.0  # 11 km, and below the Dead Sea
# The geoid lies 106 m below the ellipsoid south of India and 85 m above it in New Guinea (EGM96).
_LARGEST_SEPARATION_M = 120.0


def _pressure_altitude(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """The standard atmosphere (ICAO Doc 7488) below 11 km: h = T0 / L (1 - (p / p0)^(L R / g))."""
    if not _LOWEST_PRESSURE_HPA <= message.press_abs <= _HIGHEST_PRESSURE_HPA:
        return None
    ratio = message.press_abs / _SEA_LEVEL_HPA
    return PressureAltitude(sender, 44_330.77 * (1.0 - ratio**0.190_263))


def _geoid_separation(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`alt_ellipsoid` is 0 where the receiver, or an older autopilot, does not know it."""
    if message.alt_ellipsoid == 0 or message.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX:
        return None
    separation_m = (message.alt_ellipsoid - message.alt) / 1000.0
    return GeoidSeparation(sender, separation_m) if abs(separation_m) <= _LARGEST_SEPARATION_M else None


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: _pressure_altitude,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _geoid_separation,
}
