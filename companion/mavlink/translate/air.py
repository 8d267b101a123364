"""The air around us: VFR_HUD, WIND, WIND_COV."""

import math

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import AirData, Fact, Sender, Wind
from companion.mavlink.translate.wire import Translation

_FASTEST_MPS = 200.0
_HIGHEST_M = 20_000.0


def _air_data(message: Message, sender: Sender, _received_s: float) -> Fact:
    airspeed_mps = message.airspeed
    measured = 0.0 <= airspeed_mps <= _FASTEST_MPS  # false for NaN too
    altitude_m = message.alt if abs(message.alt) <= _HIGHEST_M else None
    return AirData(sender, airspeed_mps if measured else None, altitude_m)


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


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _air_data,
    mavlink.MAVLINK_MSG_ID_WIND: _wind,
    mavlink.MAVLINK_MSG_ID_WIND_COV: _wind_cov,
}
