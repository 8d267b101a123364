"""The mission as read from the autopilot: the places it leads to, its take-offs and landings."""

from collections.abc import Sequence

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import HeightAbove, MissionItem

_TAKE_OFFS = frozenset({mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF})
_LANDINGS = frozenset(
    {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_NAV_PAYLOAD_PLACE}
)
# Navigation items are flown to; all others are executed on the way.
_LAST_NAVIGATION = mavlink.MAV_CMD_NAV_LAST
_NOT_FLOWN_TO = frozenset({mavlink.MAV_CMD_NAV_DELAY, mavlink.MAV_CMD_NAV_GUIDED_ENABLE})


class Mission:
    """The items in their order; a `sequence` is an item's number at the autopilot."""

    def __init__(self, items: Sequence[MissionItem]) -> None:
        self.items = tuple(items)

    def taking_off_or_landing(self, sequence: int) -> bool:
        """Whether this item is a take-off, a landing, or part of an approach.

        An approach begins at DO_LAND_START and ends with the landing.
        """
        at = self._navigation(sequence)
        if at is None:
            return False
        if self.items[at].command in _TAKE_OFFS | _LANDINGS:
            return True
        for item in reversed(self.items[:at]):
            if item.command == mavlink.MAV_CMD_DO_LAND_START:
                return True
            if item.command in _LANDINGS:
                return False
        return False

    def destination(self, sequence: int, home_altitude_m: float | None) -> GeoPoint | None:
        """The place that the item leads to, height above mean sea level; `None` if part of it is unknown."""
        at = self._navigation(sequence)
        return None if at is None else self._place(self.items[at], home_altitude_m)

    def places(self, home_altitude_m: float | None) -> list[tuple[int, GeoPoint]]:
        """All known places that the mission leads to, each with its item's number."""
        found = [
            (at, self._place(item, home_altitude_m))
            for at, item in enumerate(self.items)
            if item.command <= _LAST_NAVIGATION and item.command not in _NOT_FLOWN_TO
        ]
        return [(at, place) for at, place in found if place is not None]

    @staticmethod
    def _place(item: MissionItem, home_altitude_m: float | None) -> GeoPoint | None:
        if item.lat_deg is None or item.lon_deg is None or item.height_m is None:
            return None
        if item.height_above is HeightAbove.SEA:
            return GeoPoint(item.lat_deg, item.lon_deg, item.height_m)
        if item.height_above is HeightAbove.HOME and home_altitude_m is not None:
            return GeoPoint(item.lat_deg, item.lon_deg, home_altitude_m + item.height_m)
        return None

    def _navigation(self, sequence: int) -> int | None:
        """The index of the navigation item that is flown while this item is current: it or a later one."""
        return next(
            (
                at
                for at, item in enumerate(self.items)
                if at >= sequence and item.command <= _LAST_NAVIGATION and item.command not in _NOT_FLOWN_TO
            ),
            None,
        )
