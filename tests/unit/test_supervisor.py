"""The supervisor's table, walked over every pair of state and event."""

import itertools

import pytest

from companion.supervisor import FLYING, TRANSITIONS, WATCHING, Event, State, Supervisor


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


@pytest.mark.parametrize("state", sorted(FLYING | {State.ENGAGING, State.RELEASING}))
def test_whoever_takes_the_aircraft_has_it(state: State) -> None:
    assert TRANSITIONS[state, Event.LOST] is State.HANDS_OFF


def test_after_hands_off_only_readiness_leads_back_to_taking_over() -> None:
    ways = {event for (state, event) in TRANSITIONS if state is State.HANDS_OFF}
    assert ways == {Event.READY, Event.STOP, Event.LATE}
    assert TRANSITIONS[State.HANDS_OFF, Event.LATE] is State.RELEASING


@pytest.mark.parametrize("state", [s for s in State if s not in (State.STOPPED, State.STOPPING)])
def test_stop_is_heard_everywhere_and_gives_back_what_is_held(state: State) -> None:
    after = TRANSITIONS[state, Event.STOP]
    assert after is (State.STOPPED if state in WATCHING else State.STOPPING)


def test_stopped_is_the_end() -> None:
    assert not any(state is State.STOPPED for state, _ in TRANSITIONS)
