"""Closest approach, angles, cones and forces in cases computed by hand."""

import math

import numpy as np
import pytest

from companion.avoidance.intruders import (
    RelativeMotion,
    TransitionDomain,
    approach_angle_rad,
    half_angle_rad,
    relative_motion,
)
from companion.avoidance.layers import attraction, repulsion_magnitude
from companion.avoidance.trajectory import any_of


def rows(*vectors: tuple[float, ...]) -> np.ndarray:
    return np.array(vectors, dtype=np.float64)


def motion(position: tuple[float, ...], velocity: tuple[float, ...]) -> RelativeMotion:
    """The motion of one track relative to a stationary observer at the origin."""
    return relative_motion(rows(position), rows(velocity), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_closest_approach_of_a_crossing() -> None:
    crossing = motion((1000.0, 1000.0, 0.0), (0.0, -50.0, 0.0))
    assert crossing.time_to_closest_s == pytest.approx(20.0)
    at_closest_m = crossing.position_m - crossing.own_velocity_mps * crossing.time_to_closest_s
    assert at_closest_m[0] == pytest.approx((1000.0, 0.0, 0.0))


def test_the_time_is_negative_after_closest_approach_and_infinite_without_motion() -> None:
    assert motion((100.0, 0.0, 0.0), (10.0, 0.0, 0.0)).time_to_closest_s == pytest.approx(-10.0)
    assert math.isinf(motion((100.0, 0.0, 0.0), (0.0, 0.0, 0.0)).time_to_closest_s[0])


def test_closing_speed_is_never_negative() -> None:
    assert motion((1000.0, 0.0, 0.0), (-80.0, 0.0, 0.0)).closing_mps == pytest.approx(80.0)
    assert motion((1000.0, 0.0, 0.0), (80.0, 0.0, 0.0)).closing_mps == 0.0


def test_motion_is_relative_to_us() -> None:
    ours = (100.0, 0.0, -300.0), (20.0, 0.0, 1.0)
    seen = relative_motion(rows((400.0, 400.0, -350.0)), rows((-60.0, 0.0, 0.0)), *ours)
    assert seen.position_m[0] == pytest.approx((300.0, 400.0, -50.0))
    assert seen.own_velocity_mps[0] == pytest.approx((80.0, 0.0, 1.0))
    assert seen.distance_m == pytest.approx(500.0)
    assert seen.closing_mps == pytest.approx(80.0 * 300.0 / 500.0)


def test_left_is_positive() -> None:
    ahead, left = rows((1.0, 0.0)), rows((0.0, -1.0))  # north-east: west is on the left of north
    assert approach_angle_rad(ahead, left) == pytest.approx(math.pi / 2)
    assert approach_angle_rad(left, ahead) == pytest.approx(-math.pi / 2)


def test_any_of_is_true_if_a_value_is_not_zero() -> None:
    assert any_of(np.array([0.0, -1e-300]))
    assert any_of(np.array([False, True]))
    assert not any_of(np.array([0.0, -0.0]))
    assert not any_of(np.zeros(0, dtype=bool))


def test_the_half_angle_reaches_to_the_tangents() -> None:
    beta = half_angle_rad(np.array([1000.0, 500.0, 400.0]), np.array([500.0, 500.0, 500.0]))
    assert beta == pytest.approx([math.radians(30.0), math.pi, math.pi])


def test_the_approach_angle_of_a_collision_course_is_zero() -> None:
    assert approach_angle_rad(rows((900.0, 0.0)), rows((80.0, 0.0))) == pytest.approx(0.0)
    assert approach_angle_rad(rows((900.0, 0.0)), rows((0.0, 0.0))) == pytest.approx(math.pi)


def inside(domain: TransitionDomain, alpha_deg: float, *, reached: bool = True) -> bool:
    covered = reached & domain.covers(["A"], np.radians([alpha_deg]), np.radians([10.0]))
    domain.keep(["A"], covered)
    return bool(covered[0])


def test_the_transition_domain_is_entered_at_beta1_and_left_at_beta2() -> None:
    domain = TransitionDomain(math.radians(5.0))
    assert not inside(domain, 12.0)
    assert inside(domain, 9.0)
    assert inside(domain, -14.0)
    assert not inside(domain, 16.0)
    assert not inside(domain, 12.0), "the cone has beta1 again"


def test_the_transition_domain_forgets_tracks_that_are_out_of_reach_or_gone() -> None:
    domain = TransitionDomain(math.radians(5.0))
    assert inside(domain, 0.0)
    assert not inside(domain, 0.0, reached=False)
    assert not inside(domain, 12.0)
    assert inside(domain, 0.0)
    domain.keep([], np.array([], dtype=bool))
    assert not inside(domain, 12.0)


def test_the_repulsion_has_the_length_of_equation_7() -> None:
    rho, rho_o, gain = 2.0, 5.0, 10.0
    expected = gain * (1 / rho - 1 / rho_o) / rho**2
    assert repulsion_magnitude(np.array([rho]), rho_o, gain) == pytest.approx(expected)
    assert repulsion_magnitude(np.array([5.0, 6.0]), rho_o, gain) == pytest.approx([0.0, 0.0])


def test_repulsion_is_finite_at_and_inside_the_surface() -> None:
    assert np.isfinite(repulsion_magnitude(np.array([0.0, -3.0]), 5.0, 10.0)).all()


def test_attraction_points_to_the_goal() -> None:
    force = attraction(np.array([1.0, 1.0]), np.array([3.0, 5.0]), 5.0)
    assert force == pytest.approx([10.0, 20.0])
