"""Everything that ends our control at once, and everything that prevents a take-over."""

from collections.abc import Callable

import pytest

from companion.control.state_machine import State
from companion.mavlink.facts import (
    Fact,
    FenceStatus,
    Heartbeat,
    LandedState,
    MissionProgress,
    Parameter,
    RcChannels,
)
from companion.output.effects import Record, Transmit
from tests.support.pilots_seat import ARDUPILOT, AUTOPILOT, FBWA, PX4, Seat, acts

FLYING = (State.OUTER, State.INNER)
CENTRED, ROLLED = RcChannels(AUTOPILOT, (1500,) * 4), RcChannels(AUTOPILOT, (1700, 1500, 1500, 1500))
LANDING, ON_GROUND, TAKING_OFF = (LandedState(AUTOPILOT, state) for state in (4, 1, 3))
BREACHED = FenceStatus(AUTOPILOT, True)


def reports(*facts: Fact) -> Callable[[Seat], None]:
    return lambda seat: seat.extra_facts.extend(facts)


def becomes(name: str, value: object) -> Callable[[Seat], None]:
    return lambda seat: setattr(seat, name, value)


OVERRIDES = {
    "sticks moved": reports(ROLLED),
    "failsafe": becomes("status", 5),
    "flight termination": becomes("status", 8),
    "landing": reports(LANDING),
    "on the ground": reports(ON_GROUND),
    "fence breached": reports(BREACHED),
    "disarmed": becomes("armed", False),
    "mode changed": becomes("mode", FBWA),
}


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
@pytest.mark.parametrize("override", OVERRIDES.values(), ids=OVERRIDES)
def test_an_override_ends_our_control_at_once_and_for_good(
    override: Callable[[Seat], None], autopilot: int
) -> None:
    seat = Seat(autopilot)
    seat.extra_facts = [CENTRED]
    seat.until(*FLYING)
    override(seat)
    seat.fly(0.2)  # heard with the next heartbeat
    assert seat.state is State.HANDS_OFF
    assert seat.fly(4.5) == []


@pytest.mark.parametrize("state", [State.ENGAGING, State.RELEASING])
def test_sticks_also_count_while_taking_over_and_giving_back(state: State) -> None:
    seat = Seat(PX4)
    seat.extra_facts = [CENTRED]
    seat.until(State.ENGAGING)
    if state is State.RELEASING:
        seat.until(*FLYING)
        seat.obeys = lambda _message: False
        seat.set_role(1)
        seat.fly(0.1)
    assert seat.state is state
    seat.extra_facts = [ROLLED]
    seat.fly(0.1)
    assert seat.state is State.HANDS_OFF


def test_sticks_are_compared_with_their_position_at_each_take_over() -> None:
    seat = Seat()
    seat.extra_facts = [ROLLED]
    seat.fly(0.5)
    seat.extra_facts = [CENTRED]
    seat.fly(0.5)
    seat.until(*FLYING)
    seat.set_role(1)
    seat.until(State.STANDBY)
    seat.extra_facts = [ROLLED]  # trimmed differently in between
    seat.fly(1.0)
    seat.set_role(2)
    seat.until(*FLYING)
    seat.fly(1.0)
    assert seat.state in FLYING


HINDRANCES = {
    "failsafe": becomes("status", 6),
    "fence": reports(BREACHED),
    "on the ground": reports(ON_GROUND),
    "taking off": reports(TAKING_OFF),
    "landing": reports(LANDING),
    "low": becomes("height_m", 29.0),
    "disarmed": becomes("armed", False),
    "another mode": becomes("mode", FBWA),
    "no fixed wing": becomes("vehicle_type", 2),
    "no position": becomes("positions", False),
    "another avoider": reports(
        Parameter(AUTOPILOT, "AVD_ENABLE", 1.0), Parameter(AUTOPILOT, "AVD_F_ACTION", 2.0)
    ),
    "role advise": lambda seat: seat.set_role(1),
}


@pytest.mark.parametrize("hindrance", HINDRANCES.values(), ids=HINDRANCES)
def test_an_aircraft_that_may_not_be_taken_over_is_sent_nothing(hindrance: Callable[[Seat], None]) -> None:
    seat = Seat()
    hindrance(seat)
    seat.extra_facts.append(MissionProgress(AUTOPILOT, 3))
    assert seat.fly(6.0) == []
    assert seat.state is State.STANDBY


def test_an_aircraft_without_hindrance_is_taken_over() -> None:
    seat = Seat()
    seat.until(*FLYING, limit_s=6.0)


def test_an_old_position_prevents_a_take_over() -> None:
    seat = Seat()
    seat.intruder = False
    seat.fly(2.0)
    seat.positions = False
    seat.fly(0.6)
    seat.intruder = True
    seat.fly(1.2)
    assert seat.state is State.STANDBY
    assert seat.sent == []


def test_an_old_heartbeat_prevents_a_take_over() -> None:
    seat = Seat(PX4)
    seat.intruder = False
    seat.fly(2.0)
    seat.heartbeats = False
    seat.fly(1.6)
    seat.intruder = True
    seat.fly(1.5)
    assert seat.state is not State.ENGAGING
    assert seat.sent == []


def test_a_settled_aircraft_is_monitored_again_after_the_configured_time() -> None:
    seat = Seat()
    seat.until(*FLYING)
    seat.mode = FBWA
    seat.fly(1.0)
    seat.mode, before_s = 10, seat.now_s
    seat.meet_s = seat.now_s + 500.0  # clear for now
    seat.until(State.MONITOR)
    assert 5.0 <= seat.now_s - before_s <= 9.5


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_hands_off_comes_before_any_decision(autopilot: int, monkeypatch: pytest.MonkeyPatch) -> None:
    seat = Seat(autopilot)
    seat.until(State.OUTER, State.INNER)

    def broken(*_: object) -> None:
        raise ZeroDivisionError("a decision that fails")

    monkeypatch.setattr(seat.engine.avoider, "decide", broken)
    seat._tick += 1
    taken = FBWA if autopilot == ARDUPILOT else 3 << 16
    fact = Heartbeat(AUTOPILOT, 1, autopilot, True, taken, 4)
    assert seat.engine.receive(fact, seat.now_s)
    effects = seat.engine.tick(seat.now_s)
    assert seat.state is State.HANDS_OFF
    assert not [e for e in effects if isinstance(e, Transmit) and acts(e.message)]
    assert not [e for e in effects if isinstance(e, Record)], "no decision was made"
