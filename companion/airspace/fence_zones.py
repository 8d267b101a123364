"""Fence zones on the globe, polygons and circles; each can be converted to the local frame."""

import math
from dataclasses import dataclass

from companion.avoidance import Zone
from companion.geodesy import LocalFrame
from companion.model import LatLon, Vec2

_MIN_VERTICES = 3


@dataclass(frozen=True, slots=True)
class FenceZone:
    """One zone: a polygon (`vertices_deg`) or a circle (`centre_deg`, `radius_m`), of (lat, lon) [deg].

    Heights are above home; `None`: no limit. The aircraft stays inside a zone with `inclusion`, and outside
    any other. ValueError if it is neither a polygon nor a circle, or not on the globe.
    """

    inclusion: bool
    vertices_deg: tuple[LatLon, ...] = ()
    centre_deg: LatLon | None = None
    radius_m: float | None = None
    min_height_m: float | None = None
    max_height_m: float | None = None

    def __post_init__(self) -> None:
        is_circle = self.centre_deg is not None and self.radius_m is not None
        is_incomplete = (self.centre_deg is None) != (self.radius_m is None)
        if is_incomplete or is_circle == bool(self.vertices_deg):
            raise ValueError("must have either vertices_deg, or centre_deg and radius_m")
        if self.vertices_deg and len(self.vertices_deg) < _MIN_VERTICES:
            raise ValueError("vertices_deg must be at least three")
        if self.radius_m is not None and not 0.0 < self.radius_m < math.inf:
            raise ValueError("radius_m must be greater than 0")
        for lat_deg, lon_deg in (*self.vertices_deg, *((self.centre_deg,) if self.centre_deg else ())):
            if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
                raise ValueError("a place must be [latitude, longitude] in degrees")
        low_m, high_m = self.min_height_m, self.max_height_m
        if low_m is not None and high_m is not None and low_m >= high_m:
            raise ValueError("min_height_m must be less than max_height_m")

    def in_frame(self, frame: LocalFrame, home_altitude_m: float) -> Zone:
        """The same zone in the local frame, with limits above mean sea level."""

        def local(place: LatLon) -> Vec2:
            return frame.to_north_east_m(*place)

        def altitude_m(height_m: float | None) -> float | None:
            return None if height_m is None else home_altitude_m + height_m

        return Zone(
            self.inclusion,
            tuple(local(vertex) for vertex in self.vertices_deg),
            None if self.centre_deg is None else local(self.centre_deg),
            self.radius_m,
            altitude_m(self.min_height_m),
            altitude_m(self.max_height_m),
        )
