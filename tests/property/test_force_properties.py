"""Properties of the potential field: gradients of potentials, finite, never towards an obstacle."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.avoidance.layers import (
    RepellingTracks,
    attraction,
    repulsion,
    repulsion_magnitude,
    resultant_rad,
)
from companion.avoidance.params import FieldParams
from companion.avoidance.trajectory import Array
from tests.support.avoidance_cases import (
    places,
)

REACH, RADIUS = 1.0, 0.2


def repulsive_potential(own: Array, centre: Array, gain: float) -> float:
    """Eq. 6."""
    rho = math.dist(own, centre) - RADIUS
    return 0.5 * gain * (1.0 / rho - 1.0 / REACH) ** 2 if rho <= REACH else 0.0


def gradient(potential: object, own: Array) -> Array:
    """The negative gradient by central differences."""
    assert callable(potential)
    step = 1e-6
    return np.array(
        [(potential(own - step * axis) - potential(own + step * axis)) / (2.0 * step) for axis in np.eye(2)]
    )


@settings(deadline=None, derandomize=True)
@given(st.floats(0.05, 1.5), st.floats(-math.pi, math.pi), st.floats(0.1, 20.0))
def test_repulsion_is_the_gradient_of_its_potential(rho: float, bearing_rad: float, gain: float) -> None:
    assume(abs(rho - REACH) > 1e-3)  # the potential has a kink there
    centre = (rho + RADIUS) * np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    force = repulsion(centre[None], repulsion_magnitude(np.array([rho]), REACH, gain))
    wanted = gradient(lambda own: repulsive_potential(own, centre, gain), np.zeros(2))
    assert np.allclose(force, wanted, rtol=1e-4, atol=1e-6 * gain)


@settings(deadline=None, derandomize=True)
@given(places, places, st.floats(0.1, 20.0))
def test_attraction_is_the_gradient_of_half_the_squared_distance(
    own: tuple[float, float], goal: tuple[float, float], gain: float
) -> None:
    # In thousands, so that differences of squares are exact enough.
    at, to = np.array(own) / 1e3, np.array(goal) / 1e3
    wanted = gradient(lambda x: 0.5 * gain * float((x - to) @ (x - to)), at)
    assert np.allclose(attraction(at, to, gain), wanted, rtol=1e-5, atol=1e-6 * gain)


@settings(deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0.0, 1e-300, 1e-12, 1e-6, 1.0, 150.0, 1e3, 1e6]),
            st.floats(-math.pi, math.pi),
            st.sampled_from([0.0, 1e-9, 1.0, 150.0, 1e5]),
        ),
        min_size=1,
        max_size=4,
    ),
    st.floats(0.01, 1e3),
    st.floats(0.0, 1e4),
)
def test_forces_are_finite_everywhere(
    threats: list[tuple[float, float, float]], gain: float, goal_distance: float
) -> None:
    """At the centre, at the surface, inside, and a thousand kilometres away."""
    offset = np.array([[d * math.cos(a), d * math.sin(a)] for d, a, _ in threats])
    surface = np.array([d - radius for d, _, radius in threats])
    magnitude = repulsion_magnitude(surface / 1500.0, 1.0, gain)
    force = np.array([repulsion(offset[n : n + 1], magnitude[n : n + 1]) for n in range(len(threats))])
    assert np.isfinite(force).all()
    assert (np.einsum("ni,ni->n", force, offset) <= 0.0).all(), "never towards the obstacle"
    assert (force[surface >= 1500.0] == 0.0).all()
    assert repulsion(offset, magnitude) == pytest.approx(force.sum(axis=0), rel=1e-9)
    course = resultant_rad(
        0.3,
        goal_distance,
        RepellingTracks(offset, np.zeros_like(offset), surface, np.full(len(threats), 1500.0)),
        FieldParams(5.0, gain),
    )
    assert math.isfinite(course)


@settings(deadline=None, derandomize=True)
@given(st.floats(0.001, 2.0), st.floats(0.001, 2.0))
def test_a_nearer_obstacle_pushes_at_least_as_hard(one: float, other: float) -> None:
    near, far = repulsion_magnitude(np.array(sorted((one, other))), 1.0, 1.0)
    assert near >= far


@given(st.floats(-1e6, 1e6), st.floats(0.01, 1e5), st.floats(0.0, 1e3))
def test_the_field_is_finite_and_never_attracts(rho: float, reach: float, gain: float) -> None:
    force = repulsion_magnitude(np.array([rho]), reach, gain)
    assert np.isfinite(force).all()
    assert (force >= 0.0).all()
