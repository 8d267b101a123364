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
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, Le
from numpy.typing import NDArray

from companion.avoidance.cost import Situation
from companion.avoidance.geometry import Array
from companion.avoidance.potential import attraction, repulsion, repulsion_magnitude
from companion.avoidance.strategies import Height, Speed, height_m, speed_mps
from companion.avoidance.trajectory import Commands
from companion.compiled import kernels
from companion.model import Guidance
from companion.units import wrap_pi

# The repulsion against an attraction of 1: deflections of 10 to 86 degrees, where all push straight across.
_GAINS = [math.tan(math.radians(angle_deg)) for angle_deg in (10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 86.0)]
_LEAST_PUSH = 1e-3
_GAIN_STEPS = [*_GAINS, *(-gain for gain in _GAINS)]  # to the right, to the left


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


class Threats(NamedTuple):
    """What repels, shape (N,) or (N, 2+)."""

    rel_position_m: Array  # threat minus own
    own_rel_velocity_mps: Array  # own minus threat
    surface_m: Array  # rho, the distance to the protected volume
    reach_m: Array  # rho_o


def resultant_rad(course_rad: float, goal_distance: float, threats: Threats, params: FieldParams) -> float:
    """Direction of the summed force (eq. 9): attraction to a goal on `course_rad`, repulsion by threats.

    `goal_distance` is in units of the outer layer's radius. Where the forces cancel, the goal's direction.
    """
    return _resultant_rad(course_rad, goal_distance, threats, _pushes(threats, params), params)


def _pushes(threats: Threats, params: FieldParams) -> Array:
    """How hard each threat pushes, (N,): its reach is the unit of length."""
    return repulsion_magnitude(threats.surface_m / threats.reach_m, 1.0, params.repulsion_gain)


def _resultant_rad(
    course_rad: float, goal_distance: float, threats: Threats, pushes: Array, params: FieldParams
) -> float:
    pull = attraction(0.0, goal_distance, params.attraction_gain)
    north, east = repulsion(threats.rel_position_m, pushes)
    north, east = north + pull * math.cos(course_rad), east + pull * math.sin(course_rad)
    return math.atan2(east, north) if math.hypot(north, east) > 1e-12 else course_rad


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
    pushes, limit_rad = _pushes(threats, params), params.largest_deflection_rad
    resultant = wrap_pi(_resultant_rad(course_rad, 1.0, threats, pushes, params) - course_rad)
    deflections_rad = [0.0, resultant, *_ladder(course_rad, threats, pushes)]
    courses_rad = [course_rad + min(max(turn_rad, -limit_rad), limit_rad) for turn_rad in deflections_rad]
    speeds_mps = [speed_mps(Speed.MISSION, situation)] * len(courses_rad)
    if speeds:
        courses_rad += [course_rad, course_rad]
        speeds_mps += [speed_mps(Speed.SLOWEST, situation), speed_mps(Speed.FASTEST, situation)]
    choices = (Height.MISSION, Height.OVER, Height.UNDER) if heights else (Height.MISSION,)
    heights_m = [height_m(choice, situation) for choice in choices]
    ground_of, height_of = _every_pair(len(courses_rad), len(choices))
    return Commands(np.array(courses_rad), np.array(speeds_mps), np.array(heights_m), ground_of, height_of)


@cache
def _every_pair(grounds: int, heights: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of each of the heights for each of the grounds: the places of both, (K,) each."""
    return np.repeat(np.arange(grounds), heights), np.tile(np.arange(heights), grounds)


def _ladder(course_rad: float, threats: Threats, pushes: Array) -> list[float]:
    """How far off the course the force points with every gain step, to the right, then to the left."""
    # Each pushes across our velocity relative to it, all to the right. Far out the field is too weak to
    # matter, near by too strong for any gentle way: what counts of the sum is its direction, in which each
    # threat has the share of its push.
    north, east = kernels.pushes_across(threats.own_rel_velocity_mps, pushes, _LEAST_PUSH, course_rad)
    if math.hypot(north, east) < 1e-9:
        return []  # nobody moves
    across_rad = math.atan2(east, north) - course_rad
    aside, along = math.sin(across_rad), math.cos(across_rad)
    # The attraction is as long as the sum: the gains alone say how far that deflects it.
    return [math.atan2(gain * aside, 1.0 + gain * along) for gain in _GAIN_STEPS]
