"""The position and the orientation of the frame do not affect decisions."""

import math

import numpy as np
import pytest
from hypothesis import given, settings

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.cost import Conflict, EvaluatedRows
from companion.avoidance.inner import InnerLayer
from companion.avoidance.layers import LayerPolicy, OuterPolicy
from companion.avoidance.trajectory import Mask
from companion.geodesy import wrap_pi
from companion.model import Layer, Ownship, Vec3
from tests.support.avoidance_cases import (
    ALL_VARIANTS,
    Case,
    cases,
    frames,
    later,
    seen_from,
    variant_name,
)


class RecordingLayers:
    """A layer policy that keeps the rows of its last choice."""

    def __init__(self, layers: LayerPolicy) -> None:
        self._layers = layers
        self.holding_layer, self.cooperates, self.waits = layers.holding_layer, layers.cooperates, False
        self.conflict = layers.conflict
        self.rows: EvaluatedRows | None = None

    def choose(
        self, conflict: Conflict, outer: OuterPolicy, inner: InnerLayer, last: Layer
    ) -> tuple[Layer, EvaluatedRows]:
        layer, self.rows = self._layers.choose(conflict, outer, inner, last)
        return layer, self.rows


def recording_avoider(params: AvoidanceParams) -> tuple[Avoider, RecordingLayers]:
    avoider = Avoider(params)
    layers = RecordingLayers(avoider._policy.layers)
    avoider._policy = avoider._policy._replace(layers=layers)
    return avoider, layers


def without_u_turns(rows: EvaluatedRows, own: Ownship) -> Mask:
    """Rows that do not turn by exactly 180 degrees: rounding would decide the side of such a turn."""
    course_rad = math.atan2(own.velocity_mps[1], own.velocity_mps[0])
    turn_rad = np.abs((rows.commands.course_rad - course_rad + math.pi) % (2.0 * math.pi) - math.pi)
    grounds: Mask = turn_rad < math.pi - 1e-6
    return grounds[rows.commands.ground_of]


def has_clear_choice(rows: EvaluatedRows, usable: Mask, gap: float) -> bool:
    """Whether all rows that differ from the best one cost more than it by at least the gap."""
    best = rows.best
    if not usable[best]:
        return False
    chosen = rows.best_guidance
    for row in np.flatnonzero(rows.cost < rows.cost[best] + gap).tolist():
        other = rows.commands.row(row)
        if abs(wrap_pi(other.course_rad - chosen.course_rad)) > 1e-6 or (
            other.airspeed_mps,
            other.altitude_m,
        ) != (chosen.airspeed_mps, chosen.altitude_m):
            return False
    return True


# Single precision of a prediction over some kilometres, times the price of depth.
COST_ROUNDING = 0.05


@pytest.mark.parametrize("params", ALL_VARIANTS, ids=variant_name)
@settings(max_examples=12, deadline=None, derandomize=True)
@given(case=cases(), frame=frames())
def test_a_rotated_and_shifted_frame_rotates_every_guidance(
    params: AvoidanceParams, case: Case, frame: tuple[float, Vec3]
) -> None:
    """Two decisions, so that the memory (cones entered, last guidance, course of the rule) rotates too.

    If two different rows cost the same, rounding may decide between them. Then only costs are compared.
    """
    (one, one_layers), (other, other_layers) = recording_avoider(params), recording_avoider(params)
    for moment_s in (0.0, 1.0):
        case_now = later(case, moment_s)
        own = case_now[0]
        first = one.decide(moment_s, *case_now)
        second = other.decide(moment_s, *seen_from(case_now, *frame))
        assert first.layer is second.layer
        assert [threat.track_id for threat in first.threats] == [threat.track_id for threat in second.threats]
        if first.guidance is None or second.guidance is None:
            assert first.guidance is second.guidance
            continue
        if one_layers.rows is not None and other_layers.rows is not None and first.threats:
            usable = without_u_turns(one_layers.rows, own)
            costs = one_layers.rows.cost[usable], other_layers.rows.cost[usable]
            assert np.allclose(*costs, atol=COST_ROUNDING)
            if not has_clear_choice(one_layers.rows, usable, 2.0 * COST_ROUNDING):
                return
        turn_rad = second.guidance.course_rad - first.guidance.course_rad
        assert abs(wrap_pi(turn_rad - frame[0])) < 1e-6
        assert math.isclose(first.guidance.airspeed_mps, second.guidance.airspeed_mps)
        assert math.isclose(first.guidance.altitude_m, second.guidance.altitude_m, abs_tol=1e-6)
