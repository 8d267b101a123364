"""What all translations share: the sentinels of the wire, and what no honest sender could mean."""

import math
from collections.abc import Callable

from companion.mavlink.dialect import Message
from companion.mavlink.facts import Fact, Sender

Translation = Callable[[Message, Sender, float], Fact | None]
"""From a message, its sender and the time of reception [s] to what it said."""

UINT16_MAX = 0xFFFF
INT16_MAX = 0x7FFF
_FULL_CIRCLE_CDEG = 36_000
# ADS-B encodes -1,000 to 126,700 ft; what is far outside was never measured.
_LOWEST_M = -1_000.0
_HIGHEST_M = 40_000.0


def place_deg(lat_e7: int, lon_e7: int) -> tuple[float, float] | None:
    """Latitude and longitude [deg]; `None` outside the globe, INT32_MAX included, and at 0, 0."""
    lat_deg, lon_deg = lat_e7 / 1e7, lon_e7 / 1e7
    if abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0 or (lat_e7 == 0 and lon_e7 == 0):
        return None
    return lat_deg, lon_deg


def altitude_m(altitude_mm: int) -> float | None:
    """An altitude [m]; `None` where nothing flies, INT32_MAX included."""
    metres = altitude_mm / 1000.0
    return metres if is_altitude(metres) else None


def is_altitude(metres: float) -> bool:
    """Whether anything flies at this altitude [m]; false for NaN."""
    return _LOWEST_M <= metres <= _HIGHEST_M


def angle_rad(angle_cdeg: int) -> float | None:
    """Centidegrees in [0, 36000) as radians; anything else is unknown, UINT16_MAX included."""
    return math.radians(angle_cdeg / 100.0) if angle_cdeg < _FULL_CIRCLE_CDEG else None


def speed_mps(speed_cmps: int, unknown: int) -> float | None:
    """A speed [m/s], unless it is the value that stands for unknown."""
    return None if speed_cmps == unknown else speed_cmps / 100.0


def printable(text: str | bytes) -> str | None:
    """Text up to the first NUL, without padding and what is not ASCII; `None` if nothing is left."""
    if isinstance(text, bytes):
        text = text.split(b"\0", 1)[0].decode("ascii", errors="ignore")
    return "".join(letter for letter in text if " " <= letter <= "~").strip() or None
