"""Echoes: our own aircraft, reported back to us as traffic by a source that does not recognize it.

An echo is at a place where we were a moment ago, with the velocity that we had then. No other aircraft stays
there for long. A target that is there in its first report counts as an echo at once; otherwise every echo
would begin as a conflict at zero distance.
"""

import math
from collections import deque
from typing import NamedTuple

from companion.geodesy import LocalFrame
from companion.model import TrafficKind
from companion.traffic.altitude_datums import DatumOffsets, SeaLevelAltitude, to_sea_level
from companion.traffic.params import EchoParams
from companion.traffic.target import Motion, Target

_SPACING_S = 0.2
# Targets further away in latitude are not compared: 2 km.
_NEAR_DEG = 0.02
# A report may be valid between our last recorded position and the next one.
_AHEAD_S = 0.5
# Our own position comes several times a second, or once on a slow link. After this time it is missing.
_SILENT_S = 1.0


class OwnshipFix(NamedTuple):
    """Our own position at `time_s`, altitude above mean sea level; velocity north, east and up."""

    time_s: float
    lat_deg: float
    lon_deg: float
    altitude_m: float
    north_mps: float
    east_mps: float
    climb_mps: float


class _Evidence:
    """Reports in a row, and since when, that contradict the present classification of a target."""

    __slots__ = ("reports", "since_s")

    def __init__(self) -> None:
        self.reports = 0
        self.since_s = math.inf


class OwnshipEcho:
    """Our own recent positions, and the keys of the targets that are echoes of them."""

    def __init__(self, params: EchoParams) -> None:
        self._params = params
        self._trail: deque[OwnshipFix] = deque()
        self._evidence: dict[str, _Evidence] = {}
        self.keys: set[str] = set()

    def observe_ownship(self, fix: OwnshipFix) -> None:
        """Record our own position; positions are kept for the largest delay of an echo."""
        if self._trail and fix.time_s - self._trail[-1].time_s < _SPACING_S - 1e-3:
            return
        self._trail.append(fix)
        while fix.time_s - self._trail[0].time_s > self._params.delay_s + 1.0:
            self._trail.popleft()

    def classify(self, target: Target, offsets: DatumOffsets) -> bool:
        """Whether a target that has a new measurement is an echo; an obstacle never is."""
        if target.kind is TrafficKind.OBSTACLE:
            self.remove(target.key)
            return False
        key, distance = target.key, self._gate_distance(target, offsets)
        if distance is None:
            return key in self.keys
        evidence = self._evidence.get(key)
        if evidence is None:
            evidence = self._evidence[key] = _Evidence()
            is_echo = distance <= 1.0
        elif key in self.keys:
            is_echo = not self._has_left(evidence, distance)
        else:
            is_echo = self._has_followed(evidence, distance, target.measured_s)
        if is_echo is not (key in self.keys):
            evidence.reports = 0
            self.keys.symmetric_difference_update((key,))
        return is_echo

    def remove(self, key: str) -> None:
        """Forget a target that is not received any more."""
        self._evidence.pop(key, None)
        self.keys.discard(key)

    def _has_left(self, evidence: _Evidence, distance: float) -> bool:
        """Count a report of an echo; True after enough reports far away: it is another aircraft."""
        evidence.reports = evidence.reports + 1 if distance > self._params.split_factor else 0
        return evidence.reports >= self._params.split_reports

    def _has_followed(self, evidence: _Evidence, distance: float, now_s: float) -> bool:
        """Count a report of a target; True after enough reports on our trail: it is an echo."""
        if distance > 1.0:
            evidence.reports = 0
            return False
        if not evidence.reports:
            evidence.since_s = now_s
        evidence.reports += 1
        return evidence.reports >= self._params.reports and now_s - evidence.since_s >= self._params.after_s

    def _gate_distance(self, target: Target, offsets: DatumOffsets) -> float | None:
        """Dissimilarity to our own motion in units of the gate, inf far outside; `None` if not comparable."""
        motion = target.motion
        if motion is None:
            return None
        trail = [
            own
            for own in self._trail
            if -_AHEAD_S <= motion.position_s - own.time_s <= self._params.delay_s + _SPACING_S
        ]
        if not trail:
            return None
        if abs(motion.lat_deg - trail[-1].lat_deg) > _NEAR_DEG:
            return math.inf
        altitude = to_sea_level(motion.altitudes, offsets, motion.position_s)
        if altitude is None:
            return None
        smallest = self._smallest_distance(trail, motion, altitude)
        # A target that is not on our known trail may still be at our present position, if that is missing.
        return None if smallest > 1.0 and motion.position_s - trail[-1].time_s > _SILENT_S else smallest

    def _smallest_distance(
        self, trail: list[OwnshipFix], motion: Motion, altitude: SeaLevelAltitude
    ) -> float:
        params, frame = self._params, LocalFrame(motion.lat_deg, motion.lon_deg)
        vertical_m, furthest = params.vertical_m + altitude.uncertainty_m, max(params.split_factor, 1.0)
        # Most targets nearby are outside the gate by latitude alone.
        furthest_deg = furthest * params.radius_m / frame.metres_per_degree[0]
        smallest = math.inf
        for own in trail:
            if abs(own.lat_deg - motion.lat_deg) > furthest_deg:
                continue
            north_m, east_m = frame.to_north_east_m(own.lat_deg, own.lon_deg)
            distance = math.hypot(north_m, east_m) / params.radius_m
            if distance > furthest or distance >= smallest:
                continue
            velocity_error_mps = math.hypot(own.north_mps - motion.north_mps, own.east_mps - motion.east_mps)
            distance = max(
                distance,
                velocity_error_mps / params.velocity_mps,
                abs(own.altitude_m - altitude.altitude_m) / vertical_m,
                abs(own.climb_mps - altitude.climb_mps) / params.climb_mps,
            )
            smallest = min(smallest, distance)
        return smallest
