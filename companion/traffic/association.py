"""Association: finds the targets of several sources that are one aircraft.

Two targets of the same source are always two aircraft, because a source identifies its own; those without an
identifier count as another source. Two targets of different sources become one track after several reports at
the same place with the same motion, and two again after several reports clearly apart. In between nothing
changes.
"""

import math
from collections.abc import Sequence

from companion.geodesy import LocalFrame
from companion.model import TrafficKind
from companion.traffic.altitude_datums import DatumOffsets, to_sea_level
from companion.traffic.params import AssociationParams
from companion.traffic.store import TargetStore
from companion.traffic.target import Motion, Target

# Older positions would have to be extrapolated too far for a comparison.
_FRESH_S = 3.0
_FLYING = frozenset({TrafficKind.AIRCRAFT, TrafficKind.UAV})
# Steps in which age and accuracy count, so that the leading target does not change with every report.
_AGE_STEP_S, _SIGMA_STEP_M = 3.0, 10.0


class _Pair:
    """Two targets that may be one aircraft, and the number of reports in a row that suggest a change.

    Before a merge similar reports are counted, after it those that are apart.
    """

    __slots__ = ("merged", "reports", "since_s")

    def __init__(self) -> None:
        self.merged = False
        self.reports = 0
        self.since_s = math.inf

    def count_report(self, now_s: float) -> int:
        """Count one more report; returns the number in a row."""
        if not self.reports:
            self.since_s = now_s
        self.reports += 1
        return self.reports

    def reset(self) -> None:
        """Start again, after a report that contradicts the change."""
        self.reports = 0


class Association:
    """Watches pairs of targets; `groups` has the keys of all members for each key of a group.

    The first key of a group identifies its track.
    """

    def __init__(self, params: AssociationParams) -> None:
        self._params = params
        # By the key of the target whose reports judge the pair, then by the key of the other.
        self._pairs: dict[str, dict[str, _Pair]] = {}
        self.groups: dict[str, tuple[str, ...]] = {}

    def group_of(self, key: str) -> tuple[str, ...]:
        """The keys of all targets that are the same aircraft as this one, its own included."""
        return self.groups.get(key, (key,))

    def update(self, target: Target, store: TargetStore, offsets: DatumOffsets) -> None:
        """Compare a target that has a new measurement with the targets near it of lower-ranked sources."""
        if target.kind not in _FLYING:
            self.remove(target.track_id)
            return
        if target.rank == 0:
            return
        targets = store.targets
        pairs = self._pairs.get(target.track_id, {})
        if pairs:
            self._split_distant(pairs, target, targets, offsets)
        merged_ranks = {targets[key].rank for key, pair in pairs.items() if pair.merged and key in targets}
        candidates = self._nearest_similar(target, store, merged_ranks, offsets)
        for key, pair in list(pairs.items()):
            if not pair.merged and (key not in targets or candidates.get(targets[key].rank) != key):
                del pairs[key]
        for key in candidates.values():
            self._count_similar(target, key, targets)

    def remove(self, key: str) -> None:
        """Forget a target that is not received any more."""
        self._pairs.pop(key, None)
        if key in self.groups:
            for pairs in self._pairs.values():
                pairs.pop(key, None)
            self._regroup()

    def _split_distant(
        self,
        pairs: dict[str, _Pair],
        target: Target,
        targets: dict[str, Target],
        offsets: DatumOffsets,
    ) -> None:
        """Split merged pairs that were apart for long enough."""
        params = self._params
        split = []
        for key, pair in pairs.items():
            other = targets.get(key)
            if not pair.merged or other is None or target.measured_s - other.measured_s > _FRESH_S:
                continue
            distance = gate_distance(target, other, params, offsets)
            if distance is None:
                continue
            if distance <= params.split_factor:
                pair.reset()
            elif (
                pair.count_report(target.measured_s) >= params.split_reports
                and target.measured_s - pair.since_s >= params.split_after_s
            ):
                split.append(key)
        for key in split:
            del pairs[key]
        if split:
            self._regroup()

    def _nearest_similar(
        self, target: Target, store: TargetStore, merged_ranks: set[int], offsets: DatumOffsets
    ) -> dict[int, str]:
        """For each rank, the key of the most similar target within the gate, if there is one.

        Targets that are already merged with another target of the same source are left out.
        """
        if target.motion is None:
            return {}
        lat_deg, lon_deg, measured_s = target.motion.lat_deg, target.motion.lon_deg, target.measured_s
        nearest: dict[int, tuple[float, str]] = {}
        for other in store.grid.near(lat_deg, lon_deg):
            rank = other.rank
            if rank >= target.rank or rank in merged_ranks or measured_s - other.measured_s > _FRESH_S:
                continue
            if other.kind not in _FLYING:
                continue
            distance = gate_distance(target, other, self._params, offsets)
            shortest = nearest.get(rank, (1.0, ""))[0]
            if distance is None or distance > shortest:
                continue
            if not self._is_taken(other.track_id, target, store.targets):
                nearest[rank] = distance, other.track_id
        return {rank: key for rank, (_, key) in nearest.items()}

    def _count_similar(self, target: Target, key: str, targets: dict[str, Target]) -> None:
        """Count a similar report; merge the pair after enough of them, unless both have the same source."""
        params = self._params
        pair = self._pairs.setdefault(target.track_id, {}).setdefault(key, _Pair())
        if (
            pair.count_report(target.measured_s) < params.merge_reports
            or target.measured_s - pair.since_s < params.merge_after_s
        ):
            return
        ranks = {targets[member].rank for member in self.group_of(target.track_id)}
        if ranks.isdisjoint(targets[member].rank for member in self.group_of(key)):
            pair.merged = True
            pair.reset()
            self._regroup()

    def _is_taken(self, key: str, target: Target, targets: dict[str, Target]) -> bool:
        """Whether the group of `key` has another target of the given target's source."""
        group = self.groups.get(key, ())
        return any(targets[member].rank == target.rank and member != target.track_id for member in group)

    def _regroup(self) -> None:
        """Form the groups of all targets that are connected by merged pairs."""
        connected: dict[str, set[str]] = {}
        for key, pairs in self._pairs.items():
            for other, pair in pairs.items():
                if pair.merged:
                    both = connected.get(key, {key}) | connected.get(other, {other})
                    connected.update(dict.fromkeys(both, both))
        self.groups = {key: tuple(sorted(members, key=_precedence)) for key, members in connected.items()}


def _precedence(key: str) -> tuple[bool, str]:
    """Addresses of transponders come before keys with a prefix, because others know them too."""
    return "-" in key, key


def gate_distance(
    one: Target, other: Target, params: AssociationParams, offsets: DatumOffsets
) -> float | None:
    """Dissimilarity of two targets in units of the gate, 1 on its edge; `None` if not comparable."""
    a, b = one.motion, other.motion
    if a is None or b is None:
        return None
    now_s = max(a.position_s, b.position_s)
    altitude_a, altitude_b = (
        to_sea_level(a.altitudes, offsets, now_s),
        to_sea_level(b.altitudes, offsets, now_s),
    )
    if altitude_a is None or altitude_b is None:
        return None
    uncertainty_m = altitude_a.uncertainty_m + altitude_b.uncertainty_m
    return max(
        _horizontal_gate_distance(a, b, params, now_s),
        math.hypot(a.north_mps - b.north_mps, a.east_mps - b.east_mps) / params.velocity_mps,
        abs(altitude_a.altitude_m - altitude_b.altitude_m) / (params.vertical_m + uncertainty_m),
        abs(altitude_a.climb_mps - altitude_b.climb_mps) / params.climb_mps,
    )


def _horizontal_gate_distance(a: Motion, b: Motion, params: AssociationParams, now_s: float) -> float:
    frame = LocalFrame(a.lat_deg, a.lon_deg)
    north_m, east_m = frame.to_north_east_m(b.lat_deg, b.lon_deg)
    north_m += b.north_mps * (now_s - b.position_s) - a.north_mps * (now_s - a.position_s)
    east_m += b.east_mps * (now_s - b.position_s) - a.east_mps * (now_s - a.position_s)
    speed_mps = math.hypot(a.north_mps, a.east_mps)
    if speed_mps < 1.0:
        return math.hypot(north_m, east_m) / params.horizontal_m
    north, east = a.north_mps / speed_mps, a.east_mps / speed_mps
    along_m, across_m = north_m * north + east_m * east, east_m * north - north_m * east
    along_gate_m = params.horizontal_m + params.delay_s * speed_mps
    return math.hypot(along_m / along_gate_m, across_m / params.horizontal_m)


def leading_target(members: Sequence[Target], now_s: float) -> Target:
    """The target whose position a group takes: the freshest, then the most accurate one."""

    def priority(target: Target) -> tuple[float, float, int]:
        age_s = max(now_s - target.measured_s, 0.0)
        return age_s // _AGE_STEP_S, target.sigma_m // _SIGMA_STEP_M, target.rank

    return min(members, key=priority)
