"""Closest approach, angles and separation, for all tracks at once.

Arrays run over tracks first: positions and velocities are (N, 2) or (N, 3), north-east(-down), relative
means other minus own unless a docstring says otherwise.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Below this relative speed nothing comes closer within any horizon of interest.
_STILL_MPS = 1e-6


def time_to_closest_s(rel_position_m: Array, rel_velocity_mps: Array) -> Array:
    """Horizontal time to closest approach [s], shape (N,); negative once past, inf if nothing moves."""
    along = np.einsum("ni,ni->n", rel_position_m[:, :2], rel_velocity_mps[:, :2])
    speed2 = np.einsum("ni,ni->n", rel_velocity_mps[:, :2], rel_velocity_mps[:, :2])
    moving = speed2 > _STILL_MPS**2
    return np.where(moving, -along / np.where(moving, speed2, 1.0), np.inf)


def position_at(rel_position_m: Array, rel_velocity_mps: Array, time_s: Array) -> Array:
    """Relative positions after `time_s` (N,) of straight flight, shape like the positions."""
    finite = np.where(np.isfinite(time_s), time_s, 0.0)
    return rel_position_m + rel_velocity_mps * finite[:, None]


def signed_angle_rad(from_vector: Array, to_vector: Array) -> Array:
    """Angle from one horizontal vector to another, shape (N,), in [-pi, pi]; positive to the left.

    Left as a pilot sees it: anticlockwise from above, with x north and y east (paper §3.1, fig. 2).
    A vector without length has no direction: its angle is 0.
    """
    cross = from_vector[..., 0] * to_vector[..., 1] - from_vector[..., 1] * to_vector[..., 0]
    dot = from_vector[..., 0] * to_vector[..., 0] + from_vector[..., 1] * to_vector[..., 1]
    # In north-east coordinates a positive cross product turns clockwise, to the right.
    return np.arctan2(-cross, dot)


def closing_speed_mps(rel_position_m: Array, rel_velocity_mps: Array) -> Array:
    """Rate at which the slant distance shrinks, shape (N,); 0 where it grows."""
    distance = np.sqrt(np.einsum("ni,ni->n", rel_position_m, rel_position_m))
    rate = np.einsum("ni,ni->n", rel_position_m, rel_velocity_mps) / np.maximum(distance, 1e-9)
    closing: Array = np.maximum(-rate, 0.0)
    return closing


def vertical_distance_m(above_m: Array, grounded: NDArray[np.bool_]) -> Array:
    """Vertical distance of something `above_m` over a track; something grounded reaches down to the earth."""
    return np.where(grounded, np.maximum(above_m, 0.0), np.abs(above_m))


def wrap_pi(angle_rad: Array) -> Array:
    """The same angles in [-pi, pi)."""
    wrapped: Array = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
