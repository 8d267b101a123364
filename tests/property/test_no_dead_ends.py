"""From every state in which the aircraft flies by our doing there is a way out (see `dead_ends`)."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.dead_ends import EVENTS, seconds_after, walk
from tests.support.pilots_seat import GUIDED_MODES
from tests.support.thorough import sample

ALL = pytest.mark.parametrize("autopilot", GUIDED_MODES)


@ALL
@pytest.mark.parametrize("first", EVENTS)
def test_after_any_two_events_it_is_flown_given_back_or_alarmed(autopilot: int, first: str) -> None:
    for second in seconds_after(autopilot, first):
        walk(autopilot, (first, second))


@ALL
def test_a_target_of_someone_else_is_left_alone_after_a_silence(autopilot: int) -> None:
    walk(autopilot, ("flicker", "conflict begins", "fly here", "stall", "flicker", "reception lost"))


@ALL
def test_the_mode_is_alarmed_that_followed_an_unseen_request(autopilot: int) -> None:
    """The pilot moves the sticks in the moment in which the aircraft is heard again."""
    walk(autopilot, ("stall", "sticks", "reception lost"))


@ALL
def test_a_target_right_after_the_take_over_is_someone_elses(autopilot: int) -> None:
    walk(autopilot, ("conflict ends", "conflict begins", "fly here"))


@ALL
@given(
    events=st.lists(st.sampled_from(EVENTS), min_size=3, max_size=9),
    before_conflict=st.booleans(),
)
@settings(max_examples=sample(5, 50), deadline=None)
def test_after_many_events_it_is_flown_given_back_or_alarmed(
    autopilot: int, events: list[str], before_conflict: bool
) -> None:
    walk(autopilot, events, before_conflict=before_conflict)
