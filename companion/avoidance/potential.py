"""Potential field (paper §3.1, eq. 4-9): attraction to the goal, repulsion from obstacles within reach."""

from typing import TypeVar

import numpy as np

from companion.avoidance.geometry import Array

_Place = TypeVar("_Place", float, Array)

# The force at the surface is not finite; closer than this (in the caller's unit of length) it stops growing.
_CONTACT = 1e-3


def attraction(position: _Place, goal: _Place, gain: float) -> _Place:
    """Eq. 5: F_att = xi_att * (X_g - X), shape of the position; of numbers, along a line.

    It is the slope of half the squared distance; eq. 4 lost the square in print.
    """
    return gain * (goal - position)


def repulsion_magnitude(surface_distance: Array, reach: Array | float, gain: float) -> Array:
    """Length of eq. 7, the slope of eq. 6: xi_rep (1/rho - 1/rho_o) / rho^2 within rho_o, else 0.

    Finite at contact, shape (N,). `surface_distance` is rho = d - R_b, the distance to the obstacle's
    surface; `reach` is rho_o. Both share one unit of length, and the force depends on it: the outer layer
    uses rho_o itself as the unit.
    """
    inverse = 1.0 / np.maximum(surface_distance, _CONTACT)
    magnitude: Array = gain * np.maximum(inverse - 1.0 / reach, 0.0) * inverse * inverse
    return magnitude


def repulsion(rel_position: Array, magnitude: Array) -> Array:
    """Eq. 7: the force away from each obstacle, grad rho being the unit vector from it to us, shape (2, N).

    `rel_position` is obstacle minus own, (N, 2+), in any unit; `magnitude` is that of `repulsion_magnitude`.
    On top of its centre an obstacle pushes nowhere.
    """
    north, east = rel_position[:, 0], rel_position[:, 1]
    share = magnitude / np.maximum(np.hypot(north, east), 1e-9)
    return np.array([-north * share, -east * share])
