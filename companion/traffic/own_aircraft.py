"""Ourselves as the traffic shows us: our own recent positions, our addresses, and how far an echo may be.

Another source sees us where we were a moment ago. Several messages claim an address as ours; an aircraft with
it that flies elsewhere refutes them.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import (
    AltitudeReference,
    LatLon,
    TrafficReport,
    TrafficSource,
    Vec2,
    adsb_key,
    uas_key,
)
from companion.traffic.altitudes import SeaLevelAltitude
from companion.traffic.params import EchoParams, TrafficParams
from companion.traffic.target import Motion, Target

_SPACING_S: Final = 0.2
# A position is extrapolated for this long; later it is missing. A slow link sends one a second.
_EXTRAPOLATED_S: Final = 2.0
# The first position says where we were before, if we flew straight.
_ASSUMED_SPACING_S, _ASSUMED_S = 1.0, 12.0
# How soon something may be near us: we can approach it, it can turn towards us, and both can climb.
_APPROACH_MPS, _LEAST_CLOSING_MPS, _UNKNOWN_SPEED_MPS = 20.0, 5.0, 40.0
_NEAR_HEIGHT_M, _VERTICAL_MPS = 150.0, 15.0
# An echo is no further away in latitude: 2 km.
_NEAR_DEG: Final = 0.02
# Our own position comes several times a second, or once on a slow link. After this time it is missing.
SILENT_S: Final = 1.0
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


def is_far_north_or_south(motion: Motion, latest: OwnshipFix) -> bool:
    """Whether a motion is further from our newest position, by latitude, than an echo of it can be."""
    if abs(motion.lat_deg - latest.lat_deg) <= _NEAR_DEG:
        return False
    return motion.position_s <= latest.time_s + SILENT_S


def furthest_echo_m(own: OwnshipFix, params: EchoParams) -> float:
    """Further than this from where we are, nothing is looked at as a shadow of ours."""
    speed_mps = math.hypot(own.north_mps, own.east_mps)
    return 2.0 * (params.shadow_radius_m + params.shadow_delay_s * speed_mps)


class Identity(Enum):
    """Whose a target is by its identifier."""

    OURS = "ours"
    UNKNOWN = "unknown"
    NEIGHBOUR = "another system on our link"  # ours again, or one that flies with us
    ANOTHERS = "another's"
    MEMBER = "a member's"  # of our formation: it may fly along with us for long


# We are reported late and displaced, but no further from where we are than this, and as far as we fly in this
# time.
_ELSEWHERE_M, _ELSEWHERE_S, _OTHER_HEIGHT_M = 500.0, 10.0, 150.0
_ELSEWHERE_REPORTS: Final = 2
# Messages may call so many addresses ours; then the oldest claim is forgotten.
_MOST_CLAIMS: Final = 8
# Of traffic that is not known by an address of its own, but by a number that a ground station gave it.
_NAMELESS: Final = frozenset({TrafficSource.TISB, TrafficSource.ADSR})


class OwnIdentity:
    """The addresses that are ours as far as is known, and those that are not, whatever claims them."""

    def __init__(self, params: TrafficParams, trail: OwnTrail) -> None:
        self._trail, self._echo = trail, params.own_echo
        self._icao = dict.fromkeys(sorted(params.own_icao))
        self._configured = len(self._icao)
        self._uas_key = None if params.own_uas_id is None else uas_key(params.own_uas_id)
        self._elsewhere: dict[str, tuple[int, float]] = {}  # reports in a row, and when the last one came
        self.refuted: dict[str, float] = {}  # by key, with the time
        self.is_member: Callable[[str], bool] = lambda _key: False  # of our formation, by key

    @property
    def icao(self) -> int | None:
        """The address that our transponder was last called by, or the only configured one; else `None`."""
        ours = [icao for icao in self._icao if adsb_key(icao) not in self.refuted]
        is_clear = len(self._icao) > self._configured or len(ours) == 1
        return ours[-1] if ours and is_clear else None

    def claim(self, icao: int) -> str | None:
        """Note that a message calls an address ours; returns its key, `None` if it is not believed."""
        key = adsb_key(icao)
        if icao <= 0 or key in self.refuted:
            return None
        self._icao[icao] = None
        if len(self._icao) > self._configured + _MOST_CLAIMS:
            del self._icao[list(self._icao)[self._configured]]
        return key

    def is_claimed(self, report: TrafficReport) -> bool:
        """Whether the report has one of our identifiers."""
        if report.key in self.refuted:
            return False
        return report.icao in self._icao or report.key == self._uas_key

    def identify(self, target: Target, altitude: SeaLevelAltitude | None) -> Identity:
        """Whose a target is by its identifier, and by where it flies."""
        if target.icao in self._icao or target.key == self._uas_key:
            if target.key not in self.refuted and not self._refute(target, altitude):
                return Identity.OURS
            return Identity.UNKNOWN
        if target.anonymous or target.source in _NAMELESS:
            return Identity.UNKNOWN
        if target.source is TrafficSource.SYSTEM:
            return Identity.MEMBER if self.is_member(target.key) else Identity.NEIGHBOUR
        known_ours = bool(self._icao) if target.icao is not None else self._uas_key is not None
        return Identity.ANOTHERS if known_ours else Identity.UNKNOWN

    def is_far(self, target: Target) -> bool:
        """Whether a target is so far from us, with certainty, that it is no echo of ours."""
        motion, latest = target.motion, self._trail.latest
        if motion is None or latest is None or not is_far_north_or_south(motion, latest):
            return False
        newest = target.last
        own = self._trail.at(newest.time_s)
        if own is None:
            return False
        offset_m = LocalFrame(own.lat_deg, own.lon_deg).to_north_east_m(newest.lat_deg, newest.lon_deg)
        return math.hypot(*offset_m) > furthest_echo_m(own, self._echo)

    def _refute(self, target: Target, altitude: SeaLevelAltitude | None) -> bool:
        """Count reports of one of our identifiers elsewhere; True after several: it is another's."""
        newest = target.last
        own = self._trail.at(newest.time_s)
        if own is None:
            return False
        north_m, east_m = LocalFrame(own.lat_deg, own.lon_deg).to_north_east_m(newest.lat_deg, newest.lon_deg)
        reach_m = _ELSEWHERE_M + _ELSEWHERE_S * math.hypot(own.north_mps, own.east_mps)
        elsewhere = math.hypot(north_m, east_m) > reach_m
        if altitude is not None:
            elsewhere |= abs(altitude.altitude_m - own.altitude_m) > _OTHER_HEIGHT_M + altitude.uncertainty_m
        count, counted_s = self._elsewhere.get(target.track_id, (0, -math.inf))
        if newest.received_s > counted_s:  # a report may be judged again
            count = count + 1 if elsewhere else 0
            self._elsewhere[target.track_id] = count, newest.received_s
        if count < _ELSEWHERE_REPORTS:
            return False
        self.refuted[target.key] = newest.received_s
        return True
