"""Whether the maneuvers of two aircraft that avoid each other cancel."""

import math

import numpy as np
from numpy.typing import NDArray

from companion.units import WELL_CLEAR_HORIZONTAL_M, WELL_CLEAR_VERTICAL_M
from sim.encounters import Path

Array = NDArray[np.floating]

# Smaller displacements from the mission are no maneuver.
_SIDEWAYS_M, _VERTICAL_M = 50.0, 10.0
VERTICAL, SIDEWAYS = "vertical", "sideways"


def mirrored(missions: tuple[Path, Path], flown_m: tuple[Array, Array], dt_s: float) -> tuple[str, ...]:
    """How the maneuvers cancelled each other at the closest approach: the same sense, or the same way aside.

    Both aircraft were then displaced from their missions to the same side, seen across their relative motion
    without avoidance, so that each maneuver took away what the other gained.
    """
    count = min(map(len, flown_m))
    off_m = np.abs(flown_m[0][:count] - flown_m[1][:count])
    across_m = np.hypot(off_m[:, 0], off_m[:, 1])
    ratios = np.maximum(across_m / WELL_CLEAR_HORIZONTAL_M, off_m[:, 2] / WELL_CLEAR_VERTICAL_M)
    closest = int(np.argmin(ratios))
    (own_m, own_mps), (other_m, other_mps) = (mission.state_at(closest * dt_s) for mission in missions)
    own, other = flown_m[0][closest] - np.array(own_m), flown_m[1][closest] - np.array(other_m)
    north_mps, east_mps = other_mps[0] - own_mps[0], other_mps[1] - own_mps[1]
    aside = np.array([-east_mps, north_mps]) / max(math.hypot(north_mps, east_mps), 1e-6)
    found = []
    if _is_same(float(own[2]), float(other[2]), _VERTICAL_M):
        found.append(VERTICAL)
    if _is_same(float(own[:2] @ aside), float(other[:2] @ aside), _SIDEWAYS_M):
        found.append(SIDEWAYS)
    return tuple(found)


def _is_same(one: float, other: float, least: float) -> bool:
    return one * other > 0.0 and min(abs(one), abs(other)) >= least
