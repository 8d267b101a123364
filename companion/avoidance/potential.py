"""Potential field (paper §3.1, eq. 4-9): attraction to the goal, repulsion from obstacles within reach."""

import numpy as np

from companion.avoidance.geometry import Array

# The force at the surface is not finite; closer than this (in the caller's unit of length) it stops growing.
_CONTACT = 1e-3


def attraction(position: Array, goal: Array, gain: float) -> Array:
    """Eq. 5: F_att = xi_att * (X_g - X), shape of the position."""
    force: Array = gain * (goal - position)
    return force


def repulsion_magnitude(surface_distance: Array, reach: Array | float, gain: float) -> Array:
    """Eq. 8: xi_rep (1/rho - 1/rho_o) / rho^2 for rho within rho_o, else 0; finite at contact, shape (N,).

    `surface_distance` is rho = d - R_b, the distance to the obstacle's surface; `reach` is rho_o. Both share
    one unit of length, and the force depends on it: the outer layer uses rho_o itself as the unit.
    """
    rho = np.maximum(surface_distance, _CONTACT)
    return np.where(rho < reach, gain * (1.0 / rho - 1.0 / np.asarray(reach)) / rho**2, 0.0)
