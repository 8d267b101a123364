"""Closest approach, angles and separation, for all tracks at once.

Arrays run over tracks first: positions and velocities are (N, 2) or (N, 3), north-east(-down), relative
means other minus own unless a docstring says otherwise.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.compiled import kernels

Array = NDArray[np.float64]

# Below this relative speed nothing comes closer within any horizon of interest.
_STILL_MPS = 1e-6


class RelativeMotion(NamedTuple):
    """Others against us, flying straight: places and velocities (N, 3), other minus own, the rest (N,).

    `distance_m` is horizontal. `closing_mps` is the rate at which it shrinks, 0 where it grows.
    `time_to_closest_s` is until the horizontal closest approach: negative once past, inf if nothing moves.
    """

    position_m: Array
    velocity_mps: Array
    distance_m: Array
    closing_mps: Array
    time_to_closest_s: Array


def relative_motion(
    position_m: Array, velocity_mps: Array, own_position_m: Array, own_velocity_mps: Array
) -> RelativeMotion:
    """How others, (N, 3), fly relative to us, (3,)."""
    return RelativeMotion(
        *kernels.relative_motion(position_m, velocity_mps, own_position_m, own_velocity_mps, _STILL_MPS)
    )


def position_at(rel_position_m: Array, rel_velocity_mps: Array, time_s: Array) -> Array:
    """Relative positions after `time_s` (N,) of straight flight, shape like the positions."""
    finite = np.where(np.isfinite(time_s), time_s, 0.0)
    return rel_position_m + rel_velocity_mps * finite[:, None]


def vertical_distance_m(above_m: Array, grounded: NDArray[np.bool_]) -> Array:
    """Vertical distance of something `above_m` over a track; something grounded reaches down to the earth."""
    return np.where(grounded, np.maximum(above_m, 0.0), np.abs(above_m))


def wrap_pi(angle_rad: Array) -> Array:
    """The same angles in [-pi, pi)."""
    wrapped: Array = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
