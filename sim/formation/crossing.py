"""Random crossings: the missions of some members lead through one small area at nearly the same time."""

import math
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from companion.model import Vec3
from sim.campaign.plane import Limits
from sim.campaign.route import Route
from sim.dynamics import AIRFRAMES
from sim.encounters import Path

Array = NDArray[np.floating]

_AIRSPEEDS_MPS = (20.0, 30.0)
_ENVELOPE_MPS = (16.0, 34.0)
_MEETS_S = (40.0, 60.0)
# The members pass within this distance of the centre, and within this time of the meeting.
_AREA_M, _TIMES_APART_S = 40.0, 2.0
_HEIGHT_M, _HEIGHTS_APART_M = 300.0, 20.0
# The leg through the area begins and ends this far from it; the other legs turn off by up to this angle.
_CORNER_M, _CORNER_RAD = (300.0, 600.0), math.radians(40.0)
_AFTER_M = (700.0, 1200.0)
# Between the ends of different members, so that no arrival excludes another.
_ENDS_APART_M, _STARTS_APART_M = 300.0, 200.0
_ENDLESS_M = 50_000.0
_TRIES = 2000
# A crewed aircraft crosses in this share of the flights.
_STRANGERS = 0.25
_STRANGER_MPS, _STRANGER_HEIGHT_M = (40.0, 60.0), 30.0
# Arrival: within this distance of the last waypoint, in this many times the nominal time plus this many s.
ARRIVED_M, _SLOWEST, _LATEST_S = 60.0, 1.5, 60.0


@dataclass(frozen=True)
class Mission:
    """The mission of one member: its legs, the last of which leads on beyond the last waypoint `end_m`."""

    start_m: Vec3
    airspeed_mps: float
    route: Route
    limits: Limits

    @property
    def end_m(self) -> Vec3:
        """The last waypoint."""
        return self.route.places_m[-2]

    @property
    def length_m(self) -> float:
        """The length of the way from the start to the last waypoint."""
        places = [self.start_m, *self.route.places_m[1:-1]]
        return sum(math.dist(one[:2], other[:2]) for one, other in pairwise(places))

    @property
    def nominal_s(self) -> float:
        """The time of the way without avoidance."""
        return self.length_m / self.airspeed_mps


@dataclass(frozen=True)
class Crossing:
    """The missions of some members that meet at `meets_s`, and the path of a stranger, if any."""

    missions: tuple[Mission, ...]
    meets_s: float
    stranger: Path | None = None

    @property
    def common_s(self) -> float:
        """How long all members are under way without avoidance."""
        return min(mission.nominal_s for mission in self.missions)

    @property
    def latest_s(self) -> float:
        """Until when the members must have arrived."""
        return _SLOWEST * max(mission.nominal_s for mission in self.missions) + _LATEST_S


def crossing(members: int, seed: int, number: int, separation_m: float) -> Crossing:
    """Crossing `number` of a seed: without avoidance, at least one pair fewer than members comes too near.

    It depends on its arguments only. `ValueError` if none is found.
    """
    rng = np.random.default_rng([seed, number, members])
    for _ in range(_TRIES):
        drawn = _draw(members, rng)
        starts, ends = ([one[place] for one in _ends(drawn)] for place in (0, 1))
        spread = _all_apart(starts, _STARTS_APART_M) and _all_apart(ends, _ENDS_APART_M)
        if spread and _pairs_near(drawn, separation_m) >= members - 1:
            return drawn
    raise ValueError(f"no crossing of {members} members in {_TRIES} tries")


def _draw(members: int, rng: np.random.Generator) -> Crossing:
    meets_s = float(rng.uniform(*_MEETS_S))
    # Directions all around, the nearest well apart, as in a formation that converges on a point.
    first_rad = float(rng.uniform(0.0, math.tau))
    directions = [first_rad + math.tau * k / members for k in range(members)]
    apart_m = float(rng.choice([0.0, _HEIGHTS_APART_M]))
    missions = tuple(
        _mission(direction + float(rng.uniform(-0.45, 0.45)) * math.tau / members, meets_s, apart_m, rng)
        for direction in directions
    )
    stranger = _stranger(meets_s, rng) if rng.random() < _STRANGERS else None
    return Crossing(missions, meets_s, stranger)


def _mission(course_rad: float, meets_s: float, apart_m: float, rng: np.random.Generator) -> Mission:
    airspeed_mps = float(rng.uniform(*_AIRSPEEDS_MPS))
    passes_s = meets_s + float(rng.uniform(-_TIMES_APART_S, _TIMES_APART_S))
    north_m, east_m = (rng.uniform(-1.0, 1.0, 2) * _AREA_M / math.sqrt(2.0)).tolist()
    height_m = _HEIGHT_M + float(rng.uniform(-1.0, 1.0)) * apart_m
    middle_m: Vec3 = (north_m, east_m, -height_m)
    before_m, after_m = rng.uniform(*_CORNER_M, 2).tolist()
    before_m = min(before_m, 0.6 * airspeed_mps * passes_s)
    turns = rng.uniform(-_CORNER_RAD, _CORNER_RAD, 2) * rng.integers(0, 2, 2)
    begin_m, corner_m = _on(middle_m, course_rad, -before_m), _on(middle_m, course_rad, after_m)
    start_m = _on(begin_m, course_rad + float(turns[0]), before_m - airspeed_mps * passes_s)
    last_rad = course_rad + float(turns[1])
    end_m = _on(corner_m, last_rad, float(rng.uniform(*_AFTER_M)))
    lead_m = _on(start_m, course_rad + float(turns[0]), -_ENDLESS_M / 10.0)
    places = lead_m, begin_m, corner_m, end_m, _on(end_m, last_rad, _ENDLESS_M)
    dynamics = AIRFRAMES[str(rng.choice(sorted(AIRFRAMES)))]
    limits = Limits(*_ENVELOPE_MPS, dynamics=dynamics)
    return Mission(start_m, airspeed_mps, Route(places), limits)


def _stranger(meets_s: float, rng: np.random.Generator) -> Path:
    """A crewed aircraft, straight through the area near the time of the meeting."""
    speed_mps, course_rad = float(rng.uniform(*_STRANGER_MPS)), float(rng.uniform(0.0, math.tau))
    north_m, east_m, down_m = (rng.uniform(-1.0, 1.0, 3) * (_AREA_M, _AREA_M, _STRANGER_HEIGHT_M)).tolist()
    times_s = np.arange(400.0)
    velocity = np.tile([speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), 0.0], (400, 1))
    there_m = np.array([north_m, east_m, down_m - _HEIGHT_M])
    passes_s = meets_s + float(rng.uniform(-5.0, 5.0))
    return Path(times_s, there_m + (times_s - passes_s)[:, None] * velocity, velocity)


def without_stranger(one: Crossing) -> Crossing:
    """The same crossing among the members alone."""
    return replace(one, stranger=None)


def _ends(one: Crossing) -> list[tuple[Vec3, Vec3]]:
    return [(mission.start_m, mission.end_m) for mission in one.missions]


def _all_apart(places: list[Vec3], apart_m: float) -> bool:
    return all(math.dist(one[:2], other[:2]) >= apart_m for one, other in combinations(places, 2))


def _pairs_near(one: Crossing, separation_m: float) -> int:
    """The number of pairs that come within the separation if all fly their legs at constant speed."""
    times_s = np.arange(0.0, one.common_s, 0.25)
    places_m = [_places_m(mission, times_s) for mission in one.missions]
    pairs = combinations(places_m, 2)
    return sum(bool((np.linalg.norm(a - b, axis=1) < separation_m).any()) for a, b in pairs)


def _places_m(mission: Mission, times_s: Array) -> Array:
    corners_m = np.array([mission.start_m, *mission.route.places_m[1:-1]])
    lengths_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners_m[:, :2], axis=0).T))])
    flown_m = mission.airspeed_mps * times_s
    return np.column_stack([np.interp(flown_m, lengths_m, corners_m[:, axis]) for axis in range(3)])


def _on(from_m: Vec3, course_rad: float, length_m: float) -> Vec3:
    north_m, east_m, down_m = from_m
    return north_m + length_m * math.cos(course_rad), east_m + length_m * math.sin(course_rad), down_m
