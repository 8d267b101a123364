"""A request for the guided mode that arrives late: undone for the pilot's mode, and not repeated soon."""

import itertools

import pytest

from companion.control.state_machine import State
from companion.mavlink.dialect import Message
from companion.mavlink.facts import Heartbeat
from tests.support.pilots_seat import (
    ARDUPILOT,
    AUTO,
    AUTOPILOT,
    FBWA,
    GUIDED,
    OFFBOARD,
    PX4,
    SET_MODE,
    T0,
    Seat,
)

POSCTL = 3 << 16


def modes(messages: list[Message]) -> list[int]:
    """The modes asked for (PX4: main modes)."""
    return [round(m.param2) for m in messages if getattr(m, "command", None) == SET_MODE]


@pytest.mark.parametrize(
    ("autopilot", "taken", "guided", "wanted"), [(ARDUPILOT, FBWA, GUIDED, FBWA), (PX4, POSCTL, OFFBOARD, 3)]
)
def test_a_late_request_is_undone_for_the_mode_that_the_pilot_chose_just_before(
    autopilot: int, taken: int, guided: int, wanted: int
) -> None:
    """The pilot's mode and the guided mode after it are heard in one burst, between two ticks."""
    seat = Seat(autopilot)
    seat.obeys = lambda _message: False
    seat.until(State.ENGAGING)
    seat.fly(1.0)
    for seat.mode in (taken, guided):
        seat.receive(Heartbeat(AUTOPILOT, 1, autopilot, True, seat.mode, 4))
    asked = modes(seat.fly(3.0))
    assert asked
    assert set(asked) == {wanted}, "not the mission over the pilot"


class SlowAutopilot(Seat):
    """Enters the guided mode 4 s after the first request for it; leaves it at once."""

    def __init__(self) -> None:
        super().__init__()
        self.meet_s = T0 + 70.0
        self.enters_s: float | None = None

    def _obey(self, message: Message) -> None:
        if modes([message]) != [GUIDED]:
            super()._obey(message)
        elif self.enters_s is None:
            self.enters_s = self.now_s + 4.0

    def step(self) -> None:
        if self.enters_s is not None and self.now_s >= self.enters_s:
            self.mode, self.enters_s = GUIDED, None
        self.fly(0.1)


def test_the_growing_wait_after_requests_that_were_given_up_outlasts_their_late_arrival() -> None:
    seat = SlowAutopilot()
    seat.until(State.ENGAGING)
    begun_s, before = [seat.now_s], seat.state
    for _ in range(300):
        seat.step()
        if seat.state is State.ENGAGING and before is not State.ENGAGING:
            begun_s.append(seat.now_s)
        before = seat.state
    waits_s = [round(after - earlier) for earlier, after in itertools.pairwise(begun_s)]
    assert waits_s == [6, 7, 9], "waits of 2, 4 and 6 s after requests of 3 s; the first one was undone"


def test_an_emergency_does_not_undo_a_late_request_for_the_mission_over_the_pilots_mode() -> None:
    seat = Seat()
    seat.obeys = lambda _message: False
    seat.until(State.ENGAGING)
    seat.fly(0.5)
    release = seat.engine.emergency_release(seat.now_s)
    asked = []
    for tick, mode in enumerate([FBWA] * 5 + [GUIDED] * 20):
        now_s = seat.now_s + tick / 10
        release.observe(Heartbeat(AUTOPILOT, 1, ARDUPILOT, True, mode, 4), now_s)
        asked += modes([*release.messages(now_s)])
    assert AUTO not in asked
