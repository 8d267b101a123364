"""Layer policies: what flies by default, and beside it the variants that the paper compares.

`policy_of` chooses one when the parameters are set. A policy has three parts: the outer layer's (which tracks
are in conflict, and how it steers), the inner layer's (what is an emergency), and which layer decides.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from companion.avoidance.assess import EmergencyDetection, OuterDetection
from companion.avoidance.cone import (
    Array,
    Mask,
    RelativeMotion,
    TransitionDomain,
    approach_angle_rad,
    half_angle_rad,
)
from companion.avoidance.cost import Conflict, CostContext, EvaluatedRows, evaluate_rows
from companion.avoidance.envelope import Control
from companion.avoidance.inner import InnerLayer
from companion.avoidance.intruders import Tracks
from companion.avoidance.outer import field_commands, repelling_tracks, resultant_command
from companion.avoidance.params import AvoidanceParams, Layers, OuterMethod
from companion.avoidance.trajectory import OwnState
from companion.model import Goal, Layer


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

    def conflict(self, outer: Mask, emergency: Mask) -> Mask:
        """Which tracks are in conflict, from those of each layer, (N,) each."""

    def choose(
        self, conflict: Conflict, outer: OuterPolicy, inner: InnerLayer, last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        """The layer that decides, and its rows; `last` is the layer of the last decision."""


class Policy(NamedTuple):
    """One variant of the avoidance.

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


def policy_of(params: AvoidanceParams, lost: frozenset[Control] = frozenset()) -> Policy:
    """The policy that the parameters ask for, without the controls that are `lost`."""
    outer = _OUTER[params.outer_method](params)
    if isinstance(outer, PricedField):
        outer.turns = Control.HEADING not in lost
    clears_sphere = params.weights.nearness > 0.0
    emergency = ClearedSphere(params.inner_radius_m) if clears_sphere else PredictedBreach()
    by_default = params.outer_method is OuterMethod.PRICED and not clears_sphere
    layers: LayerPolicy = OuterFirst() if by_default else InnerByDistance()
    if params.layers is not Layers.BOTH:
        layers = OuterOnly() if params.layers is Layers.OUTER else InnerOnly()
    return Policy(outer, emergency, layers, has_fast_path=by_default and not params.formation.own_id)


# --- What flies by default.


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


class _BothLayers:
    holding_layer = Layer.OUTER
    cooperates = True

    def conflict(self, outer: Mask, emergency: Mask) -> Mask:
        """Those of either layer."""
        return outer | emergency


class OuterFirst(_BothLayers):
    """The outer layer decides as long as it keeps clear, also of near threats.

    The inner layer takes over when the outer one has no acceptable row, or when a threat is near at first
    sight. It then continues until the margin is regained, so that the layers do not alternate.
    """

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


# --- The paper's variants.


class PlainField:
    """The paper's plain field: every track within reach is in conflict; the summed force gives the course."""

    widening_rad = 0.0

    def __init__(self, params: AvoidanceParams) -> None:
        self._gains = params.field_gains

    def in_cone(
        self,
        _state: OwnState,
        tracks: Tracks,
        _motion: RelativeMotion,
        _velocity_mps: Array,
        _domain: TransitionDomain,
    ) -> Mask:
        """All tracks, because there is no cone, (N,)."""
        return np.ones(len(tracks), dtype=bool)

    def confirmed(self, within: Mask, _too_near: Mask) -> Mask:
        """All within reach."""
        return within

    def remember(self, _domain: TransitionDomain, _ids: Sequence[str], _conflict: Mask) -> None:
        """Does nothing, because there is no cone."""

    def evaluate(self, conflict: Conflict) -> EvaluatedRows:
        """One row, the direction of the summed force."""
        context = conflict.context
        row = resultant_command(context, repelling_tracks(conflict.assessment), self._gains)
        return evaluate_rows(context, row, conflict.urgent, None)

    def accepts(self, rows: EvaluatedRows, context: CostContext) -> bool:
        """Whether the row keeps the fence and was not refused."""
        return rows.best_is_allowed(context.refusals)


class ConeField(PlainField):
    """The field of the tracks whose collision cone we are in, along the velocity flown."""

    def in_cone(
        self,
        state: OwnState,
        tracks: Tracks,
        motion: RelativeMotion,
        velocity_mps: Array,
        domain: TransitionDomain,
    ) -> Mask:
        """The tracks whose cone the velocity flown points into, (N,)."""
        alpha_rad = approach_angle_rad(motion.position_m, state.velocity_mps - velocity_mps)
        beta1_rad = half_angle_rad(motion.distance_m, tracks.protected_horizontal_m)
        return domain.covers(tracks.ids, alpha_rad, beta1_rad)

    def remember(self, domain: TransitionDomain, ids: Sequence[str], conflict: Mask) -> None:
        """Enter the cones of these conflicts, and leave all others."""
        domain.keep(ids, conflict)


class TransitionField(ConeField):
    """`ConeField` with the transition domain: a cone is wider once we are inside."""

    def __init__(self, params: AvoidanceParams) -> None:
        super().__init__(params)
        self.widening_rad = params.delta_beta_rad


_OUTER: dict[OuterMethod, type[PricedField] | type[PlainField]] = {
    OuterMethod.PRICED: PricedField,
    OuterMethod.FIELD: PlainField,
    OuterMethod.CONE: ConeField,
    OuterMethod.TRANSITION: TransitionField,
}


class ClearedSphere:
    """The paper's inner layer (§2.3): the aircraft keeps clear of a sphere around each track."""

    def __init__(self, radius_m: float) -> None:
        self._radius_m = radius_m

    def buffered(self, tracks: Tracks, goal: Goal) -> Tracks:
        """With the radius as buffer, but not beyond the goal, which could not be reached otherwise."""
        if goal.position_m is None:
            return replace(tracks, buffer_m=np.full(len(tracks), self._radius_m))
        to_goal = tracks.position_m[:, :2] - np.array(goal.position_m[:2])
        to_goal_m: Array = np.hypot(to_goal[:, 0], to_goal[:, 1])
        buffer_m = np.clip(to_goal_m - tracks.protected_horizontal_m, 0.0, self._radius_m)
        return replace(tracks, buffer_m=buffer_m)

    def reach_m(self, tracks: Tracks, _inner_reach_m: Array) -> Array:
        """The buffer."""
        return tracks.buffer_m

    def confirmed(self, within: Mask, _too_near: Mask) -> Mask:
        """All within reach."""
        return within


class InnerByDistance(_BothLayers):
    """The paper's two layers (§2.3): the inner layer decides whenever a track is within its reach."""

    def choose(
        self, conflict: Conflict, outer: OuterPolicy, inner: InnerLayer, _last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        """The layer that decides, and its rows; the inner one also where the outer one finds no way."""
        if not conflict.is_emergency:
            rows = outer.evaluate(conflict)
            if outer.accepts(rows, conflict.context):
                return Layer.OUTER, rows
        return Layer.INNER, inner.evaluate(conflict)


class OuterOnly:
    """The outer layer alone."""

    holding_layer = Layer.OUTER
    cooperates = False

    def conflict(self, outer: Mask, _emergency: Mask) -> Mask:
        """Those of the outer layer."""
        return outer

    def choose(
        self, conflict: Conflict, outer: OuterPolicy, _inner: InnerLayer, _last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        """The outer layer, whether its row is acceptable or not."""
        return Layer.OUTER, outer.evaluate(conflict)


class InnerOnly:
    """The inner layer alone."""

    holding_layer = Layer.INNER
    cooperates = False

    def conflict(self, _outer: Mask, emergency: Mask) -> Mask:
        """Those of the inner layer."""
        return emergency

    def choose(
        self, conflict: Conflict, _outer: OuterPolicy, inner: InnerLayer, _last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        """The inner layer."""
        return Layer.INNER, inner.evaluate(conflict)
