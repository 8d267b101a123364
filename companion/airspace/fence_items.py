"""A fence as it comes over the mission protocol: its items put together to zones."""

from collections.abc import Iterable, Sequence

from companion.airspace.fence_zones import FenceZone
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import MissionItem

_POLYGONS = {
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True,
    mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False,
}


def zones_of(items: Sequence[MissionItem]) -> tuple[tuple[FenceZone, ...], int]:
    """The zones, and how many items make none: incomplete polygons, places off the globe.

    The vertices of a polygon follow each other, and each says in its first parameter how many they are
    (https://mavlink.io/en/services/mission.html#geofence-plan). Return points are no zones.
    """
    zones: list[FenceZone] = []
    useless = 0
    at = 0
    while at < len(items):
        item = items[at]
        used = 1
        if item.command in _POLYGONS:
            corners = items[at : at + _corners(item)]
            whole = len(corners) == _corners(item) and all(_belongs(corner, item) for corner in corners)
            used = len(corners) if whole else 1
            zone = _polygon(corners) if whole else None
            useless += 0 if zone else used
            zones += [zone] if zone else []
        elif item.command in _CIRCLES:
            circle = _circle(item)
            useless += circle is None
            zones += [circle] if circle else []
        at += used
    return tuple(zones), useless


def _corners(item: MissionItem) -> int:
    return max(int(item.params[0] or 0), 1)


def _belongs(corner: MissionItem, first: MissionItem) -> bool:
    return corner.command == first.command and corner.params[0] == first.params[0]


def _polygon(corners: Iterable[MissionItem]) -> FenceZone | None:
    items = list(corners)
    places = tuple((c.lat_deg, c.lon_deg) for c in items if c.lat_deg is not None and c.lon_deg is not None)
    if len(places) < len(items):
        return None
    try:
        return FenceZone(_POLYGONS[items[0].command], vertices_deg=places)
    except ValueError:
        return None


def _circle(item: MissionItem) -> FenceZone | None:
    if item.lat_deg is None or item.lon_deg is None or item.params[0] is None:
        return None
    try:
        return FenceZone(
            _CIRCLES[item.command], centre_deg=(item.lat_deg, item.lon_deg), radius_m=item.params[0]
        )
    except ValueError:
        return None
