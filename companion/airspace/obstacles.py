"""Fixed obstacles from files: masts, power lines, built-up areas.

The avoidance keeps clear of upright cylinders. Lines and areas become rows of cylinders, so close that no gap
remains between them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import LatLon, Track, TrafficKind

# Obstacles do not move, so their tracks are updated less often than decisions are made.
_UPDATE_INTERVAL_S = 1.0


@dataclass(frozen=True, slots=True)
class ObstacleParams:
    """Distance to keep from obstacles, and how many of them to consider."""

    # Kept in addition to each obstacle's radius: its position and ours are uncertain by some metres.
    margin_m: Annotated[float, Gt(0)] = 100.0
    # Without the ground's altitude the obstacle is assumed to stand at home's altitude, with this error.
    ground_uncertainty_m: Annotated[float, Ge(0)] = 30.0
    # Obstacles further away are ignored.
    reach_m: Annotated[float, Gt(0)] = 30_000.0
    # At most this many are considered, the nearest first: each adds to the time of a decision.
    max_obstacles: Annotated[int, Ge(1)] = 1_000


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An upright cylinder, its top given either above mean sea level (`top_amsl_m`) or above ground."""

    name: str
    lat_deg: float
    lon_deg: float
    radius_m: float
    top_amsl_m: float | None
    height_m: float | None

    def __post_init__(self) -> None:
        if (self.top_amsl_m is None) is (self.height_m is None):
            raise ValueError("an obstacle has either a top above sea level or a height above ground")


class ObstacleMap:
    """All obstacles, and the tracks of those near the local frame's origin.

    The frame moves along with the aircraft, so obstacles near its origin are near the aircraft.
    """

    def __init__(self, obstacles: Sequence[Obstacle], params: ObstacleParams | None = None) -> None:
        self._params = params or ObstacleParams()
        self._obstacles = obstacles
        self._lat_deg = np.array([obstacle.lat_deg for obstacle in obstacles])
        self._lon_deg = np.array([obstacle.lon_deg for obstacle in obstacles])
        self._frame: LocalFrame | None = None
        self._nearest: list[int] = []
        self._updated_s = -math.inf
        self._home_m: float | None = None
        self._tracks: tuple[Track, ...] = ()

    def tracks(self, now_s: float, frame: LocalFrame, home_altitude_m: float | None) -> tuple[Track, ...]:
        """Tracks of the nearest obstacles in the local frame, up to a second old.

        While home is unknown, obstacles that only have a height above ground are left out.
        """
        if not self._obstacles:
            return ()
        home_m = None if home_altitude_m is None else float(round(home_altitude_m))
        moved = frame != self._frame
        if moved:
            self._frame, self._nearest = frame, self._find_nearest(frame)
        if moved or home_m != self._home_m or not 0.0 <= now_s - self._updated_s < _UPDATE_INTERVAL_S:
            self._updated_s, self._home_m = now_s, home_m
            self._tracks = tuple(self._tracks_of_nearest(now_s, frame, home_m))
        return self._tracks

    def _find_nearest(self, frame: LocalFrame) -> list[int]:
        """Indices of the obstacles within reach, in ascending order."""
        north_m_per_deg, east_m_per_deg, _ = frame.to_ned_m(
            GeoPoint(frame.lat_deg + 1.0, frame.lon_deg + 1.0, 0.0)  # the frame is linear in degrees
        )
        north_m = (self._lat_deg - frame.lat_deg) * north_m_per_deg
        east_m = ((self._lon_deg - frame.lon_deg + 180.0) % 360.0 - 180.0) * east_m_per_deg
        distance_m = np.hypot(north_m, east_m)
        (within_reach,) = np.nonzero(distance_m <= self._params.reach_m)
        by_distance = within_reach[np.argsort(distance_m[within_reach], kind="stable")]
        return sorted(by_distance[: self._params.max_obstacles].tolist())

    def _tracks_of_nearest(self, now_s: float, frame: LocalFrame, home_m: float | None) -> Iterator[Track]:
        for index in self._nearest:
            obstacle = self._obstacles[index]
            top_m, uncertainty_m = obstacle.top_amsl_m, 0.0
            if top_m is None:
                if home_m is None:
                    continue
                top_m = home_m + (obstacle.height_m or 0.0)
                uncertainty_m = self._params.ground_uncertainty_m
            yield Track(
                f"OBS-{index:05d}",
                now_s,
                frame.to_ned_m(GeoPoint(obstacle.lat_deg, obstacle.lon_deg, top_m)),
                (0.0, 0.0, 0.0),
                callsign=obstacle.name,
                kind=TrafficKind.OBSTACLE,
                protected_horizontal_m=obstacle.radius_m + self._params.margin_m,
                vertical_uncertainty_m=uncertainty_m,
            )


def along(line: Sequence[LatLon], spacing_m: float) -> Iterator[LatLon]:
    """Points along a line at most `spacing_m` apart, including its corners.

    Lines are straight in latitude and longitude (RFC 7946, §3.1.1).
    """
    yield line[0]
    for (lat_deg, lon_deg), (to_lat_deg, to_lon_deg) in pairwise(line):
        middle = LocalFrame((lat_deg + to_lat_deg) / 2.0, lon_deg)
        north_m, _, _ = middle.to_ned_m(GeoPoint(to_lat_deg, to_lon_deg, 0.0))
        from_north_m, _, _ = middle.to_ned_m(GeoPoint(lat_deg, lon_deg, 0.0))
        # At the latitude nearest to the equator a degree of longitude is longest.
        widest = LocalFrame(min(lat_deg, to_lat_deg, key=abs), lon_deg)
        _, east_m, _ = widest.to_ned_m(GeoPoint(to_lat_deg, to_lon_deg, 0.0))
        pieces = max(math.ceil(math.hypot(north_m - from_north_m, east_m) / spacing_m), 1)
        dlon_deg = (to_lon_deg - lon_deg + 180.0) % 360.0 - 180.0
        for piece in range(1, pieces + 1):
            share = piece / pieces
            east_deg = lon_deg + dlon_deg * share
            yield lat_deg + (to_lat_deg - lat_deg) * share, (east_deg + 180.0) % 360.0 - 180.0


def within(rings: Sequence[Sequence[LatLon]], spacing_m: float) -> Iterator[LatLon]:
    """Points of a grid inside an area, `spacing_m` apart; inner rings are holes (even-odd rule)."""
    frame = LocalFrame(*rings[0][0])
    corners = [
        np.array([frame.to_ned_m(GeoPoint(lat_deg, lon_deg, 0.0))[:2] for lat_deg, lon_deg in ring])
        for ring in rings
    ]
    low, high = corners[0].min(axis=0), corners[0].max(axis=0)
    east_m = np.arange(low[1] + spacing_m / 2.0, high[1], spacing_m)
    for north_m in np.arange(low[0] + spacing_m / 2.0, high[0], spacing_m):
        inside = np.zeros(len(east_m), dtype=np.bool_)
        for ring in corners:
            inside ^= _is_inside_ring(ring, float(north_m), east_m)
        for east in east_m[inside]:
            place = frame.to_geo(float(north_m), float(east), 0.0)
            yield place.lat_deg, place.lon_deg


def _is_inside_ring(
    ring: NDArray[np.float64], north_m: float, east_m: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether each place lies inside: a ray to the east crosses the ring an odd number of times."""
    inside = np.zeros(len(east_m), dtype=np.bool_)
    ends = np.roll(ring, -1, axis=0)
    crossed = (ring[:, 0] > north_m) != (ends[:, 0] > north_m)
    for (from_north, from_east), (to_north, to_east) in zip(ring[crossed], ends[crossed], strict=True):
        at_east = from_east + (to_east - from_east) * (north_m - from_north) / (to_north - from_north)
        inside ^= east_m < at_east
    return inside
