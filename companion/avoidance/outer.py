"""Outer layer: gentle, early avoidance by the potential field (paper §3.1, P4-P6) at aircraft scale.

The paper flies the direction of the summed force, with every obstacle repelling, or only those whose
collision cone we are in, or the same with the memory of the transition domain: `OuterMethod` selects among
them. A field alone promises no distance, and has minima without a way out; what flies by default is `PRICED`,
which takes the field as a source of ways. The mission attracts along its course; every threat repels, across
our velocity relative to it, since that is where the miss distance grows fastest; on either side, as the side
of a head-on encounter is nobody's gradient. The repulsion gain is raised step by step, and every flight it
leads to is predicted and priced with the others, the plain resultant among them; the cheapest that keeps
clear is flown. Above and below the threats the same field has two more ways, which need no deviation at all.

Lengths are in units of a reach rho_o, so that the forces do not depend on scale: those of threats in their
own, the distance of the goal in that of the outer layer's radius.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Annotated

import numpy as np
from annotated_types import Gt, Le
from numpy.typing import NDArray

from companion.avoidance.geometry import Array, wrap_pi
from companion.avoidance.potential import attraction, repulsion, repulsion_magnitude
from companion.avoidance.prediction import Commands
from companion.avoidance.pricing import Situation
from companion.avoidance.strategies import Height, Speed, height_m, speed_mps
from companion.model import Guidance

# The repulsion against an attraction of 1: deflections of 10 to 86 degrees, where all push straight across.
_GAINS = np.tan(np.radians([10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 86.0]))
_GAIN_STEPS = np.concatenate([_GAINS, -_GAINS])  # to the right, to the left


class OuterMethod(StrEnum):
    """How the outer layer steers, from the plain field (eq. 9) to what flies."""

    FIELD = "field"  # every obstacle within reach repels
    CONE = "cone"  # those in conflict whose cone our relative velocity points into
    TRANSITION = "transition"  # the same, with the memory of the transition domain
    PRICED = "priced"  # the same, strengthened to both sides, flown ahead and priced


@dataclass(frozen=True)
class FieldParams:
    """Gains of the field; the unit of length is the reach rho_o."""

    attraction_gain: Annotated[float, Gt(0)] = 1.0
    repulsion_gain: Annotated[float, Gt(0)] = 1.0
    # A larger turn is an emergency, and the inner layer's business.
    largest_deflection_rad: Annotated[float, Gt(0), Le(math.pi)] = math.radians(100.0)


@dataclass(frozen=True, slots=True)
class Threats:
    """What repels, shape (N,) or (N, 2+)."""

    rel_position_m: Array  # threat minus own
    own_rel_velocity_mps: Array  # own minus threat
    surface_m: Array  # rho, the distance to the protected volume
    reach_m: Array  # rho_o


def resultant_rad(course_rad: float, goal_distance: float, threats: Threats, params: FieldParams) -> float:
    """Direction of the summed force (eq. 9): attraction to a goal on `course_rad`, repulsion by threats.

    `goal_distance` is in units of the outer layer's radius. Where the forces cancel, the goal's direction.
    """
    ahead = np.array([math.cos(course_rad), math.sin(course_rad)])
    pull = attraction(np.zeros(2), goal_distance * ahead, params.attraction_gain)
    push = repulsion(
        threats.rel_position_m[:, :2], threats.surface_m / threats.reach_m, 1.0, params.repulsion_gain
    )
    force = pull + push.sum(axis=0)
    return math.atan2(force[1], force[0]) if math.hypot(force[0], force[1]) > 1e-12 else course_rad


def resultant_command(situation: Situation, threats: Threats, params: FieldParams) -> Commands:
    """The paper's one row: the course of the summed force, the mission's speed and height."""
    course_rad = resultant_rad(situation.mission.course_rad, situation.goal_distance, threats, params)
    speed = speed_mps(Speed.MISSION, situation)
    return Commands.of([Guidance(course_rad, speed, height_m(Height.MISSION, situation))])


def field_commands(
    situation: Situation, threats: Threats, params: FieldParams, *, heights: bool, speeds: bool
) -> Commands:
    """Rows of the field: the mission's course, the resultant, the ladder; with `heights` over and under.

    With `speeds` also the mission's course faster and slower: beside somebody who flies as fast as we do,
    that is the way past him.
    """
    course_rad = situation.mission.course_rad
    wanted_rad = np.concatenate(
        [[resultant_rad(course_rad, 1.0, threats, params)], _ladder(course_rad, threats, params)]
    )
    limit_rad = params.largest_deflection_rad
    deflected_rad = np.minimum(np.maximum(wrap_pi(wanted_rad - course_rad), -limit_rad), limit_rad)
    paces = (Speed.SLOWEST, Speed.FASTEST) if speeds else ()
    courses_rad = np.concatenate([[course_rad], course_rad + deflected_rad, [course_rad] * len(paces)])
    choices = (Height.MISSION, Height.OVER, Height.UNDER) if heights else (Height.MISSION,)
    ground_of, height_of = _every_pair(len(courses_rad), len(choices))
    heights_m = np.array([height_m(choice, situation) for choice in choices])
    speeds_mps = np.full(len(courses_rad), speed_mps(Speed.MISSION, situation))
    if paces:
        speeds_mps[-len(paces) :] = [speed_mps(pace, situation) for pace in paces]
    return Commands(courses_rad, speeds_mps, heights_m, ground_of, height_of)


@cache
def _every_pair(grounds: int, heights: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of each of the heights for each of the grounds: the places of both, (K,) each."""
    return np.repeat(np.arange(grounds), heights), np.tile(np.arange(heights), grounds)


def _ladder(course_rad: float, threats: Threats, params: FieldParams) -> Array:
    """Courses of the force with every gain step, to the right, then to the left."""
    ahead = np.array([math.cos(course_rad), math.sin(course_rad)])
    pull = attraction(np.zeros(2), ahead, params.attraction_gain)
    push = repulsion_magnitude(threats.surface_m / threats.reach_m, 1.0, params.repulsion_gain)
    north_mps, east_mps = threats.own_rel_velocity_mps[:, 0], threats.own_rel_velocity_mps[:, 1]
    # Across our velocity relative to each, all to the right: north and east, (2, N).
    to_right = np.where(ahead[0] * north_mps + ahead[1] * east_mps < 0.0, -1.0, 1.0)
    across = np.array([-east_mps, north_mps]) * (to_right / np.maximum(np.hypot(north_mps, east_mps), 1e-6))
    # Far out the field is too weak to matter, near by too strong for any gentle way: what counts of the sum
    # is its direction, in which each threat has the share of its push.
    total = across @ np.maximum(push, 1e-3)
    total *= params.attraction_gain / max(math.hypot(total[0], total[1]), 1e-9)
    courses_rad: Array = np.arctan2(pull[1] + _GAIN_STEPS * total[1], pull[0] + _GAIN_STEPS * total[0])
    return courses_rad
