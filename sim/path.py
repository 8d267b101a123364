"""A path over ground as a polyline: how far from it a point is, and thinning it out."""

import itertools
import math
from collections.abc import Sequence

from companion.model import Vec2


def thinned_path(points: Sequence[Vec2], spacing_m: float = 50.0) -> list[Vec2]:
    """The same path with points at least so far apart, its end kept: cheap to measure against."""
    path: list[Vec2] = []
    for point in points:
        if not path or math.dist(point, path[-1]) >= spacing_m:
            path.append(point)
    if points and path[-1] != points[-1]:
        path.append(points[-1])
    return path


def distance_to_path_m(point: Vec2, path: Sequence[Vec2]) -> float:
    """Distance of a point from a polyline [m]; 0 when there is none."""
    if len(path) < 2:
        return math.dist(point, path[0]) if path else 0.0
    return min(_distance_to_leg_m(point, a, b) for a, b in itertools.pairwise(path))


def _distance_to_leg_m(point: Vec2, a: Vec2, b: Vec2) -> float:
    along = (b[0] - a[0], b[1] - a[1])
    length2 = along[0] ** 2 + along[1] ** 2
    share = 0.0
    if length2 > 0.0:
        share = ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / length2
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, (a[0] + share * along[0], a[1] + share * along[1]))
