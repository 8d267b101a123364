"""Senses: the side on which each stranger in conflict is passed, so that two that avoid do not mirror.

A stranger may avoid too, and nothing is agreed with it. Each side therefore decides by a rule on quantities
that are the same, or exactly opposite, as seen from the other side: present positions and flown velocities.

Height: the aircraft that is higher at the closest approach passes above. Within a band around equal heights
the addresses decide: the larger one passes below. TCAS II settles equal choices by address as well: if both
aircraft select the same sense, the one with the higher Mode S address reverses (FAA, Introduction to TCAS II
Version 7.1, section on coordination; RTCA DO-185B). Without both addresses the band has no sense.

Sideways: aircraft pass left side to left side. Head-on both then turn right; in a crossing the aircraft that
has the other on its right passes behind it, and the other, if it moves, turns away; the overtaking aircraft
passes on the right (14 CFR 91.113(d)-(f), SERA.3210). Where they would pass right side to right side with
room already, they keep to that.

A sense stays as long as the conflict, and a minute longer, unless the passing clearly develops the other way.
It only adds a price, which decides between rows that are nearly equal; no row is ruled out.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from companion.avoidance.assess import TrafficAssessment
from companion.avoidance.trajectory import OwnState
from companion.model import Track, Vec3

# Around equality, in shares of the protected volume: the pictures of both sides differ by half as much.
_BAND, _BAND_ASIDE = 0.4, 0.25
# A sense stays until the passing is on the other side by this many bands.
_KEPT_BANDS = 1.5
# Climbs continue for this long at most: the other may level off, and the maneuvers of both begin and end.
_CLIMBS_FOR_S = 20.0
# Slower climbs are noise. Two that climb together faster than this mirror.
_LEVEL_MPS, _CLIMBING_MPS = 0.5, 1.0
# Below this relative speed the side of passing is noise; below this share a turn hardly changes it.
_SLOW_MPS, _LEAST_EFFECT = 8.0, 0.2
# A conflict that ended this long ago, and returns, is the same one: the maneuvers of both ended it.
_REMEMBERED_S = 60.0
# Only the nearest conflicts have senses: more would contradict each other.
_MOST = 4


class WrongWays(NamedTuple):
    """The ways of leaving the mission that are against the sense of a conflict."""

    up: bool = False
    down: bool = False
    left: bool = False
    right: bool = False


NO_WRONG_WAYS = WrongWays()


class Passing(NamedTuple):
    """How we pass a track if both fly on.

    `above_m` is our height above it, `aside_m` its distance to our right across the relative motion: the
    first is opposite, the second the same as seen from the other side. `turn_effect` is by how much `aside_m`
    grows with each metre that we move to our right. `climbs_mps` are our climb and its.
    """

    above_m: float
    aside_m: float
    turn_effect: float
    climbs_mps: tuple[float, float]


class Sense(NamedTuple):
    """1, -1 or 0 for none: whether we pass above (1), and whether the track passes on our right (1)."""

    above: int
    aside: int
    chosen_s: float  # or confirmed


class Senses:
    """The senses of the conflicts at hand. `own_icao` is our own address, `None` while it is unknown."""

    def __init__(self) -> None:
        self.own_icao: int | None = None
        self._chosen: dict[str, Sense] = {}

    def wrong_ways(
        self, now_s: float, state: OwnState, tracks: Sequence[Track], assessment: TrafficAssessment
    ) -> WrongWays:
        """The ways against the sense of any of the nearest conflicts; `tracks` are those assessed."""
        self._chosen = {
            track_id: sense
            for track_id, sense in self._chosen.items()
            if 0.0 <= now_s - sense.chosen_s <= _REMEMBERED_S
        }
        indices = assessment.conflict.nonzero()[0]
        indices = indices[assessment.surface_m[indices].argsort(kind="stable")][:_MOST]
        wrong = NO_WRONG_WAYS
        for index in indices.tolist():
            if not assessment.tracks.grounded[index]:
                place_m, velocity_mps = (
                    values[index].tolist()
                    for values in (assessment.tracks.position_m, assessment.tracks.velocity_mps)
                )
                passing = passing_of(state, place_m, velocity_mps)
                horizontal_m = float(assessment.tracks.protected_horizontal_m[index])
                vertical_m = float(assessment.tracks.protected_vertical_m[index])
                found = self._wrong_ways(now_s, passing, tracks[index], horizontal_m, vertical_m)
                wrong = WrongWays(*map(max, wrong, found))
        return wrong

    def _wrong_ways(
        self, now_s: float, passing: Passing, track: Track, horizontal_m: float, vertical_m: float
    ) -> WrongWays:
        """The wrong ways against one track, whose sense is chosen or kept."""
        before = self._chosen.get(track.track_id, Sense(0, 0, now_s))
        band_m = _BAND * vertical_m + track.vertical_uncertainty_m
        above = sense_above(passing, self._by_address(track.icao), band_m, before.above)
        aside = sense_aside(passing.aside_m, _BAND_ASIDE * horizontal_m, before.aside)
        self._chosen[track.track_id] = Sense(above, aside, now_s)
        turn = aside * passing.turn_effect
        return WrongWays(above < 0, above > 0, left=turn > _LEAST_EFFECT, right=turn < -_LEAST_EFFECT)

    def _by_address(self, icao: int | None) -> int:
        """1 if we have the smaller address and pass above, -1 if the larger one, 0 if that is unknown."""
        if self.own_icao is None or icao is None:
            return 0
        return (icao > self.own_icao) - (icao < self.own_icao)


def passing_of(state: OwnState, position_m: Vec3, velocity_mps: Vec3) -> Passing:
    """How we pass a track at this position and velocity, north-east-down [m, m/s]."""
    own_m, (own_north_mps, own_east_mps) = state.position_m, state.ground_mps
    north_m, east_m = position_m[0] - own_m[0], position_m[1] - own_m[1]
    north_mps, east_mps = velocity_mps[0] - own_north_mps, velocity_mps[1] - own_east_mps
    speed_mps, own_mps = math.hypot(north_mps, east_mps), math.hypot(own_north_mps, own_east_mps)
    climbs_mps = state.climb_mps, -velocity_mps[2]
    time_s, aside_m, effect = _CLIMBS_FOR_S, 0.0, 0.0
    if speed_mps > _SLOW_MPS:
        time_s = -(north_m * north_mps + east_m * east_mps) / speed_mps**2
        time_s = min(max(time_s, 0.0), _CLIMBS_FOR_S)
        aside_m = (north_m * east_mps - east_m * north_mps) / speed_mps
        along = own_north_mps * north_mps + own_east_mps * east_mps
        effect = along / (speed_mps * max(own_mps, 1.0))
    climbed_m = (_steady(climbs_mps[0]) - _steady(climbs_mps[1])) * time_s
    return Passing(position_m[2] - own_m[2] + climbed_m, aside_m, effect, climbs_mps)


def sense_above(passing: Passing, by_address: int, band_m: float, before: int) -> int:
    """Whether we pass above (1) or below (-1), 0 for no sense; `before` is the sense until now.

    Of two that already climb or sink together, the one with the larger address reverses.
    """
    own_mps, other_mps = passing.climbs_mps
    together = min(before * own_mps, before * other_mps) > _CLIMBING_MPS
    if before and by_address < 0 and together and abs(passing.above_m) < band_m:
        return -before
    if before and before * passing.above_m >= -_KEPT_BANDS * band_m:
        return before
    if by_address == 0 and abs(passing.above_m) <= band_m:
        return 0
    return 1 if passing.above_m > -by_address * band_m else -1


def sense_aside(aside_m: float, band_m: float, before: int) -> int:
    """Whether the track passes on our right (1) or on our left (-1); `before` is the sense until now."""
    if before and before * aside_m >= -_KEPT_BANDS * band_m:
        return before
    return 1 if aside_m > band_m else -1


def _steady(climb_mps: float) -> float:
    """A climb without what may be noise."""
    return math.copysign(max(abs(climb_mps) - _LEVEL_MPS, 0.0), climb_mps)
