"""Which reported positions are those of our aircraft: it moves continuously, and is in one place."""

import math
from enum import Enum

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import OwnPosition

# How far a position may be from where the last one leads: a correction of the autopilot's estimate.
_CORRECTION_M, _CORRECTION_HEIGHT_M = 250.0, 120.0
# Acceleration of an aircraft [m/s^2], for the uncertainty after a time without positions.
_ACCELERATION_MPS2 = 10.0
_CLIMB_MPS = 30.0
# A place elsewhere is believed when it has lasted for this long, without any position here.
_MOVED_AFTER_S = 3.0
# After this long without positions the aircraft may be anywhere.
_FORGOTTEN_S = 20.0
# So many changes between two places within this time are two vehicles.
_CHANGES, _CHANGES_WITHIN_S = 4, 6.0


class Place(Enum):
    """What a position is."""

    HERE = "here"
    MOVED = "moved"  # here from now on: the former place was wrong, or this one is
    ELSEWHERE = "elsewhere"  # an outlier so far
    TWO_PLACES = "two places"  # the reports change between two places, as two vehicles would send them


class PositionGate:
    """Judges each position in the order of their times [s]."""

    def __init__(self) -> None:
        self._here: tuple[OwnPosition, float] | None = None
        self._elsewhere: tuple[OwnPosition, float] | None = None
        self._elsewhere_since_s = 0.0
        self._changes_s: list[float] = []

    def judge(self, fact: OwnPosition, at_s: float) -> Place:
        """What the position is that was true at `at_s`."""
        self._changes_s = [one for one in self._changes_s if at_s - one <= _CHANGES_WITHIN_S]
        if self._here is None or not 0.0 <= at_s - self._here[1] <= _FORGOTTEN_S:
            return self._believe(fact, at_s, Place.HERE)
        if _continues(*self._here, fact, at_s):
            if self._elsewhere is not None:
                self._note_change(at_s)
                self._elsewhere = None
            return self._believe(fact, at_s, Place.HERE)
        if self._elsewhere is None or not _continues(*self._elsewhere, fact, at_s):
            self._elsewhere_since_s = at_s
            self._note_change(at_s)
        self._elsewhere = fact, at_s
        if len(self._changes_s) >= _CHANGES:
            return Place.TWO_PLACES
        lasted_s = at_s - self._elsewhere_since_s
        silent_s = at_s - self._here[1]
        if lasted_s >= _MOVED_AFTER_S and silent_s >= _MOVED_AFTER_S:
            self._elsewhere, self._changes_s = None, []
            return self._believe(fact, at_s, Place.MOVED)
        return Place.ELSEWHERE

    def _believe(self, fact: OwnPosition, at_s: float, place: Place) -> Place:
        self._here = fact, at_s
        return place

    def _note_change(self, at_s: float) -> None:
        self._changes_s.append(at_s)


def _continues(before: OwnPosition, before_s: float, fact: OwnPosition, at_s: float) -> bool:
    """Whether one aircraft can have been at both places."""
    frame = LocalFrame(before.lat_deg, before.lon_deg)
    north_m, east_m, _ = frame.to_ned_m(GeoPoint(fact.lat_deg, fact.lon_deg, 0.0))
    passed_s = max(at_s - before_s, 0.0)
    north_m -= 0.5 * (before.velocity_mps[0] + fact.velocity_mps[0]) * passed_s
    east_m -= 0.5 * (before.velocity_mps[1] + fact.velocity_mps[1]) * passed_s
    if math.hypot(north_m, east_m) > _CORRECTION_M + _ACCELERATION_MPS2 * passed_s**2:
        return False
    climbed_m = abs(fact.altitude_m - before.altitude_m)
    return climbed_m <= _CORRECTION_HEIGHT_M + _CLIMB_MPS * passed_s
