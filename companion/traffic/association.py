"""Which of those that are heard are one and the same aircraft, heard in several ways.

Two of the same source are never one: each source knows its own apart. Two of different sources are, once they
have been at the same place with the same motion over several reports; they are two again once they have been
clearly apart over several. In between nothing changes.
"""

import math
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet

from companion.geodesy import LocalFrame
from companion.model import TrafficKind, TrafficSource
from companion.traffic.altitude_datums import Datums, compare
from companion.traffic.gates import AssociationParams
from companion.traffic.target import Motion, Target

# A report sets off the comparison with those whose source ranks before its own.
_RANK = {TrafficSource.ADSB: 0, TrafficSource.UTM: 1, TrafficSource.SYSTEM: 2}
_BEFORE = {source: {other for other in _RANK if _RANK[other] < _RANK[source]} for source in _RANK}
# Nobody further away than this in latitude, and as far in longitude, is compared: 2 km, beyond every gate.
_NEAR_DEG = 0.02
# Positions older than this are flown on too far to compare.
_FRESH_S = 3.0
_FLYING = frozenset({TrafficKind.AIRCRAFT, TrafficKind.UAV})
# Standard deviations where the sender states none: transponders of small aircraft, networks, autopilots.
_TYPICAL_SIGMA_M = {TrafficSource.ADSB: 30.0, TrafficSource.UTM: 20.0, TrafficSource.SYSTEM: 5.0}
# In such steps age and accuracy count, so that the leader does not change with every report.
_AGE_STEP_S, _SIGMA_STEP_M = 3.0, 10.0


class _Pair:
    """Two that may be one: since when they are alike, or, once merged, since when they are apart."""

    __slots__ = ("merged", "reports", "since_s")

    def __init__(self) -> None:
        self.merged = False
        self.reports = 0
        self.since_s = math.inf

    def counts(self, now_s: float) -> int:
        """One more report of the same opinion."""
        if not self.reports:
            self.since_s = now_s
        self.reports += 1
        return self.reports

    def starts_over(self) -> None:
        """The opposite was seen."""
        self.reports = 0


class Association:
    """Pairs that are watched, and the groups that follow: for each member the keys of all.

    The first of a group names its track.
    """

    def __init__(self, params: AssociationParams) -> None:
        self._params = params
        # By whose reports a pair is judged, then by whom it is compared with.
        self._pairs: dict[str, dict[str, _Pair]] = {}
        self.groups: dict[str, tuple[str, ...]] = {}

    def group_of(self, key: str) -> tuple[str, ...]:
        """The keys of all that are one with this one."""
        return self.groups.get(key, (key,))

    def heard(self, target: Target, targets: Mapping[str, Target], datums: Datums) -> None:
        """A new measurement of `target`: compare it with all whose source ranks before its own."""
        if target.kind not in _FLYING:
            self.forget(target.key)
            return
        before = _BEFORE[target.source]
        if not before:
            return
        pairs = self._pairs.setdefault(target.key, {})
        self._judge_merged(pairs, target, targets, datums)
        taken = {targets[key].source for key, pair in pairs.items() if pair.merged}
        alike = self._nearest_alike(target, targets, before - taken, datums)
        for key, pair in list(pairs.items()):
            if not pair.merged and (key not in targets or alike.get(targets[key].source) != key):
                del pairs[key]
        for key in alike.values():
            self._count_alike(target, key, targets)

    def forget(self, key: str) -> None:
        """This one is not heard any more."""
        self._pairs.pop(key, None)
        if key in self.groups:
            for pairs in self._pairs.values():
                pairs.pop(key, None)
            self._regroup()

    def _judge_merged(
        self, pairs: dict[str, _Pair], target: Target, targets: Mapping[str, Target], datums: Datums
    ) -> None:
        params = self._params
        parted = []
        for key, pair in pairs.items():
            other = targets.get(key)
            if not pair.merged or other is None or target.measured_s - other.measured_s > _FRESH_S:
                continue
            apart = gap(target, other, params, datums)
            if apart is None:
                continue
            if apart <= params.split_factor:
                pair.starts_over()
            elif (
                pair.counts(target.measured_s) >= params.split_reports
                and target.measured_s - pair.since_s >= params.split_after_s
            ):
                parted.append(key)
        for key in parted:
            del pairs[key]
        if parted:
            self._regroup()

    def _nearest_alike(
        self,
        target: Target,
        targets: Mapping[str, Target],
        sources: AbstractSet[TrafficSource],
        datums: Datums,
    ) -> dict[TrafficSource, str]:
        """Of each of the sources, the one most like the target, where one is within the gate.

        Who is one with another of the target's source already is not looked at: the nearest that is left.
        """
        if target.motion is None or not sources:
            return {}
        lat_deg, lon_deg, measured_s = target.motion.lat_deg, target.motion.lon_deg, target.measured_s
        near_lon_deg = _NEAR_DEG / max(math.cos(math.radians(lat_deg)), 1e-3)
        nearest: dict[TrafficSource, tuple[float, str]] = {}
        for other in targets.values():
            motion = other.motion
            if motion is None or abs(motion.lat_deg - lat_deg) > _NEAR_DEG or other.source not in sources:
                continue
            if abs((motion.lon_deg - lon_deg + 180.0) % 360.0 - 180.0) > near_lon_deg:
                continue
            if measured_s - other.measured_s > _FRESH_S or other.kind not in _FLYING:
                continue
            apart = gap(target, other, self._params, datums)
            closest = nearest.get(other.source, (1.0, ""))[0]
            if apart is not None and apart <= closest and not self._is_one_with(other.key, target, targets):
                nearest[other.source] = apart, other.key
        return {source: key for source, (_, key) in nearest.items()}

    def _count_alike(self, target: Target, key: str, targets: Mapping[str, Target]) -> None:
        params = self._params
        pair = self._pairs[target.key].setdefault(key, _Pair())
        if (
            pair.counts(target.measured_s) < params.merge_reports
            or target.measured_s - pair.since_s < params.merge_after_s
        ):
            return
        ours = {targets[k].source for k in self.group_of(target.key)}
        theirs = {targets[k].source for k in self.group_of(key)}
        if ours.isdisjoint(theirs):
            pair.merged = True
            pair.starts_over()
            self._regroup()

    def _is_one_with(self, key: str, target: Target, targets: Mapping[str, Target]) -> bool:
        """Whether a group has somebody of the target's source already, other than the target itself."""
        group = self.groups.get(key, ())
        return any(targets[k].source is target.source and k != target.key for k in group)

    def _regroup(self) -> None:
        """The groups are what the merged pairs connect."""
        together: dict[str, set[str]] = {}
        for key, pairs in self._pairs.items():
            for other, pair in pairs.items():
                if pair.merged:
                    both = together.get(key, {key}) | together.get(other, {other})
                    together.update(dict.fromkeys(both, both))
        self.groups = {key: tuple(sorted(members, key=_naming)) for key, members in together.items()}


def _naming(key: str) -> tuple[bool, str]:
    """Keys with a prefix give way to addresses of transponders, which others know too."""
    return "-" in key, key


def gap(one: Target, other: Target, params: AssociationParams, datums: Datums) -> float | None:
    """How unlike two are, in parts of the gate: 1 on its edge; `None` where it cannot be said."""
    a, b = one.motion, other.motion
    if a is None or b is None:
        return None
    now_s = max(a.place_s, b.place_s)
    height_a, height_b = compare(a.heights, datums, now_s), compare(b.heights, datums, now_s)
    if height_a is None or height_b is None:
        return None
    open_m = height_a.uncertainty_m + height_b.uncertainty_m
    return max(
        _horizontal_gap(a, b, params, now_s),
        math.hypot(a.north_mps - b.north_mps, a.east_mps - b.east_mps) / params.velocity_mps,
        abs(height_a.altitude_m - height_b.altitude_m) / (params.vertical_m + open_m),
        abs(height_a.climb_mps - height_b.climb_mps) / params.climb_mps,
    )


def _horizontal_gap(a: Motion, b: Motion, params: AssociationParams, now_s: float) -> float:
    frame = LocalFrame(a.lat_deg, a.lon_deg)
    north_m, east_m = frame.to_north_east_m(b.lat_deg, b.lon_deg)
    north_m += b.north_mps * (now_s - b.place_s) - a.north_mps * (now_s - a.place_s)
    east_m += b.east_mps * (now_s - b.place_s) - a.east_mps * (now_s - a.place_s)
    speed_mps = math.hypot(a.north_mps, a.east_mps)
    if speed_mps < 1.0:
        return math.hypot(north_m, east_m) / params.horizontal_m
    north, east = a.north_mps / speed_mps, a.east_mps / speed_mps
    along_m, aside_m = north_m * north + east_m * east, east_m * north - north_m * east
    reach_m = params.horizontal_m + params.delay_s * speed_mps
    return math.hypot(along_m / reach_m, aside_m / params.horizontal_m)


def leader(members: Sequence[Target], now_s: float) -> Target:
    """The one to believe: the fresher, then the more accurate."""

    def badness(target: Target) -> tuple[float, float, int]:
        motion = target.motion
        sigma_m = None if motion is None else motion.sigma_m
        sigma_m = _TYPICAL_SIGMA_M[target.source] if sigma_m is None else sigma_m
        age_s = max(now_s - target.measured_s, 0.0)
        return age_s // _AGE_STEP_S, sigma_m // _SIGMA_STEP_M, _RANK[target.source]

    return min(members, key=badness)
