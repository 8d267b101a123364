"""The mission of a flight test, as items for the autopilot and as legs for the judge."""

import math
from collections.abc import Sequence

from companion.geodesy import GeoPoint, LocalFrame, wrap_pi
from sim.flight_test.judge import AT_HEIGHT_M, ON_LEG_M, Leg
from sim.flight_test.observer import Observer
from sim.scenario import MissionPlan
from sim.vehicle import MissionItem
from sim.vehicle.mission import (
    ABSOLUTE_FRAMES,
    DO_JUMP,
    LOITERS,
    NAV_LAND,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    NAV_WAYPOINT,
    home_item,
)

_RELATIVE_FRAME, _NO_FRAME = 3, 2  # MAV_FRAME_MISSION for items that are no places
# PX4 flies its take-off to a place; this far ahead on the way to the first waypoint.
_TAKE_OFF_AHEAD_M = 300.0
_ALIGNED_RAD = math.radians(10.0)
_PLACES = LOITERS | {NAV_WAYPOINT, NAV_LAND}


def items_of(plan: MissionPlan, home: GeoPoint, autopilot: str) -> list[MissionItem]:
    """The items to upload: take-off, waypoints, return home; ArduPilot's list begins with home."""
    frame = LocalFrame(home.lat_deg, home.lon_deg)
    first = plan.waypoints[0]
    length_m = max((first.north_m**2 + first.east_m**2) ** 0.5, 1.0)
    ahead = frame.to_geo(
        first.north_m * _TAKE_OFF_AHEAD_M / length_m, first.east_m * _TAKE_OFF_AHEAD_M / length_m, 0.0
    )
    takeoff = _item(NAV_TAKEOFF, ahead, plan.takeoff_height_m, pitch_deg=15.0)
    waypoints = [
        _item(NAV_WAYPOINT, frame.to_geo(each.north_m, each.east_m, 0.0), each.height_m)
        for each in plan.waypoints
    ]
    before = [home_item(home)] if autopilot == "ardupilot" else []
    return [*before, takeoff, *waypoints, MissionItem(NAV_RETURN_TO_LAUNCH, frame=_NO_FRAME)]


def _item(command: int, place: GeoPoint, height_m: float, *, pitch_deg: float = 0.0) -> MissionItem:
    return MissionItem(
        command,
        (pitch_deg, 0.0, 0.0, 0.0),
        round(place.lat_deg * 1e7),
        round(place.lon_deg * 1e7),
        height_m,
        _RELATIVE_FRAME,
    )


def legs_of(items: Sequence[MissionItem], home: GeoPoint, autopilot: str) -> dict[int, Leg]:
    """The leg to each item that is a place, from the place before it (home before the first)."""
    legs, before = {}, home
    first = 1 if autopilot == "ardupilot" else 0  # its item 0 is home
    for number, item in enumerate(items):
        if number < first or item.command not in _PLACES or (item.lat_e7 == 0 and item.lon_e7 == 0):
            continue
        altitude_m = item.altitude_m + (0.0 if item.frame in ABSOLUTE_FRAMES else home.altitude_m)
        place = GeoPoint(item.lat_e7 / 1e7, item.lon_e7 / 1e7, altitude_m)
        legs[number] = Leg(before, place)
        before = place
    return legs


def shifted(items: Sequence[MissionItem], east_m: float) -> list[MissionItem]:
    """The same mission, its places moved to the east: another mission for the autopilot."""
    moved = []
    for item in items:
        if item.command not in _PLACES or item.frame in ABSOLUTE_FRAMES:
            moved.append(item)
            continue
        frame = LocalFrame(item.lat_e7 / 1e7, item.lon_e7 / 1e7)
        place = frame.to_geo(0.0, east_m, 0.0)
        moved.append(
            MissionItem(
                item.command, item.params, round(place.lat_deg * 1e7), round(place.lon_deg * 1e7),
                item.altitude_m, item.frame, item.autocontinue,
            )
        )  # fmt: skip
    return moved


def with_waypoint(items: Sequence[MissionItem], number: int, place: GeoPoint) -> list[MissionItem]:
    """The mission with one more waypoint, which becomes the item of that number."""
    lat_e7, lon_e7 = round(place.lat_deg * 1e7), round(place.lon_deg * 1e7)
    waypoint = MissionItem(NAV_WAYPOINT, (0.0, 0.0, 0.0, 0.0), lat_e7, lon_e7, place.altitude_m, 0)
    return [*items[:number], waypoint, *items[number:]]


class MissionFlown:
    """The mission in the vehicle, and where the aircraft is on it."""

    def __init__(
        self, items: Sequence[MissionItem], home: GeoPoint, observer: Observer, *, flown_before: bool = False
    ) -> None:
        """`flown_before`: the aircraft was flying this mission before the test."""
        self.flown_before = flown_before
        self._home, self._observer = home, observer
        self.original = list(items)
        self.replace(items)

    def replace(self, items: Sequence[MissionItem]) -> None:
        """Another mission was uploaded."""
        self.items = list(items)
        self._legs = legs_of(items, self._home, self._observer.name)

    @property
    def can_be_changed(self) -> bool:
        """Whether an item may be added: jumps would lead elsewhere."""
        return all(item.command != DO_JUMP for item in self.items)

    def original_number(self, number: int) -> int:
        """The item of the original mission that leads to the same place as an item of the present one."""
        return max(number - (len(self.items) - len(self.original)), 0)

    @property
    def leg(self) -> Leg | None:
        """The leg to the present item; `None` when it has no place."""
        sequence = self._observer.sequence
        return None if sequence is None else self._legs.get(sequence)

    @property
    def can_begin(self) -> bool:
        """Whether encounters may begin on the present leg: not on that of the take-off, if there are more."""
        first = next(iter(self._legs.values()), None) if len(self._legs) > 1 else None
        return self.leg is not None and self.leg is not first

    def off_leg_m(self) -> tuple[float, float]:
        """How far the aircraft is from its leg now, sideways and above it."""
        sample, leg = self._observer.sample, self.leg
        assert sample is not None
        return (math.inf, math.inf) if leg is None else leg.off_m(sample.place)

    @property
    def is_on_leg(self) -> bool:
        """Whether the aircraft is on its leg and at its height."""
        aside_m, above_m = self.off_leg_m()
        return aside_m <= ON_LEG_M and abs(above_m) <= AT_HEIGHT_M

    @property
    def is_settled(self) -> bool:
        """Whether the aircraft flies its mission along a leg on which encounters may begin."""
        sample, leg = self._observer.sample, self.leg
        if sample is None or leg is None or not (self._observer.on_mission and self.can_begin):
            return False
        course_rad = math.atan2(sample.velocity_mps[1], sample.velocity_mps[0])
        return self.is_on_leg and abs(wrap_pi(course_rad - leg.course_rad)) < _ALIGNED_RAD
