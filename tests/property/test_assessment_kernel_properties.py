"""The kernels of the assessment and of the field against the same maths in plain steps."""

import math

import numpy as np
import pytest
from hypothesis import given

from companion.compiled import kernels
from tests.property.test_kernel_properties import seeds, three, two


@given(seeds)
def test_rows_become_columns(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places, velocities = rng.normal(0.0, 1e4, (4, 3)), rng.normal(0.0, 60.0, (4, 3))
    rest = rng.normal(0.0, 1.0, (4, 2))
    rows = [
        (three(one), three(other), two(others))
        for one, other, others in zip(places, velocities, rest, strict=True)
    ]
    made = kernels.columns(rows)
    assert [array.tolist() for array in made] == [places.tolist(), velocities.tolist(), rest.T.tolist()]
    assert [array.shape for array in kernels.columns([])] == [(0, 3), (0, 3), (0, 0)]
    with pytest.raises(ValueError, match="do not match"):
        kernels.columns([*rows, (three(places[0]), three(velocities[0]), (1.0,))])


@given(seeds)
def test_each_track_pushes_across_our_velocity_to_the_right_of_the_course(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, course_rad = int(rng.integers(0, 5)), float(rng.uniform(-math.pi, math.pi))
    velocity_mps, push = rng.normal(0.0, 40.0, (count, 3)), rng.uniform(0.0, 2.0, count)
    onward, summed = np.array([math.cos(course_rad), math.sin(course_rad)]), np.zeros(2)
    for (north_mps, east_mps, _), length in zip(velocity_mps, push, strict=True):
        right = np.array([-east_mps, north_mps]) / math.hypot(north_mps, east_mps)
        backwards = np.array([north_mps, east_mps]) @ onward < 0.0
        summed += max(length, 0.5) * (-right if backwards else right)
    across = kernels.pushes_across(velocity_mps, push, 0.5, course_rad)
    assert across == pytest.approx(summed, rel=1e-9, abs=1e-9)


@given(seeds)
def test_a_layer_reaches_as_far_as_its_radius_or_its_time(seed: int) -> None:
    rng = np.random.default_rng(seed)
    distance_m, protected_m = rng.uniform(0.0, 9000.0, 5), rng.uniform(50.0, 900.0, 5)
    closing_mps = np.maximum(rng.normal(20.0, 40.0, 5), 0.0)
    surface, outer, inner = kernels.reaches(distance_m, closing_mps, protected_m, 1500.0, 60.0, 300.0, 15.0)
    assert surface == pytest.approx(distance_m - protected_m)
    assert outer == pytest.approx(np.maximum(1500.0, 60.0 * closing_mps))
    assert inner == pytest.approx(np.maximum(300.0, 15.0 * closing_mps))


@given(seeds)
def test_too_near_depends_on_the_share_of_the_volume_that_the_time_allows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    closest, protected_m, buffer_m = (
        rng.uniform(0.0, 2.0, 9),
        rng.uniform(50.0, 900.0, 9),
        rng.uniform(0.0, 300.0, 9),
    )
    to_closest_s, entered_s = rng.normal(40.0, 40.0, 9), rng.uniform(0.0, 90.0, 9)
    to_closest_s[0], entered_s[1] = math.inf, math.inf
    earliness = np.clip((np.minimum(to_closest_s, entered_s + 15.0) - 15.0) / 45.0, 0.0, 1.0)
    needed = (1.0 + buffer_m / protected_m) * (0.9 + (0.6 - 0.9) * earliness)
    near = kernels.too_near(closest, entered_s, to_closest_s, buffer_m, protected_m, 0.9, 0.6, 15.0, 60.0)
    assert near.tolist() == (closest < needed).tolist()


def test_arrays_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="do not match"):
        kernels.pushes_across(np.zeros((3, 1)), np.zeros(3), 0.0, 0.0)
    with pytest.raises(ValueError, match="do not match"):
        kernels.reaches(np.zeros(3), np.zeros(3), np.zeros(2), 0.0, 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="do not match"):
        kernels.too_near(*[np.zeros(3)] * 4, np.zeros(2), 1.0, 1.0, 15.0, 60.0)
