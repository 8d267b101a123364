"""Fences in the form of the mission protocol: polygons and circles, inclusion and exclusion."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from companion.geodesy import LocalFrame
from companion.model import Vec2
from sim.vehicle.mission import GLOBAL_FRAMES, MissionItem, is_sane

RETURN_POINT = 5000
INCLUSION_VERTEX, EXCLUSION_VERTEX = 5001, 5002
INCLUSION_CIRCLE, EXCLUSION_CIRCLE = 5003, 5004

_VERTICES = frozenset({INCLUSION_VERTEX, EXCLUSION_VERTEX})
_CIRCLES = frozenset({INCLUSION_CIRCLE, EXCLUSION_CIRCLE})
_COMMANDS = _VERTICES | _CIRCLES | {RETURN_POINT}
_FEWEST_VERTICES = 3


@dataclass(frozen=True, slots=True)
class _Area:
    """A polygon, or, with a positive `radius_m`, a circle around its only point; north, east from home."""

    inclusion: bool
    points_m: tuple[Vec2, ...]
    radius_m: float = 0.0

    def contains(self, place_m: Vec2) -> bool:
        """True inside the area."""
        if self.radius_m > 0.0:
            return math.dist(place_m, self.points_m[0]) <= self.radius_m
        return _is_in_polygon(place_m, self.points_m)


class Fence:
    """The fence items, and whether a place breaches them: outside the inclusions or inside an exclusion.

    With several inclusions it is enough to be inside one of them, as in PX4; a real ArduPlane requires all of
    them unless FENCE_OPTIONS permits the union.
    """

    def __init__(self, frame: LocalFrame) -> None:
        """Start without a fence; `frame` is that of all places."""
        self._frame = frame
        self.items: list[MissionItem] = []
        self._areas: list[_Area] = []

    def replace(self, items: Sequence[MissionItem]) -> bool:
        """Store a new list; False, and the old list stays, if its items are not complete areas."""
        areas = self._areas_of(items)
        if areas is None:
            return False
        self.items, self._areas = list(items), areas
        return True

    def item_at(self, sequence: int) -> MissionItem | None:
        """The item with that number."""
        return self.items[sequence] if 0 <= sequence < len(self.items) else None

    def is_broken_at(self, place_m: Vec2) -> bool:
        """True if a place (north, east) breaches the fence."""
        inclusions = [a for a in self._areas if a.inclusion]
        if inclusions and not any(a.contains(place_m) for a in inclusions):
            return True
        return any(a.contains(place_m) for a in self._areas if not a.inclusion)

    def _areas_of(self, items: Sequence[MissionItem]) -> list[_Area] | None:
        areas: list[_Area] = []
        index = 0
        while index < len(items):
            item = items[index]
            count = int(item.params[0]) if item.command in _VERTICES else 1
            group = items[index : index + count]
            whole = len(group) == count and all(
                (i.command, i.params[0]) == (item.command, item.params[0]) for i in group
            )
            if item.command in _VERTICES and not (whole and count >= _FEWEST_VERTICES):
                return None
            area = self._area_of(group)
            if area is not None:
                areas.append(area)
            index += count
        return areas

    def _area_of(self, group: Sequence[MissionItem]) -> _Area | None:
        first = group[0]
        points_m = tuple(self._place_m(i) for i in group)
        if first.command in _CIRCLES:
            return _Area(first.command == INCLUSION_CIRCLE, points_m, first.params[0])
        if first.command in _VERTICES:
            return _Area(first.command == INCLUSION_VERTEX, points_m)
        return None  # the return point is not a boundary

    def _place_m(self, item: MissionItem) -> Vec2:
        return self._frame.to_ned_m(item.place_or_zero())[:2]


def refusal(item: MissionItem) -> str | None:
    """Why an item is refused: "invalid", "unsupported" or "frame"; None if it is accepted."""
    if item.command not in _COMMANDS:
        return "unsupported"
    if item.frame not in GLOBAL_FRAMES:
        return "frame"
    if not is_sane(item) or (item.command in _CIRCLES and not item.params[0] > 0.0):
        return "invalid"
    return None


def _is_in_polygon(place_m: Vec2, corners_m: Sequence[Vec2]) -> bool:
    """Even-odd rule."""
    north_m, east_m = place_m
    inside = False
    before_n, before_e = corners_m[-1]
    for corner_n, corner_e in corners_m:
        if (corner_e > east_m) != (before_e > east_m):
            crossing_m = before_n + (east_m - before_e) * (corner_n - before_n) / (corner_e - before_e)
            if north_m < crossing_m:
                inside = not inside
        before_n, before_e = corner_n, corner_e
    return inside
