"""Fences: zones on the globe, the autopilot's own fence, and the local fence, floor and ceiling in force."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

from companion.avoidance import Envelope, Fence, Zone
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import MissionItem
from companion.model import LatLon, Vec2

# Own position, wind and the autopilot's course tracking are each known to within this distance.
_MIN_MARGIN_M = 30.0
_MIN_VERTICES = 3
# ArduPilot's bits of FENCE_TYPE and FENCE_OPTIONS
_MAX_ALTITUDE, _CIRCLE, _ZONES, _MIN_ALTITUDE = 1, 2, 4, 8
_UNION_OF_INCLUSIONS = 2

# Whether the zone that an item defines is an inclusion zone.
_POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}


@dataclass(frozen=True, slots=True)
class FenceZone:
    """One zone: a polygon (`vertices_deg`) or a circle (`centre_deg`, `radius_m`), of (lat, lon) [deg].

    Heights are above home; `None`: no limit. The aircraft stays inside a zone with `inclusion`, and outside
    any other. `ValueError` if it is neither a polygon nor a circle, or not on the globe.
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


@dataclass(frozen=True, slots=True)
class FenceSettings:
    """An autopilot's fence parameters; heights are above home, `None`: no such limit.

    `on` is `None` while unknown. With `any_inclusion` it is enough to be inside one of several inclusion
    zones. `zones`: whether the uploaded zones are enforced. `home_radius_m` is the radius of a circle
    around home to stay in.
    """

    on: bool | None = None
    any_inclusion: bool = False
    zones: bool = True
    home_radius_m: float | None = None
    min_height_m: float | None = None
    max_height_m: float | None = None
    margin_m: float = 0.0


class AutopilotFence(NamedTuple):
    """The autopilot's fence as known at present; `home_deg` is `None` until home is known."""

    settings: FenceSettings = FenceSettings()
    zones: tuple[FenceZone, ...] = ()
    home_deg: LatLon | None = None


def ardupilot_fence(values: Mapping[str, float]) -> FenceSettings:
    """Settings from FENCE_* parameters. A parameter that was not answered sets no limit.

    Uploaded zones are enforced unless the parameters exclude them.
    """
    enabled, automatic = values.get("FENCE_ENABLE"), values.get("FENCE_AUTOENABLE")
    on = None if enabled is None else bool(enabled or automatic)
    types = values.get("FENCE_TYPE")
    bits = _ZONES if types is None else _bits(types)
    options = _bits(values.get("FENCE_OPTIONS", 0.0))
    return FenceSettings(
        on=on,
        any_inclusion=bool(options & _UNION_OF_INCLUSIONS),
        zones=bool(bits & _ZONES),
        home_radius_m=_positive(values.get("FENCE_RADIUS")) if bits & _CIRCLE else None,
        min_height_m=values.get("FENCE_ALT_MIN") if bits & _MIN_ALTITUDE else None,
        max_height_m=_positive(values.get("FENCE_ALT_MAX")) if bits & _MAX_ALTITUDE else None,
        margin_m=_positive(values.get("FENCE_MARGIN")) or 0.0,
    )


def px4_fence(values: Mapping[str, float]) -> FenceSettings:
    """Settings from GF_* parameters. PX4 requires one of the inclusion zones; 0 switches a limit off."""
    action = values.get("GF_ACTION")
    return FenceSettings(
        on=None if action is None else action != 0.0,
        any_inclusion=True,
        home_radius_m=_positive(values.get("GF_MAX_HOR_DIST")),
        max_height_m=_positive(values.get("GF_MAX_VER_DIST")),
    )


def _positive(value: float | None) -> float | None:
    return value if value is not None and value > 0.0 else None


def _bits(value: float) -> int:
    return int(value) if 0.0 <= value < 2**31 else 0


def zones_of(items: Sequence[MissionItem]) -> tuple[tuple[FenceZone, ...], int]:
    """The zones, and the number of items that form none: incomplete polygons, places off the globe.

    The vertices of a polygon follow each other, and the first parameter of each is their number
    (https://mavlink.io/en/services/mission.html#geofence-plan). Return points are not zones.
    """
    zones: list[FenceZone] = []
    unusable = 0
    at = 0
    while at < len(items):
        vertices = _polygon_items(items, at)
        used = max(len(vertices), 1)
        if items[at].command in _POLYGONS | _CIRCLES:
            zone = _polygon(vertices) if vertices else _circle(items[at])
            zones += [zone] if zone else []
            unusable += 0 if zone else used
        at += used
    return tuple(zones), unusable


def _polygon_items(items: Sequence[MissionItem], start: int) -> Sequence[MissionItem]:
    """The items of the polygon that starts here; empty when it is incomplete, or this is no polygon."""
    first = items[start]
    if first.command not in _POLYGONS:
        return ()
    count = max(int(first.params[0] or 0), 1)
    vertices = items[start : start + count]
    complete = len(vertices) == count and all(
        vertex.command == first.command and vertex.params[0] == first.params[0] for vertex in vertices
    )
    return vertices if complete else ()


def _polygon(items: Sequence[MissionItem]) -> FenceZone | None:
    places = tuple(
        (item.lat_deg, item.lon_deg)
        for item in items
        if item.lat_deg is not None and item.lon_deg is not None
    )
    if len(places) < len(items):
        return None
    try:
        return FenceZone(_POLYGONS[items[0].command], vertices_deg=places)
    except ValueError:
        return None


def _circle(item: MissionItem) -> FenceZone | None:
    if item.command not in _CIRCLES or item.lat_deg is None or item.lon_deg is None:
        return None
    if item.params[0] is None:
        return None
    try:
        return FenceZone(
            _CIRCLES[item.command], centre_deg=(item.lat_deg, item.lon_deg), radius_m=item.params[0]
        )
    except ValueError:
        return None


def fence_in_force(
    configured: tuple[FenceZone, ...], autopilot: AutopilotFence, frame: LocalFrame, home_altitude_m: float
) -> Fence | None:
    """The configured zones and the autopilot's fence in the local frame; `None` without zones.

    Its margin is the autopilot's, but at least 30 m.
    """
    settings = autopilot.settings
    uploaded = autopilot.zones if settings.zones else ()
    others = [*configured]
    if settings.home_radius_m is not None and autopilot.home_deg is not None:
        others.append(FenceZone(True, centre_deg=autopilot.home_deg, radius_m=settings.home_radius_m))
    any_inclusion = settings.any_inclusion and sum(zone.inclusion for zone in uploaded) > 1
    if any_inclusion and any(zone.inclusion for zone in others):
        # A fence cannot express "inside any of these, and inside that one". The autopilot itself
        # still enforces its own inclusion zones.
        uploaded = tuple(zone for zone in uploaded if not zone.inclusion)
        any_inclusion = False
    zones = tuple(zone.in_frame(frame, home_altitude_m) for zone in (*others, *uploaded))
    if not zones:
        return None
    return Fence(zones, max(settings.margin_m, _MIN_MARGIN_M), any_inclusion=any_inclusion)


class HeightLimits(NamedTuple):
    """`min_height_m` is above home and above the terrain, all others above home; `None`: no such limit."""

    min_height_m: float
    max_height_m: float | None = None
    fence_min_height_m: float | None = None
    fence_max_height_m: float | None = None

    @classmethod
    def within_fence(cls, min_height_m: float, max_height_m: float | None, fence: FenceSettings) -> Self:
        """The given limits with those of the autopilot's fence, inside its margin."""
        low_m, high_m = fence.min_height_m, fence.max_height_m
        return cls(
            min_height_m,
            max_height_m,
            None if low_m is None else low_m + fence.margin_m,
            None if high_m is None else high_m - fence.margin_m,
        )


def limit_heights(
    envelope: Envelope, limits: HeightLimits, home_altitude_m: float, terrain_altitude_m: float | None
) -> Envelope:
    """The envelope with floor and ceiling above mean sea level [m], each the tightest of the known limits.

    Where floor and ceiling cross, the floor takes precedence: the ground is below it.
    """
    floors_m = [home_altitude_m + limits.min_height_m]
    if terrain_altitude_m is not None:
        floors_m.append(terrain_altitude_m + limits.min_height_m)
    if limits.fence_min_height_m is not None:
        floors_m.append(home_altitude_m + limits.fence_min_height_m)
    if envelope.min_altitude_m is not None:
        floors_m.append(envelope.min_altitude_m)
    floor_m = max(floors_m)
    max_heights_m = (limits.max_height_m, limits.fence_max_height_m)
    ceilings_m = [home_altitude_m + height_m for height_m in max_heights_m if height_m is not None]
    if envelope.max_altitude_m is not None:
        ceilings_m.append(envelope.max_altitude_m)
    ceiling_m = max(min(ceilings_m), floor_m) if ceilings_m else None
    return replace(envelope, min_altitude_m=floor_m, max_altitude_m=ceiling_m)
