"""What is ourselves: our own addresses, and echoes that a source reports back to us as traffic.

An echo is at a place where we were a moment ago, with the velocity that we had then. No other aircraft stays
there for long. A target that is there in its first report counts as an echo at once; otherwise every echo
would begin as a conflict at zero distance. Several messages claim an address as ours; an aircraft with it
that flies elsewhere refutes them.
"""

import math
from enum import Enum
from typing import Final

from companion.geodesy import LocalFrame
from companion.model import TrafficKind, TrafficReport, TrafficSource, adsb_key, uas_key
from companion.traffic.altitudes import SeaLevelAltitude
from companion.traffic.own_trail import Match, OwnshipFix, OwnTrail, Shadows
from companion.traffic.params import EchoParams, TrafficParams
from companion.traffic.target import Motion, Target

_SPACING_S = 0.2
# Targets further away in latitude are not compared: 2 km.
_NEAR_DEG = 0.02
# A report may be valid between our last recorded position and the next one.
_AHEAD_S = 0.5
# Our own position comes several times a second, or once on a slow link. After this time it is missing.
_SILENT_S = 1.0


class Identity(Enum):
    """Whose a target is by its identifier."""

    OURS = "ours"
    UNKNOWN = "unknown"
    NEIGHBOUR = "another system on our link"  # ours again, or one that flies with us
    ANOTHERS = "another's"


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
        self._evidence: dict[str, _Evidence] = {}
        self._near: set[str] = set()
        self.shadows = Shadows(params, trail)
        self.keys: set[str] = set()

    def classify(self, target: Target, altitude: SeaLevelAltitude | None, identity: Identity) -> bool:
        """Whether a target that has a new measurement is an echo; an obstacle never is."""
        if identity is Identity.OURS:
            is_echo = True
        elif target.kind is TrafficKind.OBSTACLE:
            self.remove(target.track_id)
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
        evidence = self._evidence.get(key)
        if evidence is None:
            evidence = self._evidence[key] = _Evidence()
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
        self._evidence.pop(track_id, None)
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
        if (
            abs(motion.lat_deg - latest.lat_deg) > _NEAR_DEG
            and motion.position_s <= latest.time_s + _SILENT_S
        ):
            return math.inf
        trail = self._trail.between(
            motion.position_s - self._params.delay_s - _SPACING_S, motion.position_s + _AHEAD_S
        )
        if not trail or altitude is None:
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
        self._trail = trail
        self._icao = dict.fromkeys(sorted(params.own_icao))
        self._configured = len(self._icao)
        self._uas_key = None if params.own_uas_id is None else uas_key(params.own_uas_id)
        self._elsewhere: dict[str, tuple[int, float]] = {}  # reports in a row, and when the last one came
        self.refuted: dict[str, float] = {}  # by key, with the time

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
            return Identity.NEIGHBOUR
        known_ours = bool(self._icao) if target.icao is not None else self._uas_key is not None
        return Identity.ANOTHERS if known_ours else Identity.UNKNOWN

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
