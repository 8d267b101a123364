"""Our own recent positions: where we were when another source saw us, or measured from us."""

import math
from bisect import bisect_left, bisect_right
from dataclasses import replace
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import AltitudeReference, LatLon, TrafficReport, Vec2

_SPACING_S: Final = 0.2
# A position is extrapolated for this long; later it is missing. A slow link sends one a second.
_EXTRAPOLATED_S: Final = 2.0
# The first position says where we were before, if we flew straight.
_ASSUMED_SPACING_S, _ASSUMED_S = 1.0, 12.0
# How soon something may be near us: we can approach it, it can turn towards us, and both can climb.
_APPROACH_MPS, _LEAST_CLOSING_MPS, _UNKNOWN_SPEED_MPS = 20.0, 5.0, 40.0
_NEAR_HEIGHT_M, _VERTICAL_MPS = 150.0, 15.0
# Old positions are removed so many at a time.
_REMOVED: Final = 50


class OwnshipFix(NamedTuple):
    """Our own position at `time_s`, altitude above mean sea level; velocity north, east and up."""

    time_s: float
    lat_deg: float
    lon_deg: float
    altitude_m: float
    north_mps: float
    east_mps: float
    climb_mps: float

    def at(self, time_s: float) -> "OwnshipFix":
        """The position at another time, in straight flight."""
        elapsed_s = time_s - self.time_s
        frame = LocalFrame(self.lat_deg, self.lon_deg)
        altitude_m = self.altitude_m + self.climb_mps * elapsed_s
        place = frame.to_geo(self.north_mps * elapsed_s, self.east_mps * elapsed_s, -altitude_m)
        return OwnshipFix(time_s, *place, *self[4:])


class OwnTrail:
    """Our positions of the last `kept_s`."""

    def __init__(self, kept_s: float) -> None:
        self._kept_s = kept_s
        self._fixes: list[OwnshipFix] = []
        self.assumed_until_s = -math.inf  # positions before are assumed, not known

    @property
    def latest(self) -> OwnshipFix | None:
        """The newest position."""
        return self._fixes[-1] if self._fixes else None

    def observe(self, fix: OwnshipFix) -> bool:
        """Record our position; returns whether none was known for a while."""
        latest = self.latest
        if latest is not None and fix.time_s - latest.time_s < _SPACING_S - 1e-3:
            return False
        begins = latest is None or fix.time_s - latest.time_s > self._kept_s
        if begins:
            self._fixes.clear()
            self.assumed_until_s = fix.time_s
            for number in range(int(_ASSUMED_S / _ASSUMED_SPACING_S), 0, -1):
                self._fixes.append(fix.at(fix.time_s - number * _ASSUMED_SPACING_S))
        self._fixes.append(fix)
        if len(self._fixes) > _REMOVED and fix.time_s - self._fixes[_REMOVED].time_s > self._kept_s:
            del self._fixes[:_REMOVED]
        return begins or latest is None or fix.time_s - latest.time_s > _EXTRAPOLATED_S

    def reach_s(
        self, time_s: float, place_deg: LatLon, velocity_mps: Vec2 | None, altitude_m: float | None
    ) -> float:
        """How soon something could be near us; infinite while our own position is unknown."""
        own = self.at(time_s) or self.latest
        if own is None:
            return math.inf
        north_m, east_m = LocalFrame(own.lat_deg, own.lon_deg).to_north_east_m(*place_deg)
        distance_m = math.hypot(north_m, east_m)
        closing_mps = _UNKNOWN_SPEED_MPS
        if velocity_mps is not None:
            north_mps, east_mps = velocity_mps[0] - own.north_mps, velocity_mps[1] - own.east_mps
            closing_mps = -(north_m * north_mps + east_m * east_mps) / max(distance_m, 1.0)
        horizontal_s = distance_m / max(closing_mps + _APPROACH_MPS, _LEAST_CLOSING_MPS)
        if altitude_m is None:
            return horizontal_s
        return max(horizontal_s, (abs(altitude_m - own.altitude_m) - _NEAR_HEIGHT_M) / _VERTICAL_MPS)

    @staticmethod
    def placed(report: TrafficReport, own: OwnshipFix) -> tuple[LatLon | None, TrafficReport]:
        """The place of a report that is relative to us, and the report with an altitude relative to ours."""
        if report.relative_m is None:
            return None, report
        north_m, east_m, up_m = report.relative_m
        place = LocalFrame(own.lat_deg, own.lon_deg).to_geo(north_m, east_m, -(own.altitude_m + up_m))
        if report.altitude_m is None:
            altitude_m, reference = place.altitude_m, AltitudeReference.SEA_LEVEL
            report = replace(report, altitude_m=altitude_m, altitude_reference=reference)
        return (place.lat_deg, place.lon_deg), report

    def between(self, from_s: float, until_s: float) -> list[OwnshipFix]:
        """Our positions of this time."""
        first = bisect_left(self._fixes, from_s, key=_time_s)
        return self._fixes[first : bisect_right(self._fixes, until_s, key=_time_s)]

    def at(self, time_s: float) -> OwnshipFix | None:
        """Our position at a time; `None` if it is unknown."""
        latest = self.latest
        if latest is None or not self._fixes[0].time_s <= time_s <= latest.time_s + _EXTRAPOLATED_S:
            return None
        if time_s >= latest.time_s:
            return latest if time_s == latest.time_s else latest.at(time_s)
        index = bisect_left(self._fixes, time_s, key=_time_s)
        before, after = self._fixes[max(index - 1, 0)], self._fixes[index]
        if after.time_s - before.time_s > 2.0 * _EXTRAPOLATED_S:
            return None
        share = (time_s - before.time_s) / max(after.time_s - before.time_s, 1e-6)
        dlon_deg = (after.lon_deg - before.lon_deg + 180.0) % 360.0 - 180.0
        return OwnshipFix(
            time_s,
            before.lat_deg + share * (after.lat_deg - before.lat_deg),
            (before.lon_deg + share * dlon_deg + 180.0) % 360.0 - 180.0,
            *(one + share * (other - one) for one, other in zip(before[3:], after[3:], strict=True)),
        )


def _time_s(fix: OwnshipFix) -> float:
    return fix.time_s
