"""The pilot's sticks, and what survives a crash of the companion."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.control.sticks import Sticks
from companion.geodesy import GeoPoint
from companion.mavlink.facts import RcChannels, Sender
from companion.model import PriorFlightState, Role
from companion.output.persisted_state import LONGEST_S, PersistedState

AUTOPILOT = Sender(1, 1)


def channels(*pulses_us: int | None) -> RcChannels:
    return RcChannels(AUTOPILOT, pulses_us)


@pytest.mark.parametrize(
    ("pulses_us", "moved"),
    [
        ((1500, 1500, 1900, 1500), False),  # the throttle lies anywhere
        ((1590, 1500, 1500, 1500), False),
        ((1610, 1500, 1500, 1500), True),
        ((1500, 1390, 1500, 1500), True),
        ((1500, 1500, 1500, 1620), True),
        ((None, None, None, None), False),  # the link to the transmitter is lost: no stick is moved
        ((), False),
    ],
)
def test_sticks_are_moved_from_where_they_were(pulses_us: tuple[int | None, ...], moved: bool) -> None:
    sticks = Sticks(100.0)
    sticks.observe(channels(1500, 1500, 1200, 1500))
    sticks.mark()
    sticks.observe(channels(*pulses_us))
    assert sticks.moved is moved


def test_sticks_first_heard_after_the_take_over_are_where_they_belong() -> None:
    sticks = Sticks(100.0)
    sticks.mark()
    assert not sticks.moved
    sticks.observe(channels(1700, 1500, 1500, 1500))
    assert not sticks.moved
    sticks.observe(channels(1500, 1500, 1500, 1500))
    assert sticks.moved


def test_a_limit_of_zero_never_sees_them_move() -> None:
    sticks = Sticks(0.0)
    sticks.observe(channels(1500, 1500, 1500, 1500))
    sticks.mark()
    sticks.observe(channels(1000, 2000, 1000, 2000))
    assert not sticks.moved


HELD = PersistedState(
    1e9,
    1,
    PriorFlightState(10, 3, GeoPoint(1.0, 2.0, 3.0), 0.5, 600.0, 22.0),
    Role.ADVISE,
    5,
    {"FW_AIRSPD_TRIM": 15.0},
)


@pytest.mark.parametrize(
    "held", [HELD, PersistedState(1e9, 1, PriorFlightState(10)), PersistedState(1e9, 1, None, Role.OFF)]
)
def test_what_is_kept_is_found_again(held: PersistedState) -> None:
    assert PersistedState.from_text(held.to_text()) == held


@given(
    st.text()
    | st.sampled_from(
        [
            "{}",
            "[]",
            "null",
            '{"before":{}}',
            HELD.to_text()[:-9],
            HELD.to_text().replace('"system_id":1', '"system_id":Infinity'),
        ]
    )
)
def test_a_damaged_record_is_none(text: str) -> None:
    assert PersistedState.from_text(text) is None


@pytest.mark.parametrize(
    ("later_s", "fresh"), [(0.0, True), (5.0, True), (LONGEST_S + 1.0, False), (-5.0, False)]
)
def test_only_a_fresh_record_says_who_has_the_aircraft(later_s: float, fresh: bool) -> None:
    assert HELD.is_fresh(HELD.time_s + later_s) is fresh
