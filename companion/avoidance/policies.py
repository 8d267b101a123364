"""Layer policies: the choice between what flies by default (`layers`) and the variants of the paper.

`policy_of` chooses one when the parameters are set.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from companion.avoidance.cost import Conflict, CostContext, EvaluatedRows, evaluate_rows
from companion.avoidance.inner import InnerLayer
from companion.avoidance.intruders import (
    RelativeMotion,
    Tracks,
    TransitionDomain,
    approach_angle_rad,
    half_angle_rad,
)
from companion.avoidance.layers import (
    BothLayers,
    LayerPolicy,
    OuterFirst,
    OuterPolicy,
    Policy,
    PredictedBreach,
    PricedField,
    repelling_tracks,
    resultant_command,
)
from companion.avoidance.params import AvoidanceParams, Layers, OuterMethod
from companion.avoidance.trajectory import Array, Control, Mask, OwnState
from companion.model import Goal, Layer


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
    return Policy(outer, emergency, layers, has_fast_path=by_default and not params.formation.configured)


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


class InnerByDistance(BothLayers):
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
    waits = False

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
    waits = False

    def conflict(self, _outer: Mask, emergency: Mask) -> Mask:
        """Those of the inner layer."""
        return emergency

    def choose(
        self, conflict: Conflict, _outer: OuterPolicy, inner: InnerLayer, _last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        """The inner layer."""
        return Layer.INNER, inner.evaluate(conflict)
