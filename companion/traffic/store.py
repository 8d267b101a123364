"""The targets that are known: bounded in number, found by place, and grouped where they are one aircraft.

The one that would reach us last makes room. A grid of cells in latitude and longitude gives the targets near
a place, without a look at all others.

Two targets of the same source are always two aircraft, because a source identifies its own; those without an
identifier count as another source. Two targets of different sources become one track after several reports at
the same place with the same motion, and two again after several reports clearly apart. In between nothing
changes.
"""

import math
from collections.abc import Iterator, Sequence
from heapq import heapify, heappop, heappush
from operator import attrgetter
from typing import Final

from companion.geodesy import LocalFrame
from companion.model import TrafficKind
from companion.traffic.altitudes import DatumOffsets, to_sea_level
from companion.traffic.params import AssociationParams
from companion.traffic.target import Motion, Target

# About 1.1 km: with the cells around it, beyond every gate between two targets.
_CELL_DEG: Final = 0.01
# In a flood at one place the first ones suffice: it then has more tracks than aircraft, which is safe.
_MOST_NEAR: Final = 128
_Cell = tuple[int, int]


class Grid:
    """Targets by cell. Their order is that of their arrival in the cell, so that it is reproducible."""

    def __init__(self) -> None:
        self._cells: dict[_Cell, dict[str, Target]] = {}
        self._cell_of: dict[str, _Cell] = {}

    def move(self, target: Target, lat_deg: float, lon_deg: float) -> None:
        """Add a target at a place, or move it there."""
        cell = _cell(lat_deg, lon_deg)
        if self._cell_of.get(target.track_id) != cell:
            self.remove(target.track_id)
            self._cell_of[target.track_id] = cell
        self._cells.setdefault(cell, {})[target.track_id] = target

    def remove(self, track_id: str) -> None:
        """Remove a target, if it is there."""
        cell = self._cell_of.pop(track_id, None)
        if cell is not None:
            targets = self._cells[cell]
            del targets[track_id]
            if not targets:
                del self._cells[cell]

    def near(self, lat_deg: float, lon_deg: float) -> Iterator[Target]:
        """The targets within at least a cell's width of a place, at most `_MOST_NEAR`."""
        row, left = _MOST_NEAR, math.floor(lat_deg / _CELL_DEG)
        for north in (left, left - 1, left + 1):
            width_deg = _width_deg(north)
            columns = round(360.0 / width_deg)
            middle = math.floor((lon_deg + 180.0) / width_deg)
            for column in range(middle - 1, middle + 2):
                for target in self._cells.get((north, column % columns), {}).values():
                    yield target
                    row -= 1
                    if row <= 0:
                        return


def _cell(lat_deg: float, lon_deg: float) -> _Cell:
    north = math.floor(lat_deg / _CELL_DEG)
    width_deg = _width_deg(north)
    return north, math.floor((lon_deg + 180.0) / width_deg) % round(360.0 / width_deg)


def _width_deg(north: int) -> float:
    """The width of the cells of a row: a whole number of them around the globe, as wide as high or wider."""
    narrowest = max(
        min(math.cos(math.radians(north * _CELL_DEG)), math.cos(math.radians((north + 1) * _CELL_DEG))), 1e-3
    )
    return 360.0 / max(math.floor(360.0 / (_CELL_DEG / narrowest)), 3)


# In conflict, confirmed, later to reach us (negative), and when it was reported: the smallest makes room.
_Priority = tuple[bool, bool, float, float]
# Keys are remembered beyond their targets: one that is heard twice in this time comes before one heard once.
_HEARD_TWICE_S, _MOST_HEARD = 3.5, 20_000


class TargetStore:
    """All targets by `track_id`, and where they are; at most `most`."""

    def __init__(self, most: int) -> None:
        self.targets: dict[str, Target] = {}
        self.grid = Grid()
        self._most = most
        self._ordered: list[Target] = []
        self._heap: list[tuple[_Priority, int, str]] = []
        self._count = 0
        self._heard_s: dict[str, float] = {}

    @property
    def is_full(self) -> bool:
        """Whether the next new target needs room."""
        return len(self.targets) >= self._most

    def __iter__(self) -> Iterator[Target]:
        """The targets in the order of their ids."""
        if not self._ordered:
            self._ordered = sorted(self.targets.values(), key=attrgetter("track_id"))
        return iter(self._ordered)

    def put(self, target: Target) -> list[Target]:
        """Add or move a target; returns what made room, which may be the target itself."""
        known = self.targets.get(target.track_id) is target
        if not known:
            self._ordered = []
            self.targets[target.track_id] = target
            self._note_key(target)
        self.grid.move(target, target.last.lat_deg, target.last.lon_deg)
        if known:
            return []
        if self._heap:
            self._push(target)
        return self._make_room()

    def remove(self, target: Target) -> bool:
        """Remove a target; returns whether it was there."""
        if self.targets.get(target.track_id) is not target:
            return False
        del self.targets[target.track_id]
        self._ordered = []
        self.grid.remove(target.track_id)
        return True

    def _note_key(self, target: Target) -> None:
        """Confirm a target whose key was heard just before, though its target has made room since."""
        now_s = target.measured_s
        heard_s = self._heard_s.pop(target.key, None)
        if heard_s is not None and 0.0 < now_s - heard_s <= _HEARD_TWICE_S and target.number == 1:
            target.heard_before = True
        self._heard_s[target.key] = now_s
        if len(self._heard_s) > _MOST_HEARD:
            del self._heard_s[next(iter(self._heard_s))]

    def _make_room(self) -> list[Target]:
        removed: list[Target] = []
        while len(self.targets) > self._most:
            if len(self._heap) < len(self.targets) or len(self._heap) > 4 * self._most:
                self._heap = []
                for target in self.targets.values():
                    self._push(target)
                heapify(self._heap)
            least = self._least()
            if least is None:
                return removed
            self.remove(least)
            removed.append(least)
        return removed

    def _least(self) -> Target | None:
        """The target with the lowest priority; priorities that have changed since are corrected."""
        while self._heap:
            priority, _, track_id = heappop(self._heap)
            target = self.targets.get(track_id)
            if target is None:
                continue
            if _priority(target) == priority:
                return target
            self._push(target)
        return None

    def _push(self, target: Target) -> None:
        self._count += 1
        heappush(self._heap, (_priority(target), self._count, target.track_id))


def _priority(target: Target) -> _Priority:
    confirmed = target.is_confirmed or target.heard_before
    return target.threat, confirmed, -target.reach_s, target.measured_s


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
