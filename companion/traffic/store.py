"""The targets that are known: bounded in number, and found by their place.

The one that would reach us last makes room. A grid of cells in latitude and longitude gives the targets near
a place, without a look at all others.
"""

import math
from collections.abc import Iterator
from heapq import heapify, heappop, heappush
from operator import attrgetter
from typing import Final

from companion.traffic.target import Target

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
