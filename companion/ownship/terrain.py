"""The height of the terrain under the aircraft, as the autopilot reports it."""

import math

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import TerrainReport

_FRESH_S = 10.0
# Ground stations request the terrain of other places too; the reports differ only in their place.
_HERE_M = 300.0


class Terrain:
    """The newest report about the aircraft's position."""

    def __init__(self) -> None:
        self._altitude_m = 0.0
        self._at_s = -math.inf

    def observe(self, report: TerrainReport, place: GeoPoint | None, now_s: float) -> None:
        """Store a report, if it is about a place near ours."""
        if place is None:
            return
        here = LocalFrame(place.lat_deg, place.lon_deg)
        away = here.to_ned_m(GeoPoint(report.lat_deg, report.lon_deg, 0.0))
        if math.hypot(away[0], away[1]) > _HERE_M:
            return
        # The autopilot corrects its height above terrain for the error of its altitude against the map.
        self._altitude_m = max(report.terrain_altitude_m, place.altitude_m - report.height_above_terrain_m)
        self._at_s = now_s

    def altitude_m(self, now_s: float) -> float | None:
        """Height of the terrain above mean sea level; `None` when it is unknown."""
        return self._altitude_m if 0.0 <= now_s - self._at_s <= _FRESH_S else None
