"""The supervisor's table, walked over every pair of state and event."""

import itertools

import pytest

from companion.control.state_machine import (
    FLYING,
    HELD,
    TAKEN_AWAY,
    TRANSITIONS,
    WATCHING,
    Event,
    State,
    Supervisor,
    printed,
)


@pytest.mark.parametrize(("state", "event"), [*itertools.product(State, Event)])
def test_every_pair(state: State, event: Event) -> None:
    supervisor = Supervisor()
    supervisor.state = state
    changed = supervisor.handle(event)
    assert supervisor.state is TRANSITIONS.get((state, event), state)
    assert changed == (supervisor.state is not state)


def test_flying_is_reached_only_by_the_autopilots_word() -> None:
    into_flying = {(s, e) for (s, e), after in TRANSITIONS.items() if after in FLYING and s not in FLYING}
    assert into_flying == {(State.ENGAGING, Event.TAKEN)}


@pytest.mark.parametrize("event", sorted(TAKEN_AWAY))
@pytest.mark.parametrize("state", sorted(State))
def test_whoever_takes_the_aircraft_has_it(state: State, event: Event) -> None:
    after = TRANSITIONS.get((state, event), state)
    assert after not in FLYING
    if state in HELD:
        assert after is State.HANDS_OFF


@pytest.mark.parametrize("state", sorted(HELD))
def test_told_to_advise_only_the_aircraft_is_given_back(state: State) -> None:
    assert TRANSITIONS.get((state, Event.ADVISE), state) is State.RELEASING


@pytest.mark.parametrize("state", sorted(State))
def test_told_to_resume_what_we_fly_is_given_back(state: State) -> None:
    ours = state in FLYING | {State.ENGAGING}
    assert TRANSITIONS.get((state, Event.RESUME), state) is (State.RELEASING if ours else state)


def test_only_returning_is_entered_without_a_conflict() -> None:
    into = {(state, event) for (state, event), after in TRANSITIONS.items() if after is State.RETURNING}
    assert into == {(State.OUTER, Event.FAR), (State.INNER, Event.FAR)}


def test_the_table_printed_says_what_the_table_says() -> None:
    head, *lines = [[cell.strip() for cell in line.split("|")] for line in printed().splitlines()]
    assert head == ["", *State]
    assert [line[0] for line in lines] == list(Event)
    said = {
        (State(head[i]), Event(line[0])): line[i] for line in lines for i in range(1, len(line)) if line[i]
    }
    assert said == {pair: str(after) for pair, after in TRANSITIONS.items()}


def test_after_hands_off_only_readiness_leads_back_to_taking_over() -> None:
    ways = {event for (state, event) in TRANSITIONS if state is State.HANDS_OFF}
    assert ways == {Event.READY, Event.STOP, Event.LATE, Event.ABANDONED}
    assert TRANSITIONS[State.HANDS_OFF, Event.ABANDONED] is State.RELEASING
    assert TRANSITIONS[State.HANDS_OFF, Event.LATE] is State.RELEASING


@pytest.mark.parametrize("state", [s for s in State if s not in (State.STOPPED, State.STOPPING)])
def test_stop_is_heard_everywhere_and_gives_back_what_is_held(state: State) -> None:
    after = TRANSITIONS[state, Event.STOP]
    assert after is (State.STOPPED if state in WATCHING else State.STOPPING)


def test_stopped_is_the_end() -> None:
    assert not any(state is State.STOPPED for state, _ in TRANSITIONS)
