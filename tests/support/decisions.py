"""Decisions and motion of encounters in a closed loop, as text that shows every bit."""

import math
import random
from collections.abc import Iterator
from dataclasses import replace

from companion.avoidance import AvoidanceParams, Avoider
from companion.model import Goal, Ownship, Track
from sim.dynamics import FixedWing

ALTITUDE_M = 300.0


def decisions(encounters: int = 8, steps: int = 30) -> Iterator[str]:
    """One line for each second of each encounter: the decision, and where the aircraft is then."""
    for number in range(encounters):
        yield from _fly(random.Random(number), steps)


def _fly(rng: random.Random, steps: int) -> Iterator[str]:
    wind_mps = (rng.gauss(0.0, 4.0), rng.gauss(0.0, 4.0))
    wing = FixedWing((0.0, 0.0, -ALTITUDE_M), rng.uniform(0.0, math.tau), 22.0, wind_mps=wind_mps)
    goal = Goal(course_rad=wing.course_rad, airspeed_mps=22.0, altitude_m=ALTITUDE_M)
    avoider = Avoider(AvoidanceParams())
    others = [_collider(rng, number, wing) for number in range(rng.randint(1, 4))]
    for time_s in range(steps):
        own = Ownship(
            float(time_s), wing.position_m, wing.velocity_mps, wing.airspeed_mps, wing.heading_rad, wind_mps
        )
        decision = avoider.decide(own.time_s, own, [_at(other, own.time_s) for other in others], goal)
        wanted = decision.guidance
        wing.hold_course(goal.course_rad if wanted is None else wanted.course_rad)
        wing.hold_altitude(ALTITUDE_M if wanted is None else wanted.altitude_m)
        wing.hold_airspeed(22.0 if wanted is None else wanted.airspeed_mps)
        wing.fly(10, 0.1)
        yield f"{decision} {wing.position_m} {wing.bank_rad}"


def _collider(rng: random.Random, number: int, wing: FixedWing) -> Track:
    """A track that passes near us in half a minute or so, now and then in a turn."""
    meet_s, speed_mps = rng.uniform(15.0, 50.0), rng.uniform(0.0, 90.0)
    course_rad = rng.uniform(0.0, math.tau)
    velocity_mps = (speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad), rng.gauss(0.0, 1.5))
    place_m = tuple(
        own + (own_mps - other_mps) * meet_s + rng.gauss(0.0, miss_m)
        for own, own_mps, other_mps, miss_m in zip(
            wing.position_m, wing.velocity_mps, velocity_mps, (150.0, 150.0, 20.0), strict=True
        )
    )
    turn_radps = rng.choice((0.0, 0.0, rng.gauss(0.0, 0.03)))
    return Track(f"T{number}", 0.0, place_m, velocity_mps, turn_radps=turn_radps)


def _at(track: Track, time_s: float) -> Track:
    places = zip(track.position_m, track.velocity_mps, strict=True)
    return replace(track, time_s=time_s, position_m=tuple(place + speed * time_s for place, speed in places))
