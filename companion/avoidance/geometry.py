"""Closest approach, angles and separation, for all tracks at once.

Arrays run over tracks first: positions and velocities are (N, 2) or (N, 3), north-east(-down), relative
means other minus own unless a docstring says otherwise.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.compiled import kernels
from companion.model import Vec3

Array = NDArray[np.float64]

# Below this relative speed nothing comes closer within any horizon of interest.
STILL_MPS = 1e-6


class RelativeMotion(NamedTuple):
    """Others against us, all flying straight: places from us and our velocities, (N, 3), the rest (N,).

    Places are other minus own, velocities own minus other. `distance_m` is horizontal. `closing_mps` is the
    rate at which it shrinks, 0 where it grows. `time_to_closest_s` is until the horizontal closest approach:
    negative once past, inf if nothing moves. `approach_rad` is alpha of the cone (`cone.approach_angle_rad`).
    """

    position_m: Array
    own_velocity_mps: Array
    distance_m: Array
    closing_mps: Array
    time_to_closest_s: Array
    approach_rad: Array


def relative_motion(
    position_m: Array, velocity_mps: Array, own_position_m: Vec3, own_velocity_mps: Vec3
) -> RelativeMotion:
    """How we fly relative to others, (N, 3)."""
    places, velocities, all_else = kernels.relative_motion(
        position_m, velocity_mps, *own_position_m, *own_velocity_mps, STILL_MPS
    )
    return RelativeMotion(places, velocities, *all_else)


def any_of(values: Array | NDArray[np.bool_]) -> bool:
    """Whether any of them is not 0; of a few, as tracks are, `ndarray.any` tells it five times as slowly."""
    return bool(np.count_nonzero(values))


def wrap_pi(angle_rad: Array) -> Array:
    """The same angles in [-pi, pi)."""
    wrapped: Array = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
