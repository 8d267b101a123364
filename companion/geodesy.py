"""Geographic positions, the local north-east-down frame in which decisions are made, and directions in it."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

# WGS 84
_SEMI_MAJOR_AXIS_M = 6_378_137.0
_ECCENTRICITY_SQUARED = 6.694_379_990_14e-3


class GeoPoint(NamedTuple):
    """A place: latitude and longitude [deg], height above mean sea level [m]."""

    lat_deg: float
    lon_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class LocalFrame:
    """A flat north-east-down frame touching the ellipsoid; down is minus the height above mean sea level.

    Lengths use the ellipsoid's two radii of curvature at the origin. Ten kilometres away the error of a
    distance is below 0.2 % at 60 degrees of latitude, so the engine moves the frame along with the aircraft.
    """

    lat_deg: float
    lon_deg: float

    @property
    def metres_per_degree(self) -> tuple[float, float]:
        """Length of a degree of latitude and of longitude [m], the same everywhere in the frame."""
        return _metres_per_degree(self.lat_deg)

    def to_ned_m(self, point: GeoPoint) -> tuple[float, float, float]:
        """North, east and down of a place [m]."""
        return *self.to_north_east_m(point.lat_deg, point.lon_deg), -point.altitude_m

    def to_north_east_m(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        """North and east of a latitude and longitude [m]."""
        north_m_per_deg, east_m_per_deg = _metres_per_degree(self.lat_deg)
        dlon_deg = (lon_deg - self.lon_deg + 180.0) % 360.0 - 180.0  # shorter way across the date line
        return (lat_deg - self.lat_deg) * north_m_per_deg, dlon_deg * east_m_per_deg

    def to_geo(self, north_m: float, east_m: float, down_m: float) -> GeoPoint:
        """The place at the given north, east and down [m]: the inverse of `to_ned_m`."""
        north_m_per_deg, east_m_per_deg = _metres_per_degree(self.lat_deg)
        lon_deg = self.lon_deg + east_m / east_m_per_deg
        return GeoPoint(self.lat_deg + north_m / north_m_per_deg, (lon_deg + 180.0) % 360.0 - 180.0, -down_m)


# Frames are few (the local one, and one for each aircraft heard); positions in them are many.
@lru_cache(maxsize=256)
def _metres_per_degree(lat_deg: float) -> tuple[float, float]:
    """Length of a degree of latitude and of longitude at a latitude [m]."""
    lat_rad = math.radians(lat_deg)
    w2 = 1.0 - _ECCENTRICITY_SQUARED * math.sin(lat_rad) ** 2
    meridian_m = _SEMI_MAJOR_AXIS_M * (1.0 - _ECCENTRICITY_SQUARED) / w2**1.5
    # At a pole the length is 0; a metre keeps the frame invertible.
    parallel_m = max(_SEMI_MAJOR_AXIS_M / math.sqrt(w2) * math.cos(lat_rad), 1.0)
    return math.radians(meridian_m), math.radians(parallel_m)


def wrap_pi(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def wrap_two_pi(angle_rad: float) -> float:
    """The same angle in [0, 2 pi)."""
    wrapped = angle_rad % (2.0 * math.pi)
    return 0.0 if wrapped >= 2.0 * math.pi else wrapped  # a tiny negative angle rounds up to 2 pi itself


def course_deg(angle_rad: float) -> float:
    """A course in degrees clockwise from true north, in [0, 360), for people and messages."""
    degrees = math.degrees(wrap_two_pi(angle_rad))
    return 0.0 if degrees >= 360.0 else degrees
