"""Properties of the collision cone, and of the transition domain, its memory."""

import math
from collections.abc import Sequence

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from companion.avoidance.intruders import TransitionDomain, approach_angle_rad, half_angle_rad
from companion.avoidance.trajectory import Array
from tests.support.avoidance_cases import (
    places,
    velocities,
)


def enter(
    domain: TransitionDomain, ids: Sequence[str], alpha: Array, beta1: Array, reached: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Update the domain; returns the obstacles whose cone we are in, (N,)."""
    inside: NDArray[np.bool_] = reached & domain.covers(ids, alpha, beta1)
    domain.keep(ids, inside)
    return inside


def in_cone(place: Array, velocity: Array, radius_m: float) -> bool:
    alpha = approach_angle_rad(place[None], velocity[None])
    beta = half_angle_rad(np.array([math.hypot(*place)]), np.array([radius_m]))
    return bool(enter(TransitionDomain(0.0), ["A"], alpha, beta, np.array([True]))[0])


@settings(deadline=None, derandomize=True)
@given(places, velocities, st.floats(1.0, 3000.0))
def test_the_cone_is_the_same_on_both_sides(
    place: tuple[float, float], velocity: tuple[float, float], radius_m: float
) -> None:
    assume(math.hypot(*velocity) > 1e-3)
    mirror, at, moving = np.array([1.0, -1.0]), np.array(place), np.array(velocity)
    alpha = float(approach_angle_rad(at[None], moving[None])[0])
    mirrored = float(approach_angle_rad((mirror * at)[None], (mirror * moving)[None])[0])
    assert mirrored == -alpha or abs(alpha) == abs(mirrored) == math.pi
    assert in_cone(at, moving, radius_m) is in_cone(mirror * at, mirror * moving, radius_m)


@settings(deadline=None, derandomize=True)
@given(places, velocities, st.floats(1.0, 3000.0))
def test_the_cone_contains_exactly_the_directions_that_collide(
    place: tuple[float, float], velocity: tuple[float, float], radius_m: float
) -> None:
    at, moving = np.array(place), np.array(velocity)
    assume(math.hypot(*velocity) > 1e-3)
    assume(math.hypot(*place) > radius_m)
    along_s = max(float(at @ moving) / float(moving @ moving), 0.0)
    missed_m = math.hypot(*(at - along_s * moving))
    assume(abs(missed_m - radius_m) > 1e-6 * radius_m)  # a tangent only touches
    assert in_cone(at, moving, radius_m) is (missed_m < radius_m)


@settings(deadline=None, derandomize=True)
@given(st.floats(10.0, 5000.0), st.floats(0.01, 0.99), st.floats(-math.pi, math.pi))
def test_the_edges_of_the_cone_are_tangents(distance_m: float, share: float, bearing_rad: float) -> None:
    radius_m = share * distance_m
    beta = float(half_angle_rad(np.array([distance_m]), np.array([radius_m]))[0])
    at = distance_m * np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    for side in (-1.0, 1.0):
        edge = np.array([math.cos(bearing_rad + side * beta), math.sin(bearing_rad + side * beta)])
        across_m = abs(edge[0] * at[1] - edge[1] * at[0])
        assert math.isclose(across_m, radius_m, rel_tol=1e-9)


@given(st.floats(0.1, 50_000.0), st.floats(0.1, 5_000.0))
def test_the_half_angle_is_that_of_the_tangent(distance_m: float, radius_m: float) -> None:
    beta = float(half_angle_rad(np.array([distance_m]), np.array([radius_m]))[0])
    if distance_m > radius_m:
        assert math.isclose(math.sin(beta), radius_m / distance_m, rel_tol=1e-9)
    else:
        assert beta == math.pi


IDS = ("A", "B", "C")


@settings(deadline=None, derandomize=True)
@given(
    st.lists(
        st.dictionaries(
            st.sampled_from(IDS), st.tuples(st.floats(-math.pi, math.pi), st.booleans()), max_size=3
        ),
        min_size=1,
        max_size=30,
    )
)
def test_each_obstacle_has_its_own_memory_and_loses_it_when_left(
    moments: list[dict[str, tuple[float, bool]]],
) -> None:
    """Between beta1 and beta2 the result for an obstacle is its last one, independent of others."""
    delta = math.radians(20.0)
    beta1 = dict(zip(IDS, (math.radians(5.0), math.radians(30.0), math.pi), strict=True))
    domain, last = TransitionDomain(delta), dict.fromkeys(IDS, False)
    for seen in moments:
        listed = list(seen)
        answers = enter(
            domain,
            listed,
            np.array([seen[one][0] for one in listed]),
            np.array([beta1[one] for one in listed]),
            np.array([seen[one][1] for one in listed], dtype=bool),
        )
        now = dict.fromkeys(IDS, False)
        for one, answer in zip(listed, answers.tolist(), strict=True):
            alpha, reached = abs(seen[one][0]), seen[one][1]
            widened = beta1[one] + (delta if last[one] else 0.0)
            assert answer is (reached and alpha <= widened)
            now[one] = answer
        last = now


@settings(deadline=None, derandomize=True)
@given(st.permutations(IDS), st.lists(st.floats(-0.3, 0.3), min_size=3, max_size=3))
def test_the_order_of_the_obstacles_does_not_matter(order: list[str], alphas: list[float]) -> None:
    beta1, reached = np.full(3, 0.1), np.full(3, True)
    by_id = dict(zip(IDS, alphas, strict=True))
    one, other = TransitionDomain(0.1), TransitionDomain(0.1)
    for shift in (0.0, 0.08, 0.15):
        first = enter(one, IDS, np.array(alphas) + shift, beta1, reached)
        second = enter(other, order, np.array([by_id[i] for i in order]) + shift, beta1, reached)
        assert dict(zip(IDS, first.tolist(), strict=True)) == dict(zip(order, second.tolist(), strict=True))


@settings(deadline=None, derandomize=True)
@given(st.lists(st.floats(0.101, 0.199), min_size=2, max_size=30), st.booleans())
def test_an_angle_that_stays_within_the_domain_never_changes_the_result(
    alphas: list[float], entered: bool
) -> None:
    domain, beta1, reached = TransitionDomain(0.1), np.array([0.1]), np.array([True])
    if entered:
        enter(domain, ["A"], np.array([0.0]), beta1, reached)
    assert {bool(enter(domain, ["A"], np.array([a]), beta1, reached)[0]) for a in alphas} == {entered}


def test_the_cone_of_an_obstacle_that_comes_back_has_to_be_entered_again() -> None:
    domain, beta1, reached = TransitionDomain(0.1), np.array([0.1]), np.array([True])
    within, between = np.array([0.05]), np.array([0.15])
    assert enter(domain, ["A"], within, beta1, reached)[0]
    assert enter(domain, ["A"], between, beta1, reached)[0]
    assert not enter(domain, ["B"], between, beta1, reached)[0]
    assert not enter(domain, ["A"], between, beta1, reached)[0]
    assert enter(domain, ["A"], within, beta1, reached)[0]


@given(st.lists(st.floats(-math.pi, math.pi), min_size=1, max_size=40))
def test_within_the_domain_the_result_never_chatters(alphas: list[float]) -> None:
    """Between beta1 and beta2 the result is the last one."""
    beta1, delta = math.radians(10.0), math.radians(5.0)
    domain, last = TransitionDomain(delta), False
    for alpha in alphas:
        now = bool(enter(domain, ["A"], np.array([alpha]), np.array([beta1]), np.array([True]))[0])
        if beta1 < abs(alpha) <= beta1 + delta:
            assert now is last
        else:
            assert now is (abs(alpha) <= beta1)
        last = now
