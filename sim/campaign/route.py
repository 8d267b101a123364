"""The mission of an encounter: an endless line, legs of 3 km with slopes and corners, or a path's legs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.model import Vec3
from sim.encounters import Encounter, Path
from sim.encounters.encounter import passing
from sim.path import off_leg

Array = NDArray[np.floating]

# No flight reaches the end of the last leg.
_ENDLESS_M = 50_000.0
_LEG_M = 3000.0
_LEGS_AFTER = 4
# Of a leg, in shares of its length: where the aircraft meets the intruder.
_MEETS = (0.15, 0.95)
_CORNERS_DEG = (0.0, 30.0, 60.0, 90.0, 120.0)
# Change of height along a leg, and the lowest height; half of the legs are level.
_SLOPES_M = (-100.0, 100.0)
_LOWEST_M = 100.0
# Legs follow a path within this distance; differences of height count for more. The first leg is that long.
_WITHIN_M, _HEIGHTS_COUNT = 20.0, 2.5
_LEADS_M = 2000.0


@dataclass(frozen=True)
class Route:
    """Places north-east-down [m], in order; at the start the aircraft flies from the first to the second."""

    places_m: tuple[Vec3, ...]

    def leg(self, number: int) -> tuple[Vec3, Vec3]:
        """The leg to the place of that number, from the one before."""
        return self.places_m[number - 1], self.places_m[number]

    def off_m(self, own_m: Array) -> Array:
        """Distances of own places (n, 3) from the nearest leg, sideways and in height above it, (n, 2)."""
        best = np.full(len(own_m), np.inf)
        off = np.zeros((len(own_m), 2))
        for start_m, end_m in zip(self.places_m, self.places_m[1:], strict=False):
            aside, above, beyond = off_leg(start_m, end_m, own_m)
            away = np.hypot(aside, beyond)
            nearer = away < best
            best = np.where(nearer, away, best)
            off[nearer] = np.column_stack([away, above])[nearer]
        return off


def straight(encounter: Encounter) -> Route:
    """The encounter's own straight level line."""
    start_m = encounter.own_position_m
    return Route((start_m, _beyond(start_m, encounter.own_course_rad, _ENDLESS_M, 0.0)))


def legs(encounter: Encounter, seed: int, number: int) -> Route:
    """Legs of 3 km: the first intruder is met within one, at the encounter's height; corners follow it.

    Before that leg the line is straight, so that the encounter begins as it was made, but slopes too.
    """
    rng = np.random.default_rng([seed, number, 3000])
    course_rad, speed_mps = encounter.own_course_rad, encounter.own_airspeed_mps
    meets_s = passing(
        encounter.own_position_m, encounter.own_velocity_mps, encounter.intruders[0], encounter.duration_s
    ).time_s
    share = float(rng.uniform(*_MEETS))
    rise_m = _rise(rng, -encounter.own_position_m[2])
    flown_m = speed_mps * meets_s
    met_m = _beyond(encounter.own_position_m, course_rad, flown_m, 0.0)
    corner_m = _beyond(met_m, course_rad, (1.0 - share) * _LEG_M, (1.0 - share) * rise_m)
    start_m = _beyond(met_m, course_rad, -share * _LEG_M, -share * rise_m)
    places = [start_m, corner_m]
    if share * _LEG_M < flown_m + _BEFORE_M:
        # The aircraft begins on the leg before, level at the height where this one begins.
        places.insert(0, _beyond(start_m, course_rad, -max(flown_m, _LEG_M) - _BEFORE_M, 0.0))
    for _ in range(_LEGS_AFTER):
        course_rad += math.radians(float(rng.choice(_CORNERS_DEG)) * float(rng.choice([-1.0, 1.0])))
        places.append(_beyond(places[-1], course_rad, _LEG_M, _rise(rng, -places[-1][2])))
    places.append(_beyond(places[-1], course_rad, _ENDLESS_M, 0.0))
    return Route(tuple(places))


# The flight begins this long before the encounter, for the engine to read the mission.
_BEFORE_M = 500.0


def _rise(rng: np.random.Generator, height_m: float) -> float:
    """Change of height along a leg that begins at this height."""
    rise_m = float(rng.uniform(*_SLOPES_M))
    level = bool(rng.random() < 0.5) or height_m + rise_m < _LOWEST_M or height_m - rise_m < _LOWEST_M
    return 0.0 if level else rise_m


def start_of(encounter: Encounter, route: Route, before_s: float) -> Vec3:
    """The place on the route `before_s` before the encounter begins."""
    back_m = -before_s * encounter.own_airspeed_mps
    place_m = _beyond(encounter.own_position_m, encounter.own_course_rad, back_m, 0.0)
    for number in range(1, len(route.places_m)):
        _, above, beyond = off_leg(*route.leg(number), np.array([place_m]))
        if beyond[0] == 0.0:
            return place_m[0], place_m[1], place_m[2] + float(above[0])
    return place_m


def _beyond(start_m: Vec3, course_rad: float, length_m: float, rise_m: float) -> Vec3:
    north_m, east_m, down_m = start_m
    return (
        north_m + length_m * math.cos(course_rad),
        east_m + length_m * math.sin(course_rad),
        down_m - rise_m,
    )


def along(path: Path) -> Route:
    """Legs between the corners of a path, the first and the last straight on beyond its ends and level."""
    corners_m = path.position_m[_corners(path.position_m * (1.0, 1.0, _HEIGHTS_COUNT))]
    first_m = _level(corners_m[0], corners_m[0] - corners_m[1], _LEADS_M)
    last_m = _level(corners_m[-1], corners_m[-1] - corners_m[-2], _ENDLESS_M)
    places = [first_m, *corners_m, last_m]
    return Route(tuple((float(north), float(east), float(down)) for north, east, down in places))


def _level(from_m: Array, towards_m: Array, length_m: float) -> Array:
    along = towards_m[:2] / max(float(np.hypot(*towards_m[:2])), 1e-6)
    return np.array([*(from_m[:2] + length_m * along), from_m[2]])


def _corners(places_m: Array) -> list[int]:
    """The places that a polyline within `_WITHIN_M` needs, by Douglas and Peucker."""
    needed, pieces = {0, len(places_m) - 1}, [(0, len(places_m) - 1)]
    while pieces:
        begin, end = pieces.pop()
        if end - begin < 2:
            continue
        chord_m, off_m = places_m[end] - places_m[begin], places_m[begin + 1 : end] - places_m[begin]
        along = np.clip(off_m @ chord_m / max(float(chord_m @ chord_m), 1e-9), 0.0, 1.0)
        away_m = np.linalg.norm(off_m - along[:, None] * chord_m, axis=1)
        if away_m.max() > _WITHIN_M:
            middle = begin + 1 + int(np.argmax(away_m))
            needed.add(middle)
            pieces += [(begin, middle), (middle, end)]
    return sorted(needed)
