"""Paths over ground as polylines: distance of a point, offsets from a leg with its slope, and thinning."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from companion.model import Vec2, Vec3

Array = NDArray[np.floating]


def thinned_path(points: Sequence[Vec2], spacing_m: float = 50.0) -> list[Vec2]:
    """The path with points at least `spacing_m` apart, end point included."""
    path: list[Vec2] = []
    for point in points:
        if not path or math.dist(point, path[-1]) >= spacing_m:
            path.append(point)
    if points and path[-1] != points[-1]:
        path.append(points[-1])
    return path


class Polyline:
    """A path over ground, (points, 2) [m], of which distances are asked many times."""

    def __init__(self, path: Sequence[Vec2] | NDArray[np.float64]) -> None:
        self._corners = corners = np.asarray(path, dtype=np.float64)
        if len(corners) >= 2:
            self._starts, self._along = corners[:-1], corners[1:] - corners[:-1]
            length2 = (self._along * self._along).sum(axis=1)
            self._length2 = np.maximum(length2, np.finfo(float).tiny)

    def distance_m(self, point: Vec2) -> float:
        """Distance of a point [m]; 0 from an empty path."""
        if len(self._corners) < 2:
            return math.dist(point, self._corners[0]) if len(self._corners) else 0.0
        away = np.asarray(point) - self._starts
        share = ((away * self._along).sum(axis=1) / self._length2).clip(0.0, 1.0)
        off = away - share[:, None] * self._along
        return math.sqrt(float((off * off).sum(axis=1).min()))


def distance_to_path_m(point: Vec2, path: Sequence[Vec2] | NDArray[np.float64]) -> float:
    """Distance of a point from a polyline, (points, 2) [m]; 0 for an empty one."""
    return Polyline(path).distance_m(point)


def off_leg(start_m: Vec3, end_m: Vec3, own_m: Array) -> tuple[Array, Array, Array]:
    """Offsets of places (n, 3) from a leg: to its right, above its slope, and beyond its ends, (n,) each."""
    along_n, along_e, length_m = _direction(start_m[:2], end_m[:2])
    north, east = own_m[:, 0] - start_m[0], own_m[:, 1] - start_m[1]
    along = north * along_n + east * along_e
    within = np.clip(along, 0.0, length_m)
    down = start_m[2] + within / length_m * (end_m[2] - start_m[2])
    return east * along_n - north * along_e, down - own_m[:, 2], along - within


def _direction(start_m: Sequence[float], end_m: Sequence[float]) -> tuple[float, float, float]:
    leg: Vec2 = (end_m[0] - start_m[0], end_m[1] - start_m[1])
    length_m = max(math.hypot(*leg), 1e-6)
    return leg[0] / length_m, leg[1] / length_m, length_m
