"""Potential field (paper §3.1, eq. 4-9): attraction to the goal, repulsion from obstacles within reach."""

import math
from dataclasses import dataclass
from typing import Annotated, TypeVar

from annotated_types import Gt, Le

from companion.avoidance.geometry import Array
from companion.compiled import kernels
from companion.model import Vec2

_Place = TypeVar("_Place", float, Array)

# The force at the surface is infinite. Closer than this (in the caller's unit of length) it stops growing.
_CONTACT = 1e-3


@dataclass(frozen=True)
class FieldParams:
    """Gains of the field; the unit of length is the reach rho_o."""

    attraction_gain: Annotated[float, Gt(0)] = 1.0
    repulsion_gain: Annotated[float, Gt(0)] = 1.0
    # Larger turns are left to the inner layer.
    largest_deflection_rad: Annotated[float, Gt(0), Le(math.pi)] = math.radians(100.0)


def attraction(position: _Place, goal: _Place, gain: float) -> _Place:
    """Eq. 5: F_att = xi_att * (X_g - X), shape of the position; for numbers, along a line.

    It is the gradient of half the squared distance; eq. 4 is printed without the square.
    """
    return gain * (goal - position)


def repulsion_magnitude(surface_distance: Array, reach: float, gain: float) -> Array:
    """Length of eq. 7, the gradient of eq. 6: xi_rep (1/rho - 1/rho_o) / rho^2 within rho_o, else 0; (N,).

    Finite at contact. `surface_distance` is rho = d - R_b, the distance to the surface of the obstacle;
    `reach` is rho_o. Both share one unit of length, on which the force depends: the outer layer uses rho_o
    itself.
    """
    magnitude: Array = kernels.repulsion_magnitudes(surface_distance, reach, gain, _CONTACT)
    return magnitude


def repulsion(rel_position: Array, magnitude: Array) -> Vec2:
    """Eq. 7: the sum of the forces away from obstacles, north and east.

    grad rho is the unit vector from each obstacle to us. `rel_position` is obstacle minus own, (N, 2+), in
    any unit; `magnitude` comes from `repulsion_magnitude`. At its exact centre an obstacle exerts no force.
    """
    return kernels.repulsion(rel_position, magnitude)
