"""Policies: which variant the parameters choose, and what the variants do differently."""

from dataclasses import replace

import numpy as np
import pytest

from companion.avoidance import AvoidanceParams, Avoider
from companion.avoidance.assess import protected_tracks
from companion.avoidance.layers import OuterFirst, PredictedBreach, PricedField
from companion.avoidance.params import Layers, OuterMethod
from companion.avoidance.policies import (
    ClearedSphere,
    ConeField,
    InnerByDistance,
    InnerOnly,
    OuterOnly,
    PlainField,
    TransitionField,
    policy_of,
)
from companion.model import Goal, Layer, Ownship, Track

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)
HEAD_ON = Track("A", 0.0, (2000.0, 0.0, -300.0), (-50.0, 0.0, 0.0))
DEFAULTS = AvoidanceParams()
CLEARING = replace(DEFAULTS, weights=replace(DEFAULTS.weights, nearness=10.0))


def test_by_default_the_outer_layer_comes_first_and_the_fast_path_is_used() -> None:
    policy = policy_of(DEFAULTS)
    assert isinstance(policy.outer, PricedField)
    assert isinstance(policy.emergency, PredictedBreach)
    assert isinstance(policy.layers, OuterFirst)
    assert policy.has_fast_path


@pytest.mark.parametrize(
    ("method", "kind", "widening_rad"),
    [
        (OuterMethod.PRICED, PricedField, DEFAULTS.delta_beta_rad),
        (OuterMethod.TRANSITION, TransitionField, DEFAULTS.delta_beta_rad),
        (OuterMethod.CONE, ConeField, 0.0),
        (OuterMethod.FIELD, PlainField, 0.0),
    ],
)
def test_every_outer_method_has_its_policy(method: OuterMethod, kind: type, widening_rad: float) -> None:
    policy = policy_of(replace(DEFAULTS, outer_method=method))
    assert type(policy.outer) is kind
    assert policy.outer.widening_rad == widening_rad
    assert policy.has_fast_path is (method is OuterMethod.PRICED)


@pytest.mark.parametrize(
    "params", [CLEARING, *(replace(DEFAULTS, outer_method=m) for m in OuterMethod if m != "priced")]
)
def test_the_papers_two_layers_are_chosen_by_distance(params: AvoidanceParams) -> None:
    assert isinstance(policy_of(params).layers, InnerByDistance)
    assert not policy_of(params).has_fast_path


@pytest.mark.parametrize("params", [DEFAULTS, CLEARING])
@pytest.mark.parametrize(
    ("layers", "kind", "holding"),
    [(Layers.OUTER, OuterOnly, Layer.OUTER), (Layers.INNER, InnerOnly, Layer.INNER)],
)
def test_a_single_layer_is_shown_while_holding_and_does_not_cooperate(
    params: AvoidanceParams, layers: Layers, kind: type, holding: Layer
) -> None:
    policy = policy_of(replace(params, layers=layers)).layers
    assert type(policy) is kind
    assert policy.holding_layer is holding
    assert not policy.cooperates


def test_the_cleared_sphere_is_a_buffer_that_ends_at_the_goal() -> None:
    tracks = protected_tracks(0.0, [HEAD_ON], CLEARING)
    sphere = policy_of(CLEARING).emergency
    assert isinstance(sphere, ClearedSphere)
    assert sphere.buffered(tracks, GOAL).buffer_m == pytest.approx([CLEARING.inner_radius_m])
    protected_m = float(tracks.protected_horizontal_m[0])
    near = Goal(position_m=(2000.0 - protected_m - 100.0, 0.0, -300.0))
    assert sphere.buffered(tracks, near).buffer_m == pytest.approx([100.0])
    within = Goal(position_m=(2000.0, 0.0, -300.0))
    assert sphere.buffered(tracks, within).buffer_m == pytest.approx([0.0])


def test_by_default_there_are_no_buffers() -> None:
    tracks = protected_tracks(0.0, [HEAD_ON], DEFAULTS)
    assert not policy_of(DEFAULTS).emergency.buffered(tracks, GOAL).buffer_m.any()


def test_every_method_except_priced_ignores_whether_the_mission_comes_too_near() -> None:
    within, too_near = np.array([True, True]), np.array([True, False])
    for method in OuterMethod:
        confirmed = policy_of(replace(DEFAULTS, outer_method=method)).outer.confirmed(within, too_near)
        assert confirmed.tolist() == [True, method is not OuterMethod.PRICED]


@pytest.mark.parametrize(("method", "repels"), [(OuterMethod.FIELD, True), (OuterMethod.CONE, False)])
def test_a_track_beside_us_repels_only_in_the_plain_field(method: OuterMethod, repels: bool) -> None:
    """The track is within reach, but we are not in its cone; with cones only conflicts repel."""
    params = AvoidanceParams(outer_method=method, layers=Layers.OUTER)
    beside = Track("B", 0.0, (0.0, 1200.0, -300.0), (22.0, 0.0, 0.0))
    alone, both = (
        Avoider(params).decide(0.0, OWN, tracks, GOAL).guidance for tracks in ([HEAD_ON], [HEAD_ON, beside])
    )
    assert alone is not None
    assert both is not None
    assert (both.course_rad != alone.course_rad) is repels
