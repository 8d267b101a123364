"""Geometry of an encounter: closest approach, and the collision cone with its transition domain (paper §3.1).

Arrays run over tracks first. Positions and velocities are (N, 2) or (N, 3), north-east(-down). "Relative"
means other minus own unless a docstring says otherwise.

An obstacle of radius R_o + R_u at distance d subtends the half angle beta1 = asin((R_o + R_u) / d). There is
a conflict while the relative velocity points into this cone, abs(alpha) <= beta1 (figures 2 and 3). Once
inside, the cone widens to beta2 = beta1 + dbeta until abs(alpha) > beta2. Without that memory a small turn
would leave the cone, the goal would pull the course back into it, and the aircraft would chatter along its
edge.
"""

from collections.abc import Sequence
from itertools import compress
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


def half_angle_rad(distance_m: Array, radius_m: Array) -> Array:
    """beta1 = asin(radius / distance), (N,); pi within the radius, where every direction collides."""
    beta1: Array = kernels.half_angles(distance_m, radius_m)
    return beta1


def approach_angle_rad(rel_position_m: Array, own_rel_velocity_mps: Array) -> Array:
    """alpha: angle from the line of sight to our velocity relative to the obstacle, in [-pi, pi], (N,).

    `rel_position_m` is obstacle minus own, `own_rel_velocity_mps` own minus obstacle, both (N, 2+). Positive
    is to the left as the pilot sees it: anticlockwise from above, with x north and y east (paper §3.1, fig.
    2). Without relative motion nothing approaches, and alpha is pi.
    """
    alpha: Array = kernels.approach_angles(rel_position_m, own_rel_velocity_mps, STILL_MPS)
    return alpha


class TransitionDomain:
    """The memory of the cones: obstacles whose cone we have entered are judged by beta2 instead of beta1.

    `delta_beta_rad`, by how much beta2 is wider, may be changed at any time.
    """

    def __init__(self, delta_beta_rad: float) -> None:
        self.delta_beta_rad = delta_beta_rad
        self._inside: frozenset[str] = frozenset()

    def wider_rad(self, track_id: str) -> float:
        """By how much the cone of this obstacle is wider than beta1."""
        return self.delta_beta_rad if track_id in self._inside else 0.0

    def covers(self, ids: Sequence[str], alpha_rad: Array, beta1_rad: Array) -> Mask:
        """The obstacles whose cone we are in, (N,); for those entered before, the wider cone."""
        if self._inside:
            beta1_rad = beta1_rad + [self.wider_rad(track_id) for track_id in ids]
        covered: Mask = np.abs(alpha_rad) <= beta1_rad
        return covered

    def keep(self, ids: Sequence[str], inside: Mask) -> None:
        """Remember these obstacles, (N,), as entered, and no others.

        Pass those covered and within reach: def. 3 has conflicts only by distance, so that the domain is
        entered and kept only there.
        """
        self._inside = frozenset(compress(ids, inside.tolist()))

    def reset(self) -> None:
        """Forget all obstacles."""
        self._inside = frozenset()
