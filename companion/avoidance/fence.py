"""Fences: zones to stay inside or outside of, and how rows flown ahead keep to them.

In MAVLink's fence missions all exclusion zones count. With several inclusion zones, ArduPlane requires
the aircraft to be inside all of them, PX4 inside at least one (`any_inclusion`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from companion.avoidance.trajectory import Array, Paths, times_until
from companion.model import Vec2

# Between the times of the prediction paths are sampled at this distance, or at the margin if that is larger.
# Then no wider zone can be missed.
_SPACING_M = 5.0
_Float = np.float32


@dataclass(frozen=True)
class Zone:
    """A polygon or a circle, north and east [m], to stay inside of (`inclusion`) or outside of.

    A polygon may be concave and of either orientation, but must not intersect itself; its last vertex is
    joined to its first. Altitude limits are above the zero of the local frame. With them an inclusion zone
    must be kept in height as well, and an exclusion zone may be passed above or below. `ValueError` if the
    zone is neither polygon nor circle, or both, is not finite, or has too few vertices or no radius.
    """

    inclusion: bool
    vertices_m: tuple[Vec2, ...] = ()
    centre_m: Vec2 | None = None
    radius_m: float | None = None
    min_altitude_m: float | None = None
    max_altitude_m: float | None = None

    def __post_init__(self) -> None:
        is_circle = self.centre_m is not None and self.radius_m is not None
        if is_circle == bool(self.vertices_m) or (self.centre_m is None) != (self.radius_m is None):
            raise ValueError("a zone is either a polygon or a circle")
        numbers = [x for vertex in self.vertices_m for x in vertex] + list(self.centre_m or ())
        numbers += [x for x in (self.radius_m, self.min_altitude_m, self.max_altitude_m) if x is not None]
        if not all(map(math.isfinite, numbers)):
            raise ValueError("a zone must be finite")
        if self.vertices_m and len(self.vertices_m) < 3:
            raise ValueError("a polygon needs three vertices")
        if self.radius_m is not None and self.radius_m <= 0.0:
            raise ValueError("a circle needs a radius above zero")

    @property
    def has_heights(self) -> bool:
        """Whether the zone has an altitude limit."""
        return self.min_altitude_m is not None or self.max_altitude_m is not None

    def inside_m(self, place_m: Array) -> Array:
        """Horizontal distance of places from the edge, negative outside [m]; (..., 2) to (...)."""
        if self.centre_m is not None and self.radius_m is not None:
            inside: Array = self.radius_m - np.hypot(
                place_m[..., 0] - self.centre_m[0], place_m[..., 1] - self.centre_m[1]
            )
            return inside
        return _inside_polygon_m(place_m, self._outline_m)

    def between_m(self, altitude_m: Array) -> Array:
        """Distance of altitudes from the nearest limit, negative beyond it, inf without one [m]."""
        between = np.full(np.shape(altitude_m), np.inf)
        if self.min_altitude_m is not None:
            between = np.minimum(between, altitude_m - self.min_altitude_m)
        if self.max_altitude_m is not None:
            between = np.minimum(between, self.max_altitude_m - altitude_m)
        return between

    def is_within(self, reach_m: float, place_m: Array) -> bool:
        """Whether the circle around the zone is nearer to a place, (2,), than `reach_m`."""
        centre_m, radius_m = self._circle
        return math.dist(centre_m, place_m.tolist()) < radius_m + reach_m

    @cached_property
    def _circle(self) -> tuple[Vec2, float]:
        if self.centre_m is not None and self.radius_m is not None:
            return self.centre_m, self.radius_m
        middle = self._outline_m.mean(axis=0)
        away = self._outline_m - middle
        return (float(middle[0]), float(middle[1])), float(np.hypot(away[:, 0], away[:, 1]).max())

    @cached_property
    def _outline_m(self) -> Array:
        return np.array(self.vertices_m, dtype=np.float64)


def _inside_polygon_m(place_m: Array, vertices_m: Array) -> Array:
    """Distance to the nearest edge, positive inside by the even-odd rule: (..., 2) to (...)."""
    shape = place_m.shape[:-1]
    flat_m = place_m.reshape(-1, 2)
    # Single precision takes half the time, and is accurate to millimetres relative to a nearby place.
    here_m = flat_m[0] if len(flat_m) else np.zeros(2)
    north, east = (flat_m - here_m).T[:, None, :].astype(_Float)
    starts = (vertices_m - here_m).astype(_Float)
    along_north, along_east = (np.roll(starts, -1, axis=0) - starts).T[:, :, None]
    off_north, off_east = north - starts[:, 0, None], east - starts[:, 1, None]
    length2 = np.maximum(along_north**2 + along_east**2, _Float(1e-6))
    share = (off_north * along_north + off_east * along_east) / length2
    share = np.minimum(np.maximum(share, _Float(0.0)), _Float(1.0))
    to_north, to_east = off_north - share * along_north, off_east - share * along_east
    distance = np.sqrt((to_north * to_north + to_east * to_east).min(axis=0))
    # A ray to the north crosses the edges that span its east coordinate and lie north of the place.
    above = off_east >= 0.0
    spans = above != np.roll(above, -1, axis=0)
    south = (off_north * along_east < off_east * along_north) == (along_east > 0.0)
    crossings = np.count_nonzero(spans & south, axis=0)
    inside: Array = np.where(crossings % 2 == 1, distance, -distance).astype(np.float64).reshape(shape)
    return inside


@dataclass(frozen=True, slots=True)
class Breach:
    """How rows break the fence with its margin, (K,) each.

    `deepest_m` and `mean_m` over time are how far rows are on the wrong side within the look-ahead. `first_s`
    is when that first happens, inf if never; after the look-ahead it is accurate to some seconds only.
    """

    deepest_m: Array
    mean_m: Array
    first_s: Array


@dataclass(frozen=True)
class Fence:
    """Zones that count together, and the distances to keep from their edges [m].

    The margins allow for gusts and for turns that differ from the prediction. With `any_inclusion`, two
    inclusion zones must overlap by twice the margin for an aircraft to pass from one to the other.
    """

    zones: tuple[Zone, ...]
    margin_m: float = 30.0
    vertical_margin_m: float = 5.0
    any_inclusion: bool = False

    def __post_init__(self) -> None:
        if not (0.0 <= self.margin_m < math.inf and 0.0 <= self.vertical_margin_m < math.inf):
            raise ValueError("margins must be zero or more")

    def depth_m(self, place_m: Array) -> Array:
        """How far places north-east-down are on the wrong side of fence and margin, (N, 3) to (N,) [m].

        0 within the fence. The way back is at least this long, sideways or in height.
        """
        one = np.zeros(1, dtype=np.intp)
        path = Paths(place_m[None, :, :2], -place_m[None, :, 2], one, one)
        depth: Array = self._depth_m(self.zones, path)[0]
        return depth

    def breach(self, paths: Paths, look_ahead_s: float, until_s: float) -> Breach:
        """How rows break the fence within the look-ahead, and when they first do so before `until_s`."""
        zones = self._reached(paths, max(look_ahead_s, until_s))
        if not zones:
            none = np.zeros(len(paths.ground_of))
            return Breach(none, none, np.full(len(none), np.inf))
        times_s, path = _sampled(paths, look_ahead_s, until_s, max(self.margin_m, _SPACING_M))
        depth = self._depth_m(zones, path)
        ahead = int(np.searchsorted(times_s, look_ahead_s)) + 1
        outside = depth > 0.0
        first_s = np.where(outside.any(axis=1), times_s[np.argmax(outside, axis=1)], np.inf)
        deepest = depth[:, :ahead].max(axis=1)
        steps_s = np.diff(times_s[:ahead])
        return Breach(deepest, depth[:, 1:ahead] @ steps_s / max(float(steps_s.sum()), 1e-9), first_s)

    def _reached(self, paths: Paths, until_s: float) -> tuple[Zone, ...]:
        """The zones that can matter: a depth changes no faster than the aircraft flies."""
        here = paths.ground_m[0, 0]
        furthest_m = float(np.abs(paths.ground_m[:, : len(times_until(until_s))] - here).max())
        reach_m = self.margin_m + math.sqrt(2.0) * furthest_m
        kept, contained = [], False
        for zone in self.zones:
            if not zone.inclusion:
                if zone.is_within(reach_m, here):
                    kept.append(zone)
            elif zone.has_heights or float(zone.inside_m(here)) < reach_m:
                kept.append(zone)
            else:
                contained = True
        if contained and self.any_inclusion:
            kept = [zone for zone in kept if not zone.inclusion]
        return tuple(kept)

    def _depth_m(self, zones: tuple[Zone, ...], path: Paths) -> Array:
        """How far rows are on the wrong side of these zones, (K, T)."""
        depth = np.zeros((len(path.ground_of), path.ground_m.shape[1]))
        nearest = np.full_like(depth, np.inf)
        for zone in zones:
            side = -1.0 if zone.inclusion else 1.0
            wrong = (self.margin_m + side * zone.inside_m(path.ground_m))[path.ground_of]
            if zone.has_heights:
                combined: Callable[[Array, Array], Array] = np.maximum if zone.inclusion else np.minimum
                height = self.vertical_margin_m + side * zone.between_m(path.altitude_m)
                wrong = combined(wrong, height[path.height_of])
            if zone.inclusion and self.any_inclusion:
                nearest = np.minimum(nearest, wrong)
            else:
                depth = np.maximum(depth, wrong)
        if self.any_inclusion and any(zone.inclusion for zone in zones):
            depth = np.maximum(depth, nearest)
        return depth


def _sampled(paths: Paths, look_ahead_s: float, until_s: float, spacing_m: float) -> tuple[Array, Paths]:
    """Rows at places at most `spacing_m` apart within the look-ahead, and at every other time thereafter."""
    times_s, near = times_until(max(look_ahead_s, until_s)), len(times_until(look_ahead_s))
    steps = np.diff(paths.ground_m[:, :near], axis=1)
    step_m = np.sqrt((steps * steps).sum(axis=2).max(axis=0))
    parts = np.maximum(np.ceil(step_m / spacing_m), 1.0).astype(int).tolist()
    fine = [np.arange(part) / part + place for place, part in enumerate(parts)]
    at = np.concatenate([*fine, np.arange(near - 1, len(times_s), 2)])
    place = np.minimum(at.astype(int), len(times_s) - 2)
    share = at - place

    def sampled(values: Array, share: Array) -> Array:
        between: Array = values[:, place] + (values[:, place + 1] - values[:, place]) * share
        return between

    return sampled(times_s[None, :], share)[0], Paths(
        sampled(paths.ground_m, share[:, None]),
        sampled(paths.altitude_m, share),
        paths.ground_of,
        paths.height_of,
    )
