"""Collision cone with its transition domain (paper §3.1, figures 2 and 3).

An obstacle of radius R_o + R_u at distance d subtends the half angle beta1 = asin((R_o + R_u) / d). There is
a conflict while the relative velocity points into this cone, abs(alpha) <= beta1. Once inside, the cone
widens to beta2 = beta1 + dbeta until abs(alpha) > beta2. Without that memory a small turn would leave the
cone, the goal would pull the course back into it, and the aircraft would chatter along its edge.
"""

from collections.abc import Sequence
from itertools import compress

import numpy as np

from companion.avoidance.geometry import STILL_MPS, Array, Mask
from companion.compiled import kernels


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
