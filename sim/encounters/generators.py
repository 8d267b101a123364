"""Encounters generated from their closest approach: all kinds, from all sides, hits and misses."""

import math
from collections.abc import Callable

import numpy as np

from companion.errors import ConfigError
from companion.model import Vec3
from sim.encounters.encounter import DURATION_S, Array, Encounter, Path, passing

_OWN_AIRSPEEDS_MPS = (15.0, 35.0)
_SPEEDS_MPS = (5.0, 130.0)
_PASSES_S = (45.0, 90.0)
_HEIGHTS_M = (150.0, 1000.0)
# Half of them hit. The others miss by up to these distances.
_MISS_M, _MISS_HEIGHT_M = 1200.0, 150.0
# Just outside well clear: an intruder hovering ahead of our slowest aircraft starts no further away.
_BEGINS_OUTSIDE_M = 620.0


def _straight(_: np.random.Generator) -> Vec3:
    return 0.0, 0.0, 0.0


def _climbing(rng: np.random.Generator) -> Vec3:
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 8.0)), 0.0, 0.0


def _turning(rng: np.random.Generator) -> Vec3:
    return 0.0, float(rng.choice([-1.0, 1.0]) * np.radians(rng.uniform(1.0, 3.0))), 0.0


def _accelerating(rng: np.random.Generator) -> Vec3:
    return 0.0, 0.0, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.5))


# Climb [m/s], turn rate [rad/s] and acceleration [m/s2] of one intruder.
_MOTIONS: dict[str, Callable[[np.random.Generator], Vec3]] = {
    "level": _straight,
    "climbing": _climbing,
    "turning": _turning,
    "accelerating": _accelerating,
    "together": _straight,
    "formation": _straight,
    "hovering": _straight,
}
KINDS = tuple(_MOTIONS)


def generate(kind: str, seed: int, number: int, *, hits: bool | None = None) -> Encounter:
    """Encounter `number` of a seed, of one of `KINDS` or `mix`; it depends only on these.

    `hits`: the first intruder hits us, or misses; `None`: at random. `ConfigError` for an unknown kind.
    """
    if kind not in (*KINDS, "mix"):
        raise ConfigError(f"{kind}: no such kind of encounter; there are {', '.join((*KINDS, 'mix'))}")
    rng = np.random.default_rng([seed, number])
    if kind == "mix":
        kind = KINDS[int(rng.integers(len(KINDS)))]
    own_mps, passes_s = float(rng.uniform(*_OWN_AIRSPEEDS_MPS)), float(rng.uniform(*_PASSES_S))
    height_m = float(rng.uniform(*_HEIGHTS_M))
    hit = bool(rng.random() < 0.5) if hits is None else hits
    own: Vec3 = (0.0, 0.0, -height_m)
    first = _intruder(kind, own, own_mps, passes_s, rng, hit=hit)
    intruders = [first]
    if kind == "together":
        for _ in range(int(rng.integers(1, 4))):
            later_s = passes_s + float(rng.uniform(-5.0, 5.0))
            intruders.append(_intruder(kind, own, own_mps, later_s, rng, hit=bool(rng.random() < 0.5)))
    elif kind == "formation":
        aside = rng.uniform(50.0, 200.0, 2) * rng.choice([-1.0, 1.0], 2)
        intruders.append(first.moved((aside[0], aside[1], 0.0)))
    passed = passing(own, (own_mps, 0.0, 0.0), first, DURATION_S)
    return Encounter(
        f"{kind}-{seed}-{number}",
        own,
        0.0,
        own_mps,
        tuple(intruders),
        geometry=passed.geometry,
        closing_mps=passed.closing_mps,
        nominal_horizontal_m=passed.horizontal_m,
        nominal_vertical_m=passed.vertical_m,
        source=kind,
    )


def _intruder(
    kind: str, own_m: Vec3, own_mps: float, passes_s: float, rng: np.random.Generator, *, hit: bool
) -> Path:
    """A random path that passes us at `passes_s`; drawn again while it starts too near to us."""
    while True:
        speed_mps = 0.0 if kind == "hovering" else float(rng.uniform(*_SPEEDS_MPS))
        course_rad = float(rng.uniform(0.0, math.tau))
        climb_mps, rate_rps, gain_mps2 = _MOTIONS[kind](rng)
        aside_m, above_m = (
            (0.0, 0.0) if hit else (rng.uniform(-1.0, 1.0, 2) * (_MISS_M, _MISS_HEIGHT_M)).tolist()
        )
        north_mps, east_mps = speed_mps * math.cos(course_rad) - own_mps, speed_mps * math.sin(course_rad)
        relative_mps = math.hypot(north_mps, east_mps)
        if relative_mps < 2.0:
            continue
        there = np.array(
            [
                own_m[0] + own_mps * passes_s - east_mps / relative_mps * aside_m,
                own_m[1] + north_mps / relative_mps * aside_m,
                own_m[2] - above_m,
            ]
        )
        path = _flown(there, speed_mps, course_rad, climb_mps, rate_rps, gain_mps2, passes_s)
        off_m = path.position_m[0] - np.array(own_m)
        if math.hypot(off_m[0], off_m[1]) > _BEGINS_OUTSIDE_M:
            return path


def _flown(
    there_m: Array, speed_mps: float, course_rad: float, climb_mps: float, rate_rps: float,
    gain_mps2: float, passes_s: float,
) -> Path:  # fmt: skip
    """The path before and after the passing, once a second; maneuvers last 30 s before and after it."""
    times_s = np.arange(round(DURATION_S) + 1, dtype=float)
    fine_s = np.linspace(0.0, DURATION_S, 10 * round(DURATION_S) + 1)
    since_s = np.clip(fine_s - passes_s, -30.0, 30.0)
    speed = np.clip(speed_mps + gain_mps2 * since_s, 0.0, 140.0)
    course = course_rad + rate_rps * since_s
    velocity = np.column_stack(
        [speed * np.cos(course), speed * np.sin(course), np.full(len(fine_s), -climb_mps)]
    )
    moved = np.zeros_like(velocity)
    moved[1:] = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]), axis=0) * (fine_s[1] - fine_s[0])
    at = np.array([np.interp(passes_s, fine_s, moved[:, axis]) for axis in range(3)])
    return Path(times_s, (moved - at + there_m)[::10], velocity[::10])
