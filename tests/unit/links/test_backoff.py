"""Backoff: when a failed link is opened again, and which failures are logged."""

import logging

import pytest

from companion.links import Backoff, LinkState
from companion.links.backoff import STEADY_S


def test_waits_grow_from_half_a_second_to_five_and_only_the_first_failure_is_a_warning() -> None:
    backoff = Backoff()
    assert backoff.state is LinkState.OPENING
    waits, levels, now_s = [], [], 1000.0
    for _ in range(7):
        levels.append(backoff.failed(now_s))
        assert backoff.state is LinkState.WAITING
        waits.append(backoff.wait_s(now_s))
        now_s += waits[-1]
        assert backoff.wait_s(now_s) == 0.0
        backoff.opening()
        assert backoff.state is LinkState.OPENING
    assert waits == [0.5, 1.0, 2.0, 4.0, 5.0, 5.0, 5.0]
    assert levels == [logging.WARNING] + 6 * [logging.DEBUG]


def test_a_link_that_was_up_starts_with_the_shortest_wait_and_its_loss_is_a_warning() -> None:
    backoff = Backoff()
    for now_s in (0.0, 1.0, 2.0):
        backoff.failed(now_s)
    backoff.opening()
    backoff.opened(10.0)
    assert backoff.state is LinkState.ON_TRIAL
    assert not backoff.steady(10.0 + STEADY_S - 0.1)
    assert backoff.steady(10.0 + STEADY_S), "the recovery is logged"
    assert backoff.state is LinkState.UP
    assert not backoff.steady(10.0 + STEADY_S), "once"
    assert backoff.failed(100.0) == logging.WARNING
    assert backoff.wait_s(100.0) == 0.5


def test_a_link_that_works_from_the_start_is_not_logged() -> None:
    backoff = Backoff()
    backoff.opened(0.0)
    assert not backoff.steady(STEADY_S)
    assert backoff.state is LinkState.UP
    assert backoff.wait_s(1.0) == 0.0


def test_a_link_that_flaps_is_logged_once_and_its_waits_grow() -> None:
    backoff = Backoff()
    levels, waits, now_s = [], [], 0.0
    for _ in range(6):
        backoff.opening()
        backoff.opened(now_s)
        now_s += 0.1
        assert not backoff.steady(now_s)
        levels.append(backoff.failed(now_s))
        waits.append(backoff.wait_s(now_s))
        now_s += waits[-1]
    assert levels.count(logging.WARNING) == 1
    assert waits == pytest.approx([0.5, 1.0, 2.0, 4.0, 5.0, 5.0])


@pytest.mark.parametrize("up_s", [STEADY_S, 60.0])
def test_a_link_counts_as_up_even_if_steady_was_never_called(up_s: float) -> None:
    backoff = Backoff()
    for now_s in (0.0, 1.0, 2.0):
        backoff.failed(now_s)
    backoff.opened(10.0)
    assert backoff.failed(10.0 + up_s) == logging.WARNING
    assert backoff.wait_s(10.0 + up_s) == 0.5
