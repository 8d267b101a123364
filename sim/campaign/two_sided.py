"""Encounters in which both aircraft avoid without knowing each other: each hears the other's ADS-B only.

The intruder's path becomes the mission of a second aircraft: legs between the places where its course or
climb changes, flown at one airspeed, so that it is where the path leads when the two pass. Both flights
without avoidance, flown on these missions, are the reference; with avoidance on one side the second aircraft
flies the same mission.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from companion.engine import Engine
from sim.campaign.flight import (
    BEFORE_S,
    FIRST_ICAO,
    STEP_S,
    STEPS_PER_FACT,
    EncounterResult,
    Flight,
    closest_approach,
    plane_on,
)
from sim.campaign.mirroring import mirrored
from sim.campaign.plane import Limits
from sim.campaign.route import Route, along, straight
from sim.campaign.trail import LiveReceiver, Trail
from sim.encounters import Encounter, Path, Surveillance, passing

Array = NDArray[np.floating]
MakeEngine = Callable[[Encounter, Limits], Engine]

# An intruder outside these airspeeds is of another class, and does not fly Companion.
FLYABLE_MPS = (15.0, 60.0)
# The second aircraft's envelope, as shares of its airspeed.
_SLOWEST, _FASTEST = 0.8, 1.25
# Its climbs, as a share of the steepest on its path.
_STEEPER = 1.1
# The airspeed is measured over at least so much of the path.
_LEAST_WAY_S = 10.0
_OTHER_SEED = 7919


def is_flyable(encounter: Encounter) -> bool:
    """Whether there is one intruder, as fast as an aircraft that flies Companion."""
    if len(encounter.intruders) != 1:
        return False
    speeds_mps = np.hypot(*encounter.intruders[0].velocity_mps[:, :2].T)
    return bool(speeds_mps.min() >= FLYABLE_MPS[0] and speeds_mps.max() <= FLYABLE_MPS[1])


@dataclass(frozen=True)
class Side:
    """One aircraft of an encounter: the encounter as it is for that aircraft, its mission and limits."""

    encounter: Encounter
    route: Route
    limits: Limits


def sides_of(encounter: Encounter, limits: Limits, route: Route | None = None) -> tuple[Side, Side]:
    """Both aircraft of a flyable encounter; the intruder of each flies the other's mission."""
    ours = encounter, straight(encounter) if route is None else route, limits
    theirs = _intruders_mission(encounter, limits)
    own_path, other_path = _nominal(*ours), _nominal(*theirs)
    return (
        Side(replace(encounter, intruders=(other_path,)), *ours[1:]),
        Side(replace(theirs[0], intruders=(own_path,)), *theirs[1:]),
    )


def _intruders_mission(encounter: Encounter, limits: Limits) -> tuple[Encounter, Route, Limits]:
    """The encounter with the intruder's start, its mission along its path, and its envelope.

    The envelope is that of its own airspeed, with climbs as steep as its path needs.
    """
    path, duration_s = encounter.intruders[0], encounter.duration_s
    passes_s = passing(encounter.own_position_m, encounter.own_velocity_mps, path, duration_s).time_s
    airspeed_mps, route = _airspeed_until(path, max(passes_s, _LEAST_WAY_S)), along(path)
    begin_m, next_m = route.places_m[1:3]
    begun = replace(
        encounter,
        own_position_m=begin_m,
        own_course_rad=math.atan2(next_m[1] - begin_m[1], next_m[0] - begin_m[0]),
        own_airspeed_mps=airspeed_mps,
    )
    steepest_mps = float(np.abs(path.velocity_mps[:, 2]).max())
    envelope = replace(
        limits,
        min_airspeed_mps=_SLOWEST * airspeed_mps,
        max_airspeed_mps=_FASTEST * airspeed_mps,
        max_climb_mps=max(limits.max_climb_mps, _STEEPER * steepest_mps),
    )
    return begun, route, envelope


def fly_both(
    sides: tuple[Side, Side], make_engine: MakeEngine, surveillance: Surveillance, seed: int
) -> tuple[Encounter, EncounterResult]:
    """Fly an encounter with avoidance on both sides; the result of the first, with the second's flown path.

    Decisions of the two come at the same moments or half a second apart, and either has the lower address.
    """
    trails = Trail(), Trail()
    first, second = _flown(_flights(sides, trails, make_engine, surveillance, seed), trails)
    flown = replace(sides[0].encounter, intruders=(trails[1].path(),))
    first.closest = closest_approach(first.own_m, flown)
    if first.avoided and second.avoided:
        missions = sides[1].encounter.intruders[0], sides[0].encounter.intruders[0]
        count = round(flown.duration_s / STEP_S) + 1
        first.mirrored = mirrored(missions, (first.own_m[:count], second.own_m[:count]), STEP_S)
    return flown, first


def _flights(
    sides: tuple[Side, Side],
    trails: tuple[Trail, Trail],
    make_engine: MakeEngine,
    surveillance: Surveillance,
    seed: int,
) -> list[Flight]:
    """The flights of both, each with a receiver of the other."""
    rng = np.random.default_rng([seed, 2])
    phases, lower = (0, int(rng.integers(2)) * STEPS_PER_FACT), int(rng.integers(2))
    flights = []
    for number, side in enumerate(sides):
        index = number ^ lower
        heard = trails[1 - number], trails[number], 1 - index
        receiver = LiveReceiver(*heard, surveillance, seed + number * _OTHER_SEED)
        engine = make_engine(side.encounter, side.limits)
        known = {"icao": FIRST_ICAO + index, "phase": phases[number]}
        flights.append(Flight(side.encounter, engine, receiver, side.limits, side.route, **known))
    return flights


def _flown(flights: list[Flight], trails: tuple[Trail, Trail]) -> list[EncounterResult]:
    """The results of both, flown in lockstep until both are back on their legs."""
    for one in flights:
        one.read_mission()
    step, over = 0, False
    while not over:
        for trail, one in zip(trails, flights, strict=True):
            trail.note(step * STEP_S, one.plane)
        decided = [one.decide(step) for one in flights]
        over = all(decided)
        if not over:
            for one in flights:
                one.fly_on()
        step += STEPS_PER_FACT
    return [one.result() for one in flights]


def _nominal(encounter: Encounter, route: Route, limits: Limits) -> Path:
    """The path of an aircraft that only flies its mission."""
    plane, trail = plane_on(encounter, route, limits), Trail()
    for _ in range(round(BEFORE_S / STEP_S) // STEPS_PER_FACT):
        plane.fly(STEPS_PER_FACT, STEP_S)
    for step in range(0, round(encounter.duration_s / STEP_S) + 1, STEPS_PER_FACT):
        trail.note(step * STEP_S, plane)
        plane.fly(STEPS_PER_FACT, STEP_S)
    return trail.path()


def _airspeed_until(path: Path, passes_s: float) -> float:
    """The airspeed at which the way until the passing takes as long as on the path."""
    places_m = path.positions_m(np.linspace(0.0, passes_s, 100))
    length_m = float(np.hypot(*np.diff(places_m[:, :2], axis=0).T).sum())
    return min(max(length_m / passes_s, FLYABLE_MPS[0]), FLYABLE_MPS[1])
