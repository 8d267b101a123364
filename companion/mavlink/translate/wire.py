"""Shared by all translations: sentinels, plausible ranges, and fields that many messages have."""

import math
from collections.abc import Callable

from companion.mavlink.dialect import Message
from companion.mavlink.facts import Fact, Sender

Translation = Callable[[Message, Sender, float], Fact | None]
"""From a message, its sender and the time of reception [s] to a fact; `None` if nothing in it is usable."""

UINT16_MAX = 0xFFFF
INT16_MAX = 0x7FFF
FULL_CIRCLE_CDEG = 36_000
# ADS-B encodes -1,000 to 126,700 ft; altitudes far outside cannot have been measured.
_MIN_ALTITUDE_M = -1_000.0
_MAX_ALTITUDE_M = 40_000.0


def target_of(message: Message) -> Sender:
    """The MAVLink address that a message is sent to."""
    return Sender(message.target_system, message.target_component)


def finite(value: float) -> float | None:
    """The value, or `None` for NaN and infinities."""
    return value if math.isfinite(value) else None


def position_deg(lat_e7: int, lon_e7: int) -> tuple[float, float] | None:
    """Latitude and longitude [deg]; `None` outside the globe (INT32_MAX included) and at 0, 0."""
    lat_deg, lon_deg = lat_e7 / 1e7, lon_e7 / 1e7
    if abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0 or (lat_e7 == 0 and lon_e7 == 0):
        return None
    return lat_deg, lon_deg


def altitude_m(altitude_mm: int) -> float | None:
    """An altitude [m]; `None` if implausible (INT32_MAX included)."""
    metres = altitude_mm / 1000.0
    return metres if is_altitude(metres) else None


def is_altitude(metres: float) -> bool:
    """Whether an altitude [m] is plausible; false for NaN."""
    return _MIN_ALTITUDE_M <= metres <= _MAX_ALTITUDE_M


def angle_rad(angle_cdeg: int) -> float | None:
    """Centidegrees in [0, 36000) as radians; `None` for any other value (UINT16_MAX included)."""
    return math.radians(angle_cdeg / 100.0) if angle_cdeg < FULL_CIRCLE_CDEG else None


def speed_mps(speed_cmps: int, unknown: int) -> float | None:
    """A speed [m/s]; `None` if it equals the sentinel `unknown`."""
    return None if speed_cmps == unknown else speed_cmps / 100.0


def printable(text: str | bytes) -> str | None:
    """The printable ASCII part of a text up to its first NUL, stripped; `None` if that is empty."""
    if isinstance(text, bytes):
        text = text.split(b"\0", 1)[0].decode("ascii", errors="ignore")
    return "".join(letter for letter in text if " " <= letter <= "~").strip() or None
