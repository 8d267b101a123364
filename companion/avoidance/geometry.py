"""Positions, closest approach and angles, for all tracks at once.

Arrays run over tracks first. Positions and velocities are (N, 2) or (N, 3), north-east(-down). "Relative"
means other minus own unless a docstring says otherwise.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.compiled import kernels
from companion.model import Ownship, Track, Vec3

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Below this relative speed nothing comes closer within any horizon of interest.
STILL_MPS = 1e-6


class RelativeMotion(NamedTuple):
    """Tracks relative to ownship, all flying straight: positions and velocities (N, 3), the rest (N,).

    Positions are other minus own, velocities own minus other. `distance_m` is horizontal. `closing_mps` is
    the rate at which the distance shrinks, 0 where it grows. `time_to_closest_s` counts to the horizontal
    closest approach: negative once past, inf without relative motion. `approach_rad` is the angle alpha of
    the cone (`cone.approach_angle_rad`).
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
    """Motion of tracks, (N, 3) each, relative to ownship."""
    positions, velocities, columns = kernels.relative_motion(
        position_m, velocity_mps, *own_position_m, *own_velocity_mps, STILL_MPS
    )
    return RelativeMotion(positions, velocities, *columns)


def position_at(moving: Ownship | Track, now_s: float) -> Vec3:
    """Position at `now_s` [m] after straight flight from the time of the state."""
    since_s = now_s - moving.time_s
    (north_m, east_m, down_m), (north_mps, east_mps, down_mps) = moving.position_m, moving.velocity_mps
    return north_m + north_mps * since_s, east_m + east_mps * since_s, down_m + down_mps * since_s


def any_of(values: Array | Mask) -> bool:
    """Whether any value is not 0. For short arrays this is five times as fast as `ndarray.any`."""
    return bool(np.count_nonzero(values))


def wrap_pi(angle_rad: Array) -> Array:
    """The same angles in [-pi, pi)."""
    wrapped: Array = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
