"""Potential field (paper §3.1, eq. 4-9): attraction to the goal, repulsion from obstacles within reach."""

from typing import TypeVar

from companion.avoidance.geometry import Array
from companion.compiled import kernels
from companion.model import Vec2

_Place = TypeVar("_Place", float, Array)

# The force at the surface is not finite; closer than this (in the caller's unit of length) it stops growing.
_CONTACT = 1e-3


def attraction(position: _Place, goal: _Place, gain: float) -> _Place:
    """Eq. 5: F_att = xi_att * (X_g - X), shape of the position; of numbers, along a line.

    It is the slope of half the squared distance; eq. 4 lost the square in print.
    """
    return gain * (goal - position)


def repulsion_magnitude(surface_distance: Array, reach: float, gain: float) -> Array:
    """Length of eq. 7, the slope of eq. 6: xi_rep (1/rho - 1/rho_o) / rho^2 within rho_o, else 0.

    Finite at contact, shape (N,). `surface_distance` is rho = d - R_b, the distance to the obstacle's
    surface; `reach` is rho_o. Both share one unit of length, and the force depends on it: the outer layer
    uses rho_o itself as the unit.
    """
    magnitude: Array = kernels.repulsion_magnitudes(surface_distance, reach, gain, _CONTACT)
    return magnitude


def repulsion(rel_position: Array, magnitude: Array) -> Vec2:
    """Eq. 7: the forces away from obstacles summed, grad rho being the unit vector from each of them to us.

    North and east; `rel_position` is obstacle minus own, (N, 2+), in any unit; `magnitude` is that of
    `repulsion_magnitude`. On top of its centre an obstacle pushes nowhere.
    """
    return kernels.repulsion(rel_position, magnitude)
