"""The terrain under the aircraft, as the autopilot reports it."""

import math

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import TerrainReport

_FRESH_S = 10.0
# Ground stations ask for the terrain of other places too, and the answers look the same.
_HERE_M = 300.0


class Terrain:
    """The newest report of the terrain where we are."""

    def __init__(self) -> None:
        self._altitude_m = 0.0
        self._at_s = -math.inf

    def observe(self, report: TerrainReport, place: GeoPoint | None, now_s: float) -> None:
        """Take a report in, if it is about the place we are at."""
        if place is None:
            return
        here = LocalFrame(place.lat_deg, place.lon_deg)
        away = here.to_ned_m(GeoPoint(report.lat_deg, report.lon_deg, 0.0))
        if math.hypot(away[0], away[1]) > _HERE_M:
            return
        # The autopilot's own height above terrain allows for an error of its altitude against the map's.
        self._altitude_m = max(report.terrain_altitude_m, place.altitude_m - report.height_above_terrain_m)
        self._at_s = now_s

    def altitude_m(self, now_s: float) -> float | None:
        """Height of the terrain above mean sea level; `None` when it is not known."""
        return self._altitude_m if 0.0 <= now_s - self._at_s <= _FRESH_S else None
