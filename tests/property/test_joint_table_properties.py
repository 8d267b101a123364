"""The joint table: what the search finds is what trying every combination finds."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from companion.avoidance.group.joint_table import JointTable

SEPARATION_M = 100.0


@st.composite
def tables(draw: st.DrawFn, rows: int) -> JointTable:
    """Tables with random values, some of them equal; in some, few combinations keep the separation."""
    count = draw(st.integers(2, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    furthest_m = draw(st.sampled_from([90.0, 110.0, 150.0, 400.0]))
    step = draw(st.sampled_from([0.0, 10.0]))

    def drawn(low: float, high: float) -> NDArray[np.float64]:
        values = rng.uniform(low, high, (rows, rows))
        return values if step == 0.0 else np.round(values / step) * step

    value, least = np.zeros((count, count, rows, rows)), np.full((count, count, rows, rows), np.inf)
    for i, j in itertools.combinations(range(count), 2):
        value[i, j], least[i, j] = drawn(0.0, 400.0), drawn(0.0, furthest_m)
        value[j, i], least[j, i] = value[i, j].T, least[i, j].T
    return JointTable(-rng.uniform(0.0, 20.0, (count, rows)), value, least, SEPARATION_M)


def exhaustive(table: JointTable) -> tuple[float, float]:
    """Whether the separation is kept (its smallest distance, capped), and the best value, by brute force."""
    count, rows = table.alone.shape
    best = (-np.inf, -np.inf)
    for chosen in itertools.product(range(rows), repeat=count):
        pairs = list(itertools.combinations(range(count), 2))
        closest = min(table.least[i, j, chosen[i], chosen[j]] for i, j in pairs)
        value = sum(table.alone[i, row] for i, row in enumerate(chosen))
        value += sum(table.value[i, j, chosen[i], chosen[j]] for i, j in pairs)
        best = max(best, (closest, -np.inf) if closest < SEPARATION_M else (SEPARATION_M, value))
    return best


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(2, 6).flatmap(lambda rows: tables(rows)))
def test_the_best_combination_is_found_for_up_to_four_members(table: JointTable) -> None:
    chosen = table.best()
    closest_m, value = exhaustive(table)
    found_m = table.closest_m(chosen)
    assert min(found_m, SEPARATION_M) == closest_m
    if closest_m >= SEPARATION_M:
        assert table._value(chosen) == pytest.approx(value)
