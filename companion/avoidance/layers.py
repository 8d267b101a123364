"""The layers as they fly by default: what is in conflict, the outer layer's rows, and which layer decides.

The outer layer avoids gently and early, by the potential field (paper §3.1, P4-P6) at aircraft scale. `inner`
has the strategy table of the other layer.

The paper flies the direction of the summed force (`resultant_command`). A field alone guarantees no distance,
and has minima without a way out. By default the field is only a source of rows (`field_commands`), which are
priced like any other rows. The mission attracts along its course. Every threat repels across our velocity
relative to it, where the miss distance grows fastest, and to both sides, because the gradient of a head-on
encounter has no side. The repulsion gain is raised in steps, and the rows of all steps, and the plain
resultant, are flown ahead; the cheapest that stays clear is flown. Each row is also tried above and below the
threats.

Lengths are in units of a reach rho_o, so that forces do not depend on scale: those of threats in their own
reach, the distance of the goal in the outer layer's radius.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.assess import EmergencyDetection, OuterDetection, TrafficAssessment
from companion.avoidance.cost import Conflict, CostContext, EvaluatedRows, Height, Speed, evaluate_rows
from companion.avoidance.inner import InnerLayer
from companion.avoidance.intruders import (
    RelativeMotion,
    Tracks,
    TransitionDomain,
    half_angle_rad,
)
from companion.avoidance.params import AvoidanceParams, FieldParams
from companion.avoidance.trajectory import Array, Commands, Control, Mask, OwnState
from companion.compiled import kernels
from companion.geodesy import wrap_pi
from companion.model import Goal, Guidance, Layer, Vec2

_Place = TypeVar("_Place", float, Array)
# The force at the surface is infinite. Closer than this (in the caller's unit of length) it stops growing.
_CONTACT = 1e-3
# Repulsion for an attraction of 1: deflections of 10 to 86 degrees where all threats push straight across.
_GAINS = [math.tan(math.radians(angle_deg)) for angle_deg in (10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 86.0)]
_GAIN_STEPS = [*_GAINS, *(-gain for gain in _GAINS)]  # to the right, to the left
_LEAST_PUSH = 1e-3


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


class RepellingTracks(NamedTuple):
    """The tracks that repel, (N,) or (N, 2+)."""

    rel_position_m: Array  # track minus own
    own_rel_velocity_mps: Array  # own minus track
    surface_m: Array  # rho, the distance to the protected volume
    reach_m: Array  # rho_o


def repelling_tracks(assessment: TrafficAssessment) -> RepellingTracks:
    """The tracks in conflict."""
    motion, conflict = assessment.motion, assessment.conflict
    every = RepellingTracks(
        motion.position_m, motion.own_velocity_mps, assessment.surface_m, assessment.outer_reach_m
    )
    if np.count_nonzero(conflict) == len(conflict):
        return every  # the usual case: a single track
    return RepellingTracks(*(column[conflict] for column in every))


def resultant_rad(
    course_rad: float, goal_distance: float, tracks: RepellingTracks, params: FieldParams
) -> float:
    """Direction of the summed force (eq. 9): attraction to a goal on `course_rad`, repulsion from tracks.

    `goal_distance` is in radii of the outer layer. Where the forces cancel, the direction of the goal.
    """
    return _resultant_rad(course_rad, goal_distance, tracks, _pushes(tracks, params), params)


def _pushes(tracks: RepellingTracks, params: FieldParams) -> Array:
    """Length of the force from each track, (N,), with its reach as the unit of length."""
    return repulsion_magnitude(tracks.surface_m / tracks.reach_m, 1.0, params.repulsion_gain)


def _resultant_rad(
    course_rad: float, goal_distance: float, tracks: RepellingTracks, pushes: Array, params: FieldParams
) -> float:
    pull = attraction(0.0, goal_distance, params.attraction_gain)
    north, east = repulsion(tracks.rel_position_m, pushes)
    north, east = north + pull * math.cos(course_rad), east + pull * math.sin(course_rad)
    return math.atan2(east, north) if math.hypot(north, east) > 1e-12 else course_rad


def resultant_command(context: CostContext, tracks: RepellingTracks, params: FieldParams) -> Commands:
    """The paper's single row: the course of the summed force, the mission's speed and height."""
    course_rad = resultant_rad(context.mission.course_rad, context.goal_distance, tracks, params)
    speed_mps = context.speed_mps(Speed.MISSION)
    return Commands.of([Guidance(course_rad, speed_mps, context.height_m(Height.MISSION))])


def field_commands(
    context: CostContext,
    tracks: RepellingTracks,
    params: FieldParams,
    *,
    turns: bool = True,
    heights: bool,
    speeds: bool,
) -> Commands:
    """Rows of the field: the mission's course, the resultant, the gain steps; with `heights` over and under.

    Without `turns` the mission's course alone.
    With `speeds` also the mission's course faster and slower: the way past an aircraft beside us that is as
    fast as we are.
    """
    course_rad = context.mission.course_rad
    pushes, limit_rad = _pushes(tracks, params), params.largest_deflection_rad
    resultant = wrap_pi(_resultant_rad(course_rad, 1.0, tracks, pushes, params) - course_rad)
    deflections_rad = [0.0, resultant, *_stepped_deflections_rad(course_rad, tracks, pushes)]
    if not turns:
        deflections_rad = [0.0]
    courses_rad = [course_rad + min(max(turn_rad, -limit_rad), limit_rad) for turn_rad in deflections_rad]
    speeds_mps = [context.speed_mps(Speed.MISSION)] * len(courses_rad)
    if speeds:
        courses_rad += [course_rad, course_rad]
        speeds_mps += [context.speed_mps(Speed.SLOWEST), context.speed_mps(Speed.FASTEST)]
    choices = (Height.MISSION, Height.OVER, Height.UNDER) if heights else (Height.MISSION,)
    heights_m = [context.height_m(choice) for choice in choices]
    ground_of, height_of = _every_pair(len(courses_rad), len(choices))
    return Commands(np.array(courses_rad), np.array(speeds_mps), np.array(heights_m), ground_of, height_of)


@cache
def _every_pair(grounds: int, heights: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of ground path and height for rows of every combination, (K,) each."""
    return np.repeat(np.arange(grounds), heights), np.tile(np.arange(heights), grounds)


def _stepped_deflections_rad(course_rad: float, tracks: RepellingTracks, pushes: Array) -> list[float]:
    """Angles from the course to the force with every gain step, to the right, then to the left."""
    # Each track pushes across our velocity relative to it, all to the right. The field is too weak to matter
    # far out, and too strong for a gentle turn near by. So only the direction of the sum is used, to which
    # each track contributes by its push.
    north, east = kernels.pushes_across(tracks.own_rel_velocity_mps, pushes, _LEAST_PUSH, course_rad)
    if math.hypot(north, east) < 1e-9:
        return []  # no relative motion
    across_rad = math.atan2(east, north) - course_rad
    aside, along = math.sin(across_rad), math.cos(across_rad)
    # The attraction is as long as the sum, so that the gains alone determine the deflection.
    return [math.atan2(gain * aside, 1.0 + gain * along) for gain in _GAIN_STEPS]


class OuterPolicy(OuterDetection, Protocol):
    """How the outer layer finds conflicts and steers."""

    @property
    def widening_rad(self) -> float:
        """The angle by which a collision cone is wider once we are inside it."""

    def evaluate(self, conflict: Conflict) -> EvaluatedRows:
        """The rows that the outer layer chooses from."""

    def accepts(self, rows: EvaluatedRows, context: CostContext) -> bool:
        """Whether the best of these rows may be flown; otherwise the inner layer decides."""


class LayerPolicy(Protocol):
    """Which layers there are, and which of them decides."""

    @property
    def holding_layer(self) -> Layer:
        """The layer that is shown while a guidance is held before the return."""

    @property
    def cooperates(self) -> bool:
        """Whether conflicts within our group may be answered jointly."""

    @property
    def waits(self) -> bool:
        """Whether an avoidance begins only when it has to."""

    def conflict(self, outer: Mask, emergency: Mask) -> Mask:
        """Which tracks are in conflict, from those of each layer, (N,) each."""

    def choose(
        self, conflict: Conflict, outer: OuterPolicy, inner: InnerLayer, last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        """The layer that decides, and its rows; `last` is the layer of the last decision."""


class Policy(NamedTuple):
    """One variant of the avoidance: its outer layer, its emergencies, and which layer decides.

    `has_fast_path`: `assess.needs_no_assessment` is valid for it. It is not for the paper's variants, which
    look along the velocity flown, nor for members of a group, which can be in conflict outside the layers.
    """

    outer: OuterPolicy
    emergency: EmergencyDetection
    layers: LayerPolicy
    has_fast_path: bool

    def conflict(self, outer: Mask, emergency: Mask) -> Mask:
        """Which tracks are in conflict, from those of each layer, (N,) each."""
        return self.layers.conflict(outer, emergency)


class PricedField:
    """The default: flying the mission ahead confirms conflicts, and the rows of the field are priced."""

    def __init__(self, params: AvoidanceParams) -> None:
        self.widening_rad = params.delta_beta_rad
        self._gains, self._controls = params.field_gains, params.controls
        self.turns = True  # whether courses can be commanded

    def in_cone(
        self,
        _state: OwnState,
        tracks: Tracks,
        motion: RelativeMotion,
        _velocity_mps: Array,
        domain: TransitionDomain,
    ) -> Mask:
        """The tracks whose cone the mission's velocity points into, (N,)."""
        radius_m = tracks.protected_horizontal_m + tracks.buffer_m
        return domain.covers(tracks.ids, motion.approach_rad, half_angle_rad(motion.distance_m, radius_m))

    def confirmed(self, within: Mask, too_near: Mask) -> Mask:
        """Those that the mission comes too near to."""
        return within & too_near

    def remember(self, domain: TransitionDomain, ids: Sequence[str], conflict: Mask) -> None:
        """Enter the cones of these conflicts, and leave all others."""
        domain.keep(ids, conflict)

    def evaluate(self, conflict: Conflict) -> EvaluatedRows:
        """The rows of the field; in overtime also with other speeds."""
        context = conflict.context
        rows = field_commands(
            context,
            repelling_tracks(conflict.assessment),
            self._gains,
            turns=self.turns,
            heights=Control.HEIGHT in self._controls,
            speeds=context.overtime > 0.0 and Control.SPEED in self._controls,
        )
        return evaluate_rows(context, rows, conflict.urgent, conflict.last_guidance)

    def accepts(self, rows: EvaluatedRows, context: CostContext) -> bool:
        """Whether the best row keeps clear of the bare volumes and is allowed."""
        keeps_clear = rows.closest[rows.best] >= context.breach_ratio
        return bool(keeps_clear) and rows.best_is_allowed(context.refusals)


class PredictedBreach:
    """An emergency is a near track to which the mission, flown ahead, comes too near."""

    def buffered(self, tracks: Tracks, _goal: Goal) -> Tracks:
        """No buffers."""
        return tracks

    def reach_m(self, _tracks: Tracks, inner_reach_m: Array) -> Array:
        """The reach by distance or time."""
        return inner_reach_m

    def confirmed(self, within: Mask, too_near: Mask) -> Mask:
        """Those that the mission comes too near to."""
        return within & too_near


class BothLayers:
    """Both layers are in use, and conflicts of either count."""

    holding_layer = Layer.OUTER
    cooperates = True
    waits = False

    def conflict(self, outer: Mask, emergency: Mask) -> Mask:
        """Those of either layer."""
        return outer | emergency


class OuterFirst(BothLayers):
    """The outer layer decides as long as it keeps clear, also of near threats.

    The inner layer takes over when the outer one has no acceptable row, or when a threat is near at first
    sight. It then continues until the margin is regained, so that the layers do not alternate.
    """

    waits = True

    def choose(
        self, conflict: Conflict, outer: OuterPolicy, inner: InnerLayer, last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        """The layer that decides, and its rows."""
        if conflict.is_emergency and last is Layer.INNER:
            rows = inner.evaluate(conflict)
            has_margin = rows.closest[rows.best] >= 1.0
            return Layer.OUTER if has_margin else Layer.INNER, rows
        if last is not Layer.CLEAR or not conflict.is_emergency:
            rows = outer.evaluate(conflict)
            if outer.accepts(rows, conflict.context):
                return Layer.OUTER, rows
        return Layer.INNER, inner.evaluate(conflict)
