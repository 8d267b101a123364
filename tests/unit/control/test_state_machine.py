"""The state machine: every pair of state and event, and the data of each state."""

import itertools
from dataclasses import fields, replace

import pytest

from companion.control.mode_request import ModeRequest
from companion.control.state_machine import (
    DATA,
    ENTERING,
    FLYING,
    HELD,
    OVERRIDES,
    TRANSITIONS,
    WATCHING,
    Event,
    State,
    StateData,
    Supervisor,
    printed,
    printed_data,
)
from companion.model import PriorFlightState
from companion.output.persisted_state import PersistedState

# A value for each field that differs from its default.
EXAMPLE = StateData(
    prior=PriorFlightState(10),
    left_in_prior_mode=True,
    plan=3,
    requested_s=1.0,
    last_unguided_mode=10,
    given_up=2,
    suppressed_s={"A": 1.0},
    request=ModeRequest(10, 15, 0.0),
    guided_since_s=1.0,
    overlooked=frozenset({Event.STICKS}),
    invalid_s=1.0,
    reclaiming=True,
    given_back_s=1.0,
    wait_until_s=1.0,
    ready_since_s=1.0,
    unattended_since_s=1.0,
    left_behind=PersistedState(0.0, 1),
    left_behind_since_s=1.0,
    let_go=Event.STICKS,
    seen_guided=True,
    fell_out=True,
    left_guided_s=1.0,
    away_s=1.0,
    fallback=12,
    yields_until_s=1.0,
    flown_since_s=1.0,
)


@pytest.mark.parametrize(("state", "event"), [*itertools.product(State, Event)])
def test_every_pair_of_state_and_event_follows_the_table(state: State, event: Event) -> None:
    supervisor = Supervisor()
    supervisor.state, supervisor.data = state, replace(EXAMPLE)
    after = TRANSITIONS.get((state, event), state)
    assert supervisor.heeds(event) == ((state, event) in TRANSITIONS)
    changed = supervisor.handle(event)
    assert supervisor.state is after
    assert changed == (after is not state)
    fresh = StateData()
    for field in fields(StateData):
        kept = not changed or field.name in DATA[after]
        expected = getattr(EXAMPLE if kept else fresh, field.name)
        assert getattr(supervisor.data, field.name) == expected, field.name


def test_every_state_and_every_field_is_in_the_data_table() -> None:
    names = {field.name for field in fields(StateData)}
    assert set(DATA) == set(State)
    assert set().union(*DATA.values()) == names


def test_flying_is_reached_only_by_the_autopilots_heartbeat() -> None:
    into_flying = {(s, e) for (s, e), after in TRANSITIONS.items() if after in FLYING and s not in FLYING}
    taken = {(state, Event.TAKEN) for state in ENTERING}
    assert into_flying == {*taken, (State.RESYNCHRONISING, Event.SETTLED)}


@pytest.mark.parametrize("event", sorted(OVERRIDES))
@pytest.mark.parametrize("state", sorted(State))
def test_an_override_ends_our_control(state: State, event: Event) -> None:
    after = TRANSITIONS.get((state, event), state)
    assert after not in FLYING
    if state in HELD:
        assert after is State.HANDS_OFF


@pytest.mark.parametrize("state", sorted(HELD))
def test_a_pilot_who_resumes_the_mission_suppresses_the_conflict(state: State) -> None:
    assert TRANSITIONS[state, Event.SENT_BACK] is State.SUPPRESSED


@pytest.mark.parametrize("state", sorted(HELD))
def test_in_the_role_advise_the_aircraft_is_given_back(state: State) -> None:
    assert TRANSITIONS.get((state, Event.ADVISE), state) is State.RELEASING


@pytest.mark.parametrize("state", sorted(State))
def test_resume_gives_the_aircraft_back_unless_its_controller_must_recover(state: State) -> None:
    ours = state in {*FLYING, State.ENGAGING, State.RESYNCHRONISING} - {State.RECOVERING}
    assert TRANSITIONS.get((state, Event.RESUME), state) is (State.RELEASING if ours else state)


def test_only_returning_is_entered_without_a_conflict() -> None:
    into = {(state, event) for (state, event), after in TRANSITIONS.items() if after is State.RETURNING}
    assert into == {(State.OUTER, Event.FAR), (State.INNER, Event.FAR)}


def test_an_aircraft_is_given_back_only_after_its_controller_recovered() -> None:
    for state in (State.RE_ENTERING, State.RECOVERING):
        ways = {event for (before, event) in TRANSITIONS if before is state}
        assert not ways & {Event.CLEAR, Event.FAR, Event.RESUME}


def test_the_printed_table_equals_the_table() -> None:
    head, *lines = [[cell.strip() for cell in line.split("|")] for line in printed().splitlines()]
    assert head == ["", *State]
    assert [line[0] for line in lines] == list(Event)
    shown = {
        (State(head[i]), Event(line[0])): line[i] for line in lines for i in range(1, len(line)) if line[i]
    }
    assert shown == {pair: str(after) for pair, after in TRANSITIONS.items()}


def test_the_printed_data_equals_the_data_of_each_state() -> None:
    always, *states = printed_data().splitlines()
    common = set(always.partition(": ")[2].split(", "))
    assert len(states) == len(State)
    for state, line in zip(State, states, strict=True):
        name, _, own = line.partition(" : ")
        assert name.strip() == state
        assert common | set(filter(None, own.split(", "))) == DATA[state]


def test_hands_off_ends_only_by_readiness_stop_or_release() -> None:
    ways = {event for (state, event) in TRANSITIONS if state is State.HANDS_OFF}
    assert ways == {Event.READY, Event.STOP, Event.STOP_UNATTENDED, Event.LATE, Event.ABANDONED}
    assert TRANSITIONS[State.HANDS_OFF, Event.ABANDONED] is State.RELEASING
    assert TRANSITIONS[State.HANDS_OFF, Event.LATE] is State.RELEASING


@pytest.mark.parametrize("state", [s for s in State if s not in (State.STOPPED, State.STOPPING)])
def test_stop_works_in_every_state_and_gives_back_a_held_aircraft(state: State) -> None:
    after = TRANSITIONS[state, Event.STOP]
    assert after is (State.STOPPED if state in WATCHING else State.STOPPING)


@pytest.mark.parametrize("state", sorted(FLYING | ENTERING))
def test_after_a_gap_of_ours_the_state_of_the_aircraft_is_awaited(state: State) -> None:
    assert TRANSITIONS[state, Event.GAP] is State.RESYNCHRONISING


def test_no_event_leaves_stopped() -> None:
    assert not any(state is State.STOPPED for state, _ in TRANSITIONS)
