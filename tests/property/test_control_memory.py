"""Control depends only on the state, its data and the present facts, and has no other memory."""

import copy
import random
from collections.abc import Callable, Iterable

import pytest

from companion.control.context import Unheard
from companion.control.handover import Handover, Orders
from companion.control.readiness import Readiness
from companion.control.state_machine import State, StateData
from companion.mavlink.dialect import Message
from companion.mavlink.facts import CommandRequest, LandedState, Parameter, RcChannels
from companion.model import Decision
from companion.output.notice import AnyNotice
from tests.support.pilots_seat import ARDUPILOT, AUTOPILOT, FBWA, GCS, HOLD, PX4, US, Seat
from tests.support.thorough import sample


def plain(outgoing: Iterable[Message | AnyNotice] | None) -> object:
    """Messages and notices in a form that can be compared."""
    if outgoing is None:
        return None
    return [item if isinstance(item, tuple) else item.to_dict() for item in outgoing]


def contents(data: StateData) -> dict[str, object]:
    return {
        name: vars_of(value) if name in ("request", "rejoin") else value
        for name in StateData.__dataclass_fields__
        for value in [getattr(data, name)]
    }


def vars_of(value: object) -> object:
    if value is None:
        return None
    return vars(value) if hasattr(value, "__dict__") else repr(value)


class TwinSeat(Seat):
    """Repeats each step with a new `Handover` that has only the state and its data, and compares the two."""

    def __init__(self, autopilot: int) -> None:
        super().__init__(autopilot)
        self.handover: Handover = self.engine._handover
        self.visited = {self.handover.supervisor.state}
        self._check, self._step = self.handover.check_overrides, self.handover.step
        self.handover.check_overrides = self.check  # type: ignore[method-assign]
        self.handover.step = self.step  # type: ignore[method-assign]

    def twin(self) -> Handover:
        original = self.handover
        aircraft = copy.deepcopy(self.engine.aircraft)
        params = original._context.params
        fresh_s = self.engine._readiness._position_fresh_s
        readiness = Readiness(
            aircraft,
            params,
            position_fresh_s=fresh_s,
            other_avoider=self.engine._notices.other_avoider,
        )
        twin = Handover(aircraft, params, readiness)
        twin.supervisor.state = original.supervisor.state
        twin.supervisor.data = copy.deepcopy(original.supervisor.data)
        twin._context.role = original._context.role
        return twin

    def check(self, now_s: float) -> object:
        self.visited.add(self.handover.supervisor.state)
        twin = self.twin()
        expected = plain(twin.check_overrides(now_s))
        outgoing = self._check(now_s)
        self.compare(twin, expected, plain(outgoing))
        return outgoing

    def step(
        self, decision: Decision, orders: Orders, now_s: float, unheard: Unheard | None = None
    ) -> object:
        twin = self.twin()
        expected = plain(twin.step(decision, orders, now_s, unheard))
        outgoing = self._step(decision, orders, now_s, unheard)
        self.compare(twin, expected, plain(outgoing))
        return outgoing

    def compare(self, twin: Handover, expected: object, outgoing: object) -> None:
        assert outgoing == expected
        assert twin.supervisor.state is self.handover.supervisor.state
        assert contents(twin.supervisor.data) == contents(self.handover.supervisor.data)
        self.visited.add(twin.supervisor.state)


def disturb(seat: TwinSeat, chance: random.Random) -> None:
    """Disturb the flight at random, or end all disturbances."""
    ours = seat.engine.aircraft.guided
    what = chance.randrange(17)
    if what == 0:
        seat.mode = FBWA if seat.autopilot == ARDUPILOT else 3 << 16
    elif what == 1:
        seat.mode = seat.prior_mode
    elif what == 2:
        seat.status = 9 - seat.status  # failsafe on or off
    elif what == 3:
        obeys = chance.random() < 0.6
        seat.obeys = lambda _message: obeys
    elif what == 4:
        seat.heartbeats = not seat.heartbeats
    elif what in (5, 11):
        seat.finite = not (seat.finite and ours)
        seat.mode = chance.choice((seat.mode, seat.prior_mode))
    elif what == 6:
        seat.set_role(chance.randrange(1, 3))
    elif what == 7:
        seat.receive(CommandRequest(GCS, US, 193, (1.0, 0.0, None, None)))
    elif what == 8:
        seat.receive(RcChannels(AUTOPILOT, (chance.choice((1500, 1700)), 1500, 1000, 1500)))
    elif what == 9:
        seat.receive(LandedState(AUTOPILOT, chance.choice((2, 2, 4))))
    elif what == 10:
        seat.answer(176, chance.choice((0, 1, 4)))
    elif what == 12:
        seat.engine.note_gap(chance.choice((0.6, 4.0)), seat.now_s)
    else:
        end_disturbances(seat)


def end_disturbances(seat: TwinSeat) -> None:
    """End all disturbances, and let another aircraft come."""
    seat.status, seat.finite, seat.heartbeats = 4, True, True
    seat.mode = seat.prior_mode
    seat.obeys = lambda _message: True
    seat.set_role(2)
    seat.receive(LandedState(AUTOPILOT, 2))
    seat.receive(RcChannels(AUTOPILOT, (1500, 1500, 1000, 1500)))
    seat.fly(7.0)
    let_one_come(seat)


def let_one_come(seat: TwinSeat) -> None:
    """Let an aircraft come that is met in 35 s."""
    seat.intruder = True
    seat.meet_s = seat.now_s + 35.0


def begin(autopilot: int, *, obeys: bool = True) -> TwinSeat:
    """A flight on the mission, at first without other aircraft."""
    seat = TwinSeat(autopilot)
    seat.obeys = lambda _message: obeys
    seat.intruder = False
    seat.fly(6.0)
    assert seat.state is State.MONITOR
    return seat


def end(seat: TwinSeat) -> set[State]:
    """Stop the companion; returns the states visited."""
    seat.stop()
    seat.fly(1.0)
    return seat.visited


def fly_at_random(autopilot: int, seed: int) -> set[State]:
    """Fly with random disturbances, the first two of them without other aircraft."""
    chance = random.Random(seed)
    seat = begin(autopilot, obeys=seed % 2 == 0)
    for number in range(16):
        if number == 2:
            let_one_come(seat)
        seat.fly(chance.choice((0.3, 1.0, 3.0)))
        disturb(seat, chance)
    return end(seat)


def go_on(_seat: TwinSeat) -> None:
    """Nothing happens: it is flown until the companion stops."""


def refuse(seat: TwinSeat) -> None:
    seat.obeys = lambda _message: False
    seat.set_role(1)


def stall(seat: TwinSeat, seconds: float = 4.0) -> None:
    seat._tick += round(seconds * 10)
    seat.engine.note_gap(seconds, seat.now_s)


def take(seat: TwinSeat) -> None:
    seat.mode = FBWA if seat.autopilot == ARDUPILOT else 3 << 16


def lose_the_setpoint(seat: TwinSeat) -> None:
    seat.finite = False


def lose_mode_and_setpoint(seat: TwinSeat) -> None:
    """As PX4 does when the stream of setpoints ends, here in a stall of ours."""
    seat.receive(Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
    seat.fly(1.0)
    seat.status, seat.finite, seat.mode = 5, False, HOLD
    stall(seat, 1.2)


# What happens to an aircraft that is flown, and the rare state that control then comes to.
EVENTS: list[tuple[int, Callable[[TwinSeat], None], State]] = [
    (ARDUPILOT, go_on, State.STOPPING),
    (PX4, go_on, State.STOPPING),
    (ARDUPILOT, refuse, State.RELEASING),
    (PX4, refuse, State.RELEASING),
    (ARDUPILOT, stall, State.RESYNCHRONISING),
    (PX4, stall, State.RESYNCHRONISING),
    (ARDUPILOT, take, State.HANDS_OFF),
    (PX4, take, State.HANDS_OFF),
    (PX4, lose_the_setpoint, State.RECOVERING),
    (PX4, lose_mode_and_setpoint, State.RE_ENTERING),
]
# The states that nearly every random flight comes to.
COMMON = {
    State.STANDBY,
    State.MONITOR,
    State.ENGAGING,
    State.OUTER,
    State.INNER,
    State.SUPPRESSED,
    State.STOPPED,
}


def test_each_state_has_a_flight() -> None:
    """But the return: a mission that is left for a moment has no circle to return to."""
    assert COMMON | {state for _, _, state in EVENTS} == set(State) - {State.WAITING, State.RETURNING}


@pytest.mark.parametrize(("autopilot", "happens", "state"), EVENTS)
def test_state_and_data_are_all_that_is_remembered_of_what_happens(
    autopilot: int, happens: Callable[[TwinSeat], None], state: State
) -> None:
    seat = begin(autopilot)
    let_one_come(seat)
    seat.fly(4.0)
    happens(seat)
    seat.fly(3.0)
    seat.finite = True
    seat.fly(5.0)
    assert state in end(seat)


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_state_and_data_are_all_that_is_remembered_of_a_refusal(autopilot: int) -> None:
    seat = begin(autopilot, obeys=False)
    let_one_come(seat)
    seat.fly(15.0)
    assert State.WAITING in end(seat)


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_state_and_data_are_all_that_is_remembered_at_random(autopilot: int) -> None:
    visited = set[State]().union(*(fly_at_random(autopilot, seed) for seed in range(sample(2, 12))))
    assert visited >= COMMON
