"""When a failed link is tried again, and what of it is said; the time is an argument."""

import logging

import pytest

from companion.links import Backoff, LinkState
from companion.links.backoff import STEADY_S


def test_waits_grow_from_half_a_second_to_five_and_only_the_first_failure_is_news() -> None:
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


def test_a_link_that_was_up_starts_with_the_shortest_wait_and_its_loss_is_news() -> None:
    backoff = Backoff()
    for now_s in (0.0, 1.0, 2.0):
        backoff.failed(now_s)
    backoff.opening()
    backoff.opened(10.0)
    assert backoff.state is LinkState.ON_TRIAL
    assert not backoff.steady(10.0 + STEADY_S - 0.1)
    assert backoff.steady(10.0 + STEADY_S), "that it is back is news"
    assert backoff.state is LinkState.UP
    assert not backoff.steady(10.0 + STEADY_S), "once"
    assert backoff.failed(100.0) == logging.WARNING
    assert backoff.wait_s(100.0) == 0.5


def test_a_link_that_works_from_the_start_is_no_news() -> None:
    backoff = Backoff()
    backoff.opened(0.0)
    assert not backoff.steady(STEADY_S)
    assert backoff.state is LinkState.UP
    assert backoff.wait_s(1.0) == 0.0


def test_a_peer_that_takes_and_drops_us_each_time_is_said_once_and_waited_for_longer() -> None:
    backoff = Backoff()
    said, waits, now_s = [], [], 0.0
    for _ in range(6):
        backoff.opening()
        backoff.opened(now_s)
        now_s += 0.1
        assert not backoff.steady(now_s)
        said.append(backoff.failed(now_s))
        waits.append(backoff.wait_s(now_s))
        now_s += waits[-1]
    assert said.count(logging.WARNING) == 1
    assert waits == pytest.approx([0.5, 1.0, 2.0, 4.0, 5.0, 5.0])


@pytest.mark.parametrize("held_s", [STEADY_S, 60.0])
def test_a_link_that_was_up_but_not_asked_about_was_up_all_the_same(held_s: float) -> None:
    backoff = Backoff()
    for now_s in (0.0, 1.0, 2.0):
        backoff.failed(now_s)
    backoff.opened(10.0)
    assert backoff.failed(10.0 + held_s) == logging.WARNING
    assert backoff.wait_s(10.0 + held_s) == 0.5
