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
    path = encounter.intruders[0]
    passes_s = passing(
        encounter.own_position_m, encounter.own_velocity_mps, path, encounter.duration_s
    ).time_s
    airspeed_mps = _airspeed_until(path, max(passes_s, 10.0))
    legs = along(path)
    (north_m, east_m, _), (next_north_m, next_east_m, _) = legs.places_m[1:3]
    second = replace(
        encounter,
        own_position_m=legs.places_m[1],
        own_course_rad=math.atan2(next_east_m - east_m, next_north_m - north_m),
        own_airspeed_mps=airspeed_mps,
    )
    climb_mps = max(limits.max_climb_mps, 1.1 * float(np.abs(path.velocity_mps[:, 2]).max()))
    other_limits = replace(
        limits,
        min_airspeed_mps=_SLOWEST * airspeed_mps,
        max_airspeed_mps=_FASTEST * airspeed_mps,
        max_climb_mps=climb_mps,
    )
    own_route = straight(encounter) if route is None else route
    own_path = _nominal(encounter, own_route, limits)
    other_path = _nominal(second, legs, other_limits)
    return (
        Side(replace(encounter, intruders=(other_path,)), own_route, limits),
        Side(replace(second, intruders=(own_path,)), legs, other_limits),
    )


def fly_both(
    sides: tuple[Side, Side], make_engine: MakeEngine, surveillance: Surveillance, seed: int
) -> tuple[Encounter, EncounterResult]:
    """Fly an encounter with avoidance on both sides; the result of the first, with the second's flown path.

    Decisions of the two come at the same moments or half a second apart, and either has the lower address.
    """
    rng = np.random.default_rng([seed, 2])
    phases, lower = (0, int(rng.integers(2)) * STEPS_PER_FACT), int(rng.integers(2))
    trails = Trail(), Trail()
    flights = []
    for number, (side, phase) in enumerate(zip(sides, phases, strict=True)):
        index = number ^ lower
        receiver = LiveReceiver(
            trails[1 - number], trails[number], 1 - index, surveillance, seed + number * 7919
        )
        engine = make_engine(side.encounter, side.limits)
        icao = FIRST_ICAO + index
        flights.append(
            Flight(side.encounter, engine, receiver, side.limits, side.route, icao=icao, phase=phase)
        )
    for one in flights:
        one.read_mission()
    step = 0
    while True:
        for trail, one in zip(trails, flights, strict=True):
            trail.note(step * STEP_S, one.plane)
        over = [one.decide(step) for one in flights]
        if all(over):
            break
        for one in flights:
            one.fly_on()
        step += STEPS_PER_FACT
    first, second = (one.result() for one in flights)
    flown = replace(sides[0].encounter, intruders=(trails[1].path(),))
    first.closest = closest_approach(first.own_m, flown)
    if first.avoided and second.avoided:
        missions = sides[1].encounter.intruders[0], sides[0].encounter.intruders[0]
        count = round(flown.duration_s / STEP_S) + 1
        first.mirrored = mirrored(missions, (first.own_m[:count], second.own_m[:count]), STEP_S)
    return flown, first


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
