"""The mission as read from the autopilot: the places it leads to, its take-offs and landings."""

from bisect import bisect_left
from collections.abc import Sequence

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import HeightAbove, MissionItem

_TAKE_OFFS = frozenset({mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_VTOL_TAKEOFF})
_LANDINGS = frozenset(
    {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_VTOL_LAND, mavlink.MAV_CMD_NAV_PAYLOAD_PLACE}
)
_RADIUS_PARAMETER = {
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: 2,
    mavlink.MAV_CMD_NAV_LOITER_TURNS: 2,
    mavlink.MAV_CMD_NAV_LOITER_TIME: 2,
    mavlink.MAV_CMD_NAV_LOITER_TO_ALT: 1,
}
# Between these a leg is a straight line; from and to a spline it is a curve.
_STRAIGHT = frozenset({mavlink.MAV_CMD_NAV_WAYPOINT, *_RADIUS_PARAMETER})
# A loiter with this fourth parameter is left on the line from where the circle is left, not from its centre.
_FROM_CIRCLE = 1.0
_FOR_EVER = -1
# Navigation items are flown to; all others are executed on the way.
_LAST_NAVIGATION = mavlink.MAV_CMD_NAV_LAST
_NOT_FLOWN_TO = frozenset({mavlink.MAV_CMD_NAV_DELAY, mavlink.MAV_CMD_NAV_GUIDED_ENABLE})


def loiter_radius_m(item: MissionItem) -> float | None:
    """Radius of the circle at an item, negative to the left, 0 for the usual one; `None` without a circle."""
    parameter = _RADIUS_PARAMETER.get(item.command)
    return None if parameter is None else item.params[parameter] or 0.0


def _is_flown_to(item: MissionItem) -> bool:
    return item.command <= _LAST_NAVIGATION and item.command not in _NOT_FLOWN_TO


def is_straight(item: MissionItem) -> bool:
    """Whether the item is flown to in a straight line."""
    return item.command in _STRAIGHT


class Mission:
    """The items in their order; a `sequence` is an item's number at the autopilot."""

    def __init__(self, items: Sequence[MissionItem]) -> None:
        self.items = tuple(items)
        # Both are asked for several times a tick.
        self._flown_to = [at for at, item in enumerate(self.items) if _is_flown_to(item)]
        self._near_ground = frozenset(at for at in self._flown_to if self._takes_off_or_lands(at))

    def taking_off_or_landing(self, sequence: int) -> bool:
        """Whether this item is a take-off, a landing, or part of an approach.

        An approach begins at DO_LAND_START and ends with the landing.
        """
        return self._navigation(sequence) in self._near_ground

    def _takes_off_or_lands(self, at: int) -> bool:
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
        found = [(at, self._place(self.items[at], home_altitude_m)) for at in self._flown_to]
        return [(at, place) for at, place in found if place is not None]

    def flown_to(self, sequence: int) -> MissionItem | None:
        """The item that is flown to while this one is current: it, or the next after those executed."""
        at = self._navigation(sequence)
        return None if at is None else self.items[at]

    def leg_starts_at(self, previous: int, home_altitude_m: float | None) -> GeoPoint | None:
        """Where the leg begins that follows this item; `None` if it is unknown, as after a take-off."""
        item = self.flown_to(previous)
        if item is None or item.command not in _STRAIGHT:
            return None
        if item.command in _RADIUS_PARAMETER and item.params[3] == _FROM_CIRCLE:
            return None
        return self._place(item, home_altitude_m)

    def came_from(self, sequence: int) -> list[int]:
        """The items that may have been flown before this one, the most likely first.

        That is the one before it in the list, and those before each DO_JUMP that leads to it.
        """
        at = self._navigation(sequence)
        if at is None:
            return []
        before = [self._navigation_before(at)]
        for jump, item in enumerate(self.items):
            target, count = item.params[0], item.params[1]
            if item.command != mavlink.MAV_CMD_DO_JUMP or target is None or not count:
                continue
            if self._navigation(int(target)) == at:
                before.append(self._navigation_before(jump))
        return list(dict.fromkeys(found for found in before if found is not None))

    def goes_on_to(self, sequence: int) -> int | None:
        """The item that is flown to after this one; `None` at the end, and at a jump of unknown count."""
        at = self._navigation(sequence)
        for place in range(len(self.items) if at is None else at + 1, len(self.items)):
            item = self.items[place]
            if item.command == mavlink.MAV_CMD_DO_JUMP:
                endless = item.params[1] == _FOR_EVER and item.params[0] is not None
                return self._navigation(int(item.params[0] or 0.0)) if endless else None
            if _is_flown_to(item):
                return place
        return None

    def speed_changes(self, sequence: int) -> list[MissionItem]:
        """The DO_CHANGE_SPEED items of an airspeed before this item, the last first.

        With a jump in the mission, those after the item may have been executed too, and follow.
        """
        at = self._navigation(sequence)
        changes = [
            (place, item)
            for place, item in enumerate(self.items)
            if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED
            and item.params[0] == 0.0
            and (item.params[1] or 0.0) > 0.0
        ]
        jumps = any(item.command == mavlink.MAV_CMD_DO_JUMP for item in self.items)
        before = [item for place, item in changes if at is not None and place < at]
        after = [item for place, item in changes if at is not None and place > at and jumps]
        return [*reversed(before), *reversed(after)]

    def _navigation_before(self, at: int) -> int | None:
        """The index of the last item before `at` that is flown to; `None` if an endless jump is between."""
        for place in range(at - 1, -1, -1):
            item = self.items[place]
            if item.command == mavlink.MAV_CMD_DO_JUMP and item.params[1] == _FOR_EVER:
                return None
            if _is_flown_to(item):
                return place
        return None

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
        place = bisect_left(self._flown_to, sequence)
        return self._flown_to[place] if place < len(self._flown_to) else None
