"""Encounters sampled from the models: an intruder's path, placed so that it passes near us.

The miss distance is sampled too. Random traffic passes through a window around us, perpendicular to the
relative motion, uniformly in both directions, and more often the faster it closes. Half of the samples are
taken from the core where near mid-air collisions happen, which is rare; weights correct for that.
"""

import math
from collections.abc import Sequence

import numpy as np

from companion.model import Vec3
from companion.units import (
    NMAC_HORIZONTAL_M,
    NMAC_VERTICAL_M,
    WELL_CLEAR_HORIZONTAL_M,
    WELL_CLEAR_VERTICAL_M,
)
from sim.encounters.encounter import DURATION_S, Encounter, Path, passing
from sim.encounters.model import EncounterModel

OWN_AIRSPEEDS_MPS = (20.0, 30.0)
PASSES_S = (45.0, 90.0)
# The window: twice well clear. Traffic outside it is neither avoided nor counted as a nuisance.
WINDOW_HORIZONTAL_M, WINDOW_VERTICAL_M = 2.0 * WELL_CLEAR_HORIZONTAL_M, 2.0 * WELL_CLEAR_VERTICAL_M
# The core of half of the samples, wide enough for the miss of turning intruders.
_CORE_HORIZONTAL_M, _CORE_VERTICAL_M = 1.5 * NMAC_HORIZONTAL_M, 1.5 * NMAC_VERTICAL_M
_CORE_SHARE = 0.5
# Encounters begin outside this many well-clear volumes: nearer ones leave no time to react.
_BEGINS_OUTSIDE = 1.5
_USUAL_MPS = 50.0
# The lowest mission height; the layers of the models reach down to 50 ft.
_LOWEST_M = 100.0
_TRIES = 200


def sample(models: Sequence[EncounterModel], seed: int, number: int, *, intruders: int = 1) -> Encounter:
    """Encounter `number` of a seed; it depends only on these, so any process can sample it alone.

    Several intruders pass within seconds of each other, each with its own miss.
    """
    rng = np.random.default_rng([seed, number])
    own_mps = float(rng.uniform(*OWN_AIRSPEEDS_MPS))
    own_velocity: Vec3 = (own_mps, 0.0, 0.0)
    passes_s = float(rng.uniform(*PASSES_S))
    paths, weight, height_m, named = [], 1.0, None, ""
    for _ in range(intruders):
        model = models[int(rng.integers(len(models)))]
        path, one, at_height_m = _near(model, own_velocity, passes_s + float(rng.uniform(-5.0, 5.0)), rng)
        if height_m is None:
            height_m, named = max(at_height_m, _LOWEST_M), model.name
        paths.append(path)
        weight *= one
    assert height_m is not None
    own: Vec3 = (0.0, 0.0, -height_m)
    placed = tuple(path.moved((0.0, 0.0, -height_m)) for path in paths)
    first = passing(own, own_velocity, placed[0], DURATION_S)
    return Encounter(
        f"model-{seed}-{number}",
        own,
        0.0,
        own_mps,
        placed,
        weight=weight ** (1.0 / intruders),  # several intruders meet by construction, not by chance
        geometry=first.geometry,
        closing_mps=first.closing_mps,
        nominal_horizontal_m=first.horizontal_m,
        nominal_vertical_m=first.vertical_m,
        source=named,
    )


def _near(
    model: EncounterModel, own_mps: Vec3, passes_s: float, rng: np.random.Generator
) -> tuple[Path, float, float]:
    """An intruder's path relative to our start, its weight, and its height at the passing [m]."""
    for _ in range(_TRIES):
        flown = model.draw(rng, round(DURATION_S))
        course_rad = float(rng.uniform(0.0, math.tau))
        turned = _turned(flown, course_rad)
        there_m, theirs_mps = turned.state_at(passes_s)
        north_mps, east_mps = theirs_mps[0] - own_mps[0], theirs_mps[1] - own_mps[1]
        relative_mps = math.hypot(north_mps, east_mps)
        across_m, above_m, weight = _miss(rng)
        if relative_mps < 1.0:
            continue
        miss_m = (-east_mps / relative_mps * across_m, north_mps / relative_mps * across_m)
        here_m = own_mps[0] * passes_s
        path = turned.moved((here_m + miss_m[0] - there_m[0], miss_m[1] - there_m[1], -above_m - there_m[2]))
        if _begins_outside(path):
            return path, weight * relative_mps / _USUAL_MPS, -there_m[2]
    raise ValueError(f"{model.name}: no path from outside in {_TRIES} tries")


def _miss(rng: np.random.Generator) -> tuple[float, float, float]:
    """Horizontal and vertical miss [m], and the weight: real frequency over sampled frequency."""
    core = rng.random() < _CORE_SHARE
    across, above = rng.uniform(-1.0, 1.0, 2).tolist()
    across *= _CORE_HORIZONTAL_M if core else WINDOW_HORIZONTAL_M
    above *= _CORE_VERTICAL_M if core else WINDOW_VERTICAL_M
    window = 1.0 / (WINDOW_HORIZONTAL_M * WINDOW_VERTICAL_M)
    within = abs(across) < _CORE_HORIZONTAL_M and abs(above) < _CORE_VERTICAL_M
    drawn = (1.0 - _CORE_SHARE) * window
    if within:
        drawn += _CORE_SHARE / (_CORE_HORIZONTAL_M * _CORE_VERTICAL_M)
    return across, above, window / drawn


def _begins_outside(path: Path) -> bool:
    """True if the path starts outside the volume around us at the origin."""
    north_m, east_m, down_m = path.position_m[0]
    across = math.hypot(north_m, east_m) / WELL_CLEAR_HORIZONTAL_M
    return bool(max(across, abs(down_m) / WELL_CLEAR_VERTICAL_M) >= _BEGINS_OUTSIDE)


def _turned(path: Path, by_rad: float) -> Path:
    cos, sin = math.cos(by_rad), math.sin(by_rad)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return Path(path.time_s, path.position_m @ turn, path.velocity_mps @ turn)
