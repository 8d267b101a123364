"""Outer layer: gentle, early avoidance by the potential field (paper §3.1, P4-P6) at aircraft scale.

The mission attracts with unit force along its course. Every threat repels, across our velocity relative to
it, since that is where the miss distance grows fastest; on either side, as the side of a head-on encounter
is nobody's gradient. Lengths are in units of each threat's reach rho_o, so the force does not depend on
scale. A field alone promises no distance, so its repulsion gain is raised step by step and every flight it
leads to is predicted and priced with the others; the cheapest that keeps clear is flown. Above and below the
threats the same field has two more ways, which need no deviation at all.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Le

from companion.avoidance.geometry import Array, wrap_pi
from companion.avoidance.potential import attraction, repulsion_magnitude
from companion.avoidance.prediction import Commands
from companion.avoidance.strategies import Height, Situation, Speed, height_m, speed_mps

_GAIN_STEPS = np.array([0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0])


@dataclass(frozen=True)
class FieldParams:
    """Gains of the field; the unit of length is the reach rho_o of each threat."""

    attraction_gain: Annotated[float, Gt(0)] = 1.0
    repulsion_gain: Annotated[float, Gt(0)] = 1.0
    # A larger turn is an emergency, and the inner layer's business.
    largest_deflection_rad: Annotated[float, Gt(0), Le(math.pi)] = math.radians(100.0)


def field_commands(
    situation: Situation,
    own_rel_velocity_mps: Array,
    surface_distance_m: Array,
    reach_m: Array,
    params: FieldParams,
) -> Commands:
    """Rows of the field for threats given by own-minus-other velocity (N, 2+), rho (N,) and rho_o (N,)."""
    course_rad = situation.mission.course_rad
    push = repulsion_magnitude(surface_distance_m / reach_m, 1.0, params.repulsion_gain)
    deflected_rad = _deflected(course_rad, own_rel_velocity_mps, push, params)
    courses_rad = np.concatenate([[course_rad], deflected_rad])
    rows = len(deflected_rad) + 3
    ground_of, height_of = np.zeros(rows, dtype=np.intp), np.zeros(rows, dtype=np.intp)
    height_of[1:3] = 1, 2  # straight on over, and under; around on the mission's height
    ground_of[3:] = np.arange(1, len(courses_rad))
    heights_m = np.array(
        [height_m(choice, situation) for choice in (Height.MISSION, Height.OVER, Height.UNDER)]
    )
    speeds_mps = np.full(len(courses_rad), speed_mps(Speed.MISSION, situation))
    return Commands(courses_rad, speeds_mps, heights_m, ground_of, height_of)


def _deflected(course_rad: float, own_rel_velocity_mps: Array, push: Array, params: FieldParams) -> Array:
    """Courses of the summed force (eq. 9), to the right for every gain step, then to the left."""
    ahead = np.array([math.cos(course_rad), math.sin(course_rad)])
    right = np.array([-ahead[1], ahead[0]])
    pull = attraction(np.zeros(2), ahead, params.attraction_gain)
    speed = np.maximum(np.hypot(own_rel_velocity_mps[:, 0], own_rel_velocity_mps[:, 1]), 1e-6)
    across = np.stack([-own_rel_velocity_mps[:, 1], own_rel_velocity_mps[:, 0]], axis=1) / speed[:, None]
    across *= np.where(across @ right < 0.0, -1.0, 1.0)[:, None]  # all threats push to one side
    # Far out the field is too weak to matter; a floor keeps the ladder of gains from starting at nothing.
    total = (np.maximum(push, 0.1)[:, None] * across).sum(axis=0)
    steps = np.concatenate([_GAIN_STEPS, -_GAIN_STEPS])[:, None]
    force = pull + steps * total
    deflection_rad = wrap_pi(np.arctan2(force[:, 1], force[:, 0]) - course_rad)
    limit_rad = params.largest_deflection_rad
    return course_rad + np.clip(deflection_rad, -limit_rad, limit_rad)
