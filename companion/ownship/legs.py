"""The leg of the mission that is flown: from the item flown before, or from where the mission was entered.

Both autopilots begin a new straight line, sideways and in height, where the mission's mode is entered or
another item is selected. So there are two answers: the line that the autopilot flies now, and the leg between
the items, where the aircraft belongs.
"""

import math
from dataclasses import dataclass, replace

from companion.avoidance.leg import BesideLeg, beside_leg
from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import MissionItem
from companion.model import Goal
from companion.ownship.mission import Mission, is_straight, loiter_radius_m

# An item counts as passed if the next one became current this near to it, or within its acceptance radius.
_PASSED_M = 400.0
_ACCEPTANCES = 1.5
# A leg between items counts as flown only if the aircraft is this near to it.
_ASIDE_M, _BEFORE_M, _BEYOND_M, _HEIGHT_M = 150.0, 400.0, 200.0, 60.0


@dataclass(frozen=True, slots=True)
class Leg:
    """The way to the mission's item `sequence`, at the place `end`; heights are above mean sea level [m].

    Without a `start` the leg is unknown: then the straight way to the end, at its height. An item with
    a `loiter_radius_m` (see `mission.loiter_radius_m`) is circled.
    """

    sequence: int
    end: GeoPoint
    start: GeoPoint | None = None
    acceptance_m: float = 0.0
    loiter_radius_m: float | None = None
    then: GeoPoint | None = None  # where the next leg leads to, if that is known

    def goal(self, frame: LocalFrame, goal: Goal) -> Goal:
        """The goal of flying this leg, in a local frame; airspeed as in `goal`."""
        return replace(
            goal,
            position_m=frame.to_ned_m(self.end),
            altitude_m=self.end.altitude_m,
            leg_from_m=None if self.start is None else frame.to_ned_m(self.start),
            loiter_radius_m=self.loiter_radius_m,
            then_m=None if self.then is None else frame.to_ned_m(self.then),
            height_is_known=True,
        )

    def straight(self) -> "Leg":
        """The straight way to the same end, from anywhere."""
        return replace(self, start=None)

    def beside(self, place: GeoPoint) -> BesideLeg | None:
        """A place relative to the leg; `None` if its start is unknown."""
        if self.start is None:
            return None
        frame = LocalFrame(place.lat_deg, place.lon_deg)
        return beside_leg(frame.to_ned_m(self.start), frame.to_ned_m(self.end), frame.to_ned_m(place))

    def is_near(self, place: GeoPoint) -> bool:
        """Whether an aircraft at this place may be flying the leg."""
        beside = self.beside(place)
        if beside is None:
            return False
        along = -_BEYOND_M <= beside.to_go_m <= beside.length_m + _BEFORE_M
        near = abs(beside.aside_m) <= _ASIDE_M and abs(place.altitude_m - beside.altitude_m) <= _HEIGHT_M
        return along and near


class Legs:
    """Remembers which item was flown before the present one, and where the present line began."""

    def __init__(self) -> None:
        self.first = 0  # the first item that is flown: ArduPilot's item 0 is home
        self.mission: Mission | None = None  # the last one that was known
        self._previous: int | None = None
        self._began: GeoPoint | None = None
        self._entered = False  # the line began where the mission was entered, or another item was selected

    def item_changed(self, before: int | None, place: GeoPoint | None, *, flown: bool) -> None:
        """Another item became current. `flown`: the autopilot flies the mission, and we do not fly."""
        self._previous = before if flown else None
        self._began, self._entered = place if flown else None, False

    def entered(self, place: GeoPoint | None) -> None:
        """The mission's mode was entered at this place."""
        self._began, self._entered = place, True

    def learn(self, mission: Mission | None, place: GeoPoint | None, *, flown: bool) -> None:
        """Take in the mission; with other items than before, the memory of the former one is dropped."""
        if mission is None or mission is self.mission:
            return
        if self.mission is not None and not same_items(mission, self.mission):
            self._previous = None
            self._began, self._entered = (place, True) if flown else (None, False)
        self.mission = mission

    def line(
        self, mission: Mission, sequence: int, here: GeoPoint | None, home_m: float | None
    ) -> Leg | None:
        """The line that the autopilot flies now."""
        leg = self.straight_to(mission, sequence, home_m)
        if leg is None or here is None:
            return leg
        if self._entered:
            return replace(leg, start=self._began)
        if self._began is None:
            return self._between_items(leg, mission, here, home_m) or leg
        return replace(leg, start=self._corner(mission, home_m) or self._began)

    def leg(self, mission: Mission, sequence: int, here: GeoPoint | None, home_m: float | None) -> Leg | None:
        """The leg where the aircraft belongs, when it is taken over at the place `here`.

        That is the leg between the items if it is flown, otherwise the line flown now, at its end's height.
        """
        leg = self.straight_to(mission, sequence, home_m)
        item = mission.flown_to(sequence)
        if leg is None or here is None or item is None or not is_straight(item):
            return leg
        between = self._between_items(leg, mission, here, home_m)
        if between is not None or self._began is None:
            return between or leg
        level = GeoPoint(self._began.lat_deg, self._began.lon_deg, leg.end.altitude_m)
        flown = replace(leg, start=level)
        beside = flown.beside(here)
        return flown if beside is not None and abs(beside.aside_m) <= _ASIDE_M else leg

    def _between_items(self, leg: Leg, mission: Mission, here: GeoPoint, home_m: float | None) -> Leg | None:
        """The leg from the item flown before, or from one that may have been, if we are near it."""
        likely = mission.came_from(leg.sequence)
        if self._previous is not None:
            likely = [self._previous, *likely]
        for previous in likely:
            start = None if previous < self.first else mission.leg_starts_at(previous, home_m)
            if start is not None and (found := replace(leg, start=start)).is_near(here):
                return found
        return None

    def straight_to(self, mission: Mission, sequence: int, home_m: float | None) -> Leg | None:
        """The way to an item, its start unknown; `None` without a place, and for take-off and landing."""
        item, end = mission.flown_to(sequence), mission.destination(sequence, home_m)
        if item is None or end is None or sequence < self.first or mission.taking_off_or_landing(sequence):
            return None
        goes_on_to = mission.goes_on_to(sequence)
        then = None if goes_on_to is None else mission.destination(goes_on_to, home_m)
        return Leg(sequence, end, None, _acceptance_m(item), loiter_radius_m(item), then)

    def _corner(self, mission: Mission, home_m: float | None) -> GeoPoint | None:
        """The place of the item flown before, if the present one became current near it."""
        if self._previous is None or self._previous < self.first or self._began is None:
            return None
        corner, item = mission.leg_starts_at(self._previous, home_m), mission.flown_to(self._previous)
        if corner is None or item is None:
            return None
        frame = LocalFrame(corner.lat_deg, corner.lon_deg)
        away_m = math.hypot(*frame.to_ned_m(self._began)[:2])
        return corner if away_m <= max(_PASSED_M, _ACCEPTANCES * _acceptance_m(item)) else None


def same_items(one: Mission, other: Mission) -> bool:
    """Whether two missions have the same items; the address that they were sent to does not count."""
    return len(one.items) == len(other.items) and all(
        replace(a, target=b.target) == b for a, b in zip(one.items, other.items, strict=True)
    )


def _acceptance_m(item: MissionItem) -> float:
    """The acceptance radius of an item; 0 for the autopilot's own, and for a circle."""
    return 0.0 if loiter_radius_m(item) is not None else max(item.params[1] or 0.0, 0.0)
