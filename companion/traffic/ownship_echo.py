"""Echoes of ourselves, which a source reports back to us as traffic.

An echo is at a place where we were a moment ago, with the velocity that we had then. No other aircraft stays
there for long. A target that is there in its first report counts as an echo at once; otherwise every echo
would begin as a conflict at zero distance.
"""

import math

from companion.geodesy import LocalFrame
from companion.model import TrafficKind
from companion.traffic.altitudes import SeaLevelAltitude
from companion.traffic.own_aircraft import SILENT_S, Identity, OwnshipFix, OwnTrail, is_far_north_or_south
from companion.traffic.params import EchoParams
from companion.traffic.shadows import Match, Shadows
from companion.traffic.target import Motion, Target

_SPACING_S = 0.2
# A report may be valid between our last recorded position and the next one.
_AHEAD_S = 0.5


class _Evidence:
    """Reports in a row, and since when, that contradict the present classification of a target."""

    __slots__ = ("reports", "since_s")

    def __init__(self) -> None:
        self.reports = 0
        self.since_s = math.inf


class OwnshipEcho:
    """The targets that are echoes of our own recent positions, by `track_id`."""

    def __init__(self, params: EchoParams, trail: OwnTrail) -> None:
        self._params = params
        self._trail = trail
        self.evidence: dict[str, _Evidence] = {}  # of targets that are, or were, near us
        self._near: set[str] = set()
        self.shadows = Shadows(params, trail)
        self.keys: set[str] = set()

    def classify(self, target: Target, altitude: SeaLevelAltitude | None, identity: Identity) -> bool:
        """Whether a target that has a new measurement is an echo; an obstacle or a member never is."""
        if identity is Identity.OURS:
            is_echo = True
        elif target.kind is TrafficKind.OBSTACLE or identity is Identity.MEMBER:
            self.remove(target.track_id)
            target.seen_far = False
            return False
        else:
            others = identity in (Identity.ANOTHERS, Identity.NEIGHBOUR)
            is_echo = self.shadows.classify(target, altitude, known_other=others)
            if identity is not Identity.ANOTHERS:
                on_trail = self._is_near_echo(target, altitude)
                is_echo |= on_trail and not self.shadows.comes_nearer(target.track_id)
        if is_echo:
            self.keys.add(target.track_id)
        else:
            self.keys.discard(target.track_id)
        return is_echo

    def _is_near_echo(self, target: Target, altitude: SeaLevelAltitude | None) -> bool:
        """Whether it is on our trail of the last seconds."""
        key, distance = target.track_id, self._gate_distance(target, altitude)
        if distance is None:
            return key in self._near
        evidence, first = self.evidence.get(key), False
        if evidence is None:
            evidence, first = _Evidence(), not target.seen_far
            self.evidence[key] = evidence
        if first:
            is_echo = distance <= 1.0
        elif key in self._near:
            is_echo = not self._has_left(evidence, distance)
        elif distance > 1.0:
            evidence.reports = 0
            is_echo = False
        else:
            is_echo = self._has_followed(evidence, target.measured_s)
        if is_echo is not (key in self._near):
            evidence.reports = 0
            self._near.symmetric_difference_update((key,))
        return is_echo

    def is_odd(self, target: Target, match: Match) -> bool:
        """Whether an echo is later or further from us than those of our own transponder."""
        params = self._params
        return (
            target.track_id not in self._near
            or match.delay_s > params.delay_s
            or match.offset_m > params.radius_m
        )

    def remove(self, track_id: str) -> None:
        """Forget a target that is not received any more."""
        self.evidence.pop(track_id, None)
        self.shadows.remove(track_id)
        self._near.discard(track_id)
        self.keys.discard(track_id)

    def _has_left(self, evidence: _Evidence, distance: float) -> bool:
        """Count a report of an echo; True after enough reports far away: it is another aircraft."""
        evidence.reports = evidence.reports + 1 if distance > self._params.split_factor else 0
        return evidence.reports >= self._params.split_reports

    def _has_followed(self, evidence: _Evidence, now_s: float) -> bool:
        """Count a report on our trail; True after enough of them: it is an echo."""
        if not evidence.reports:
            evidence.since_s = now_s
        evidence.reports += 1
        return evidence.reports >= self._params.reports and now_s - evidence.since_s >= self._params.after_s

    def _gate_distance(self, target: Target, altitude: SeaLevelAltitude | None) -> float | None:
        """Dissimilarity to our own motion in units of the gate, inf far outside; `None` if not comparable."""
        motion, latest = target.motion, self._trail.latest
        if motion is None or latest is None:
            return None
        if is_far_north_or_south(motion, latest):
            return math.inf
        trail = self._trail.between(
            motion.position_s - self._params.delay_s - _SPACING_S, motion.position_s + _AHEAD_S
        )
        if not trail or altitude is None:
            return None
        smallest = self._smallest_distance(trail, motion, altitude)
        # A target that is not on our known trail may still be at our present position, if that is missing.
        return None if smallest > 1.0 and motion.position_s - trail[-1].time_s > SILENT_S else smallest

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
