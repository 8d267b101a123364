"""Places to stay in, or out of: polygons and circles on the globe, and the same in the local frame."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from companion.geodesy import GeoPoint, LocalFrame

_Place = tuple[float, float]
_CORNERS = 3


@dataclass(frozen=True, slots=True)
class FenceZone:
    """One zone: a polygon (`vertices_deg`) or a circle (`centre_deg`, `radius_m`), of (lat, lon) [deg].

    Heights are above home; `None`: whatever the height. With `inclusion` the aircraft is to stay inside, or
    else outside. ValueError when it is neither polygon nor circle, or not on the globe.
    """

    inclusion: bool
    vertices_deg: tuple[_Place, ...] = ()
    centre_deg: _Place | None = None
    radius_m: float | None = None
    min_height_m: float | None = None
    max_height_m: float | None = None

    def __post_init__(self) -> None:
        circle = self.centre_deg is not None and self.radius_m is not None
        half = (self.centre_deg is None) != (self.radius_m is None)
        if half or circle == bool(self.vertices_deg):
            raise ValueError("must have either vertices_deg, or centre_deg and radius_m")
        if self.vertices_deg and len(self.vertices_deg) < _CORNERS:
            raise ValueError("vertices_deg must be at least three")
        if self.radius_m is not None and not 0.0 < self.radius_m < math.inf:
            raise ValueError("radius_m must be greater than 0")
        for lat_deg, lon_deg in (*self.vertices_deg, *((self.centre_deg,) if self.centre_deg else ())):
            if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
                raise ValueError("a place must be [latitude, longitude] in degrees")
        low, high = self.min_height_m, self.max_height_m
        if low is not None and high is not None and low >= high:
            raise ValueError("min_height_m must be less than max_height_m")

    def in_frame(self, frame: LocalFrame, home_altitude_m: float) -> "LocalZone":
        """The same zone in the local frame, heights above mean sea level."""

        def local(place: _Place) -> _Place:
            north_m, east_m, _ = frame.to_ned_m(GeoPoint(*place, 0.0))
            return north_m, east_m

        def altitude(height_m: float | None) -> float | None:
            return None if height_m is None else home_altitude_m + height_m

        return LocalZone(
            self.inclusion,
            tuple(local(vertex) for vertex in self.vertices_deg),
            None if self.centre_deg is None else local(self.centre_deg),
            self.radius_m,
            altitude(self.min_height_m),
            altitude(self.max_height_m),
        )


class LocalZone(NamedTuple):
    """A zone in the local frame: north and east [m], heights above mean sea level [m]."""

    inclusion: bool
    vertices_m: tuple[tuple[float, float], ...]
    centre_m: tuple[float, float] | None
    radius_m: float | None
    min_altitude_m: float | None
    max_altitude_m: float | None


class LocalFence(NamedTuple):
    """All zones in force. `any_inclusion`: inside one of the inclusion zones is enough, not inside all."""

    zones: tuple[LocalZone, ...]
    margin_m: float
    any_inclusion: bool
