"""A grid of cells in latitude and longitude: the targets near a place, without a look at all others."""

import math
from collections.abc import Iterator
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
