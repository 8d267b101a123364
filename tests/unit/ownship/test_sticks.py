"""The pilot's sticks: moved or not, against their marked positions."""

import pytest

from companion.mavlink.facts import RcChannels, Sender
from companion.ownship.autopilot_state import Sticks


def channels(*pulses_us: int | None) -> RcChannels:
    return RcChannels(Sender(1, 1), pulses_us)


@pytest.mark.parametrize(
    ("pulses_us", "moved"),
    [
        ((1500, 1500, 1900, 1500), False),  # the throttle does not count
        ((1590, 1500, 1500, 1500), False),
        ((1610, 1500, 1500, 1500), True),
        ((1500, 1390, 1500, 1500), True),
        ((1500, 1500, 1500, 1620), True),
        ((None, None, None, None), False),  # the transmitter's signal is lost: no stick has moved
        ((), False),
    ],
)
def test_a_stick_moves_when_it_leaves_its_marked_position(
    pulses_us: tuple[int | None, ...], moved: bool
) -> None:
    sticks = Sticks(100.0)
    sticks.observe(channels(1500, 1500, 1200, 1500), 0.0)
    sticks.mark()
    sticks.observe(channels(*pulses_us), 0.0)
    assert sticks.moved is moved


def test_positions_first_received_after_the_mark_are_the_marked_ones() -> None:
    sticks = Sticks(100.0)
    sticks.mark()
    assert not sticks.moved
    sticks.observe(channels(1700, 1500, 1500, 1500), 0.0)
    assert not sticks.moved
    sticks.observe(channels(1500, 1500, 1500, 1500), 0.0)
    assert sticks.moved


def test_with_a_limit_of_zero_no_stick_ever_moves() -> None:
    sticks = Sticks(0.0)
    sticks.observe(channels(1500, 1500, 1500, 1500), 0.0)
    sticks.mark()
    sticks.observe(channels(1000, 2000, 1000, 2000), 0.0)
    assert not sticks.moved
