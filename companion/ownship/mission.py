"""The mission as it was read from the autopilot: where it leads, and when it takes off or lands."""

from collections.abc import Sequence

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import HeightAbove, MissionItem

_TAKE_OFFS = frozenset({mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF})
_LANDINGS = frozenset(
    {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_NAV_PAYLOAD_PLACE}
)
# Items that are flown to; all the others are done on the way.
_LAST_NAVIGATION = mavlink.MAV_CMD_NAV_LAST
_NOT_FLOWN_TO = frozenset({mavlink.MAV_CMD_NAV_DELAY, mavlink.MAV_CMD_NAV_GUIDED_ENABLE})


class Mission:
    """The items in their order; `sequence` counts as the autopilot does."""

    def __init__(self, items: Sequence[MissionItem]) -> None:
        self.items = tuple(items)

    def taking_off_or_landing(self, sequence: int) -> bool:
        """Whether this item is a take-off, a landing, or part of the approach to one.

        The approach begins at DO_LAND_START, and ends with the landing.
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
        """Where the item leads to, height above mean sea level; `None` when it does not say both."""
        at = self._navigation(sequence)
        return None if at is None else self._place(self.items[at], home_altitude_m)

    def places(self, home_altitude_m: float | None) -> list[tuple[int, GeoPoint]]:
        """All that is flown to, with its number; without those that do not say where."""
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
        """The index of what is flown to while this item is current: itself, or what follows it."""
        return next(
            (
                at
                for at, item in enumerate(self.items)
                if at >= sequence and item.command <= _LAST_NAVIGATION and item.command not in _NOT_FLOWN_TO
            ),
            None,
        )
