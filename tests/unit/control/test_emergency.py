"""The emergency release follows the newest heartbeat alone, and never acts against the pilot."""

import pytest

from companion.control.emergency import EmergencyRelease
from companion.control.state_machine import State
from companion.mavlink.dialect import Message
from companion.mavlink.facts import Heartbeat
from tests.support.pilots_seat import (
    ARDUPILOT,
    AUTO,
    AUTOPILOT,
    FBWA,
    GUIDED,
    MISSION,
    OFFBOARD,
    PX4,
    SET_MODE,
    Seat,
)

GUIDED_OF = {ARDUPILOT: GUIDED, PX4: OFFBOARD}
PRIOR_OF = {ARDUPILOT: AUTO, PX4: MISSION}


class Emergency:
    """An engine that failed while it flew; the autopilot's heartbeats are given by hand."""

    def __init__(self, autopilot: int, *states: State) -> None:
        self.seat = Seat(autopilot)
        self.seat.until(*(states or (State.OUTER, State.INNER)))
        self.now_s = self.seat.now_s
        self.release: EmergencyRelease = self.seat.engine.emergency_release(self.now_s)

    def heartbeat(self, mode: int) -> None:
        fact = Heartbeat(AUTOPILOT, 1, self.seat.autopilot, True, mode, 4)
        self.release.observe(fact, self.now_s)

    def run(self, seconds: float, mode: int | None = None) -> list[Message]:
        """The messages of some seconds; heartbeats show `mode` five times a second, `None`: no heartbeats."""
        sent = []
        for tick in range(round(seconds * 10)):
            self.now_s = round(self.now_s + 0.1, 1)
            if mode is not None and tick % 2 == 0:
                self.heartbeat(mode)
            sent += self.release.messages(self.now_s)
        return sent


def modes(messages: list[Message]) -> list[int]:
    """The requested modes (PX4: main modes)."""
    return [round(m.param2) for m in messages if getattr(m, "command", None) == SET_MODE]


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_the_former_mode_is_requested_while_the_heartbeat_shows_the_guided_mode(autopilot: int) -> None:
    emergency = Emergency(autopilot)
    requested = modes(emergency.run(2.0, GUIDED_OF[autopilot]))
    wanted = PRIOR_OF[autopilot] if autopilot == ARDUPILOT else PRIOR_OF[autopilot] >> 16 & 0xFF
    assert set(requested) == {wanted}
    assert not emergency.release.finished
    emergency.heartbeat(PRIOR_OF[autopilot])
    assert emergency.release.finished
    assert modes(emergency.run(2.0, PRIOR_OF[autopilot])) == []


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_nothing_is_sent_against_the_pilot(autopilot: int) -> None:
    emergency = Emergency(autopilot)
    emergency.heartbeat(FBWA if autopilot == ARDUPILOT else 3 << 16)
    assert emergency.run(3.0, FBWA if autopilot == ARDUPILOT else 3 << 16) == []
    assert emergency.run(3.0, GUIDED_OF[autopilot]) == [], "the guided mode is the pilot's choice now"


def test_a_pilots_mode_change_ends_the_release() -> None:
    emergency = Emergency(ARDUPILOT)
    assert modes(emergency.run(1.0, GUIDED)) == [AUTO]
    assert emergency.run(2.0, FBWA) == []


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_nothing_is_requested_without_heartbeats(autopilot: int) -> None:
    emergency = Emergency(autopilot)
    emergency.run(1.6)
    assert emergency.run(5.0) == []


def test_an_aircraft_that_we_do_not_have_is_left_alone() -> None:
    emergency = Emergency(ARDUPILOT, State.MONITOR)
    assert emergency.release.finished
    assert emergency.run(2.0, GUIDED) == []


def test_a_take_over_under_way_is_undone_when_it_arrives() -> None:
    seat = Seat()
    seat.obeys = lambda _message: False
    seat.until(State.ENGAGING)
    seat.fly(0.5)
    emergency = Emergency.__new__(Emergency)
    emergency.seat, emergency.now_s = seat, seat.now_s
    emergency.release = seat.engine.emergency_release(seat.now_s)
    assert modes(emergency.run(0.5, AUTO)) == []
    assert modes(emergency.run(0.5, GUIDED)) == [AUTO]


def test_a_failing_aircraft_does_not_hide_the_pilots_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    emergency = Emergency(ARDUPILOT)

    def broken(*_: object) -> bool:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(emergency.seat.engine.aircraft, "observe", broken)
    with pytest.raises(ZeroDivisionError):
        emergency.heartbeat(FBWA)
    assert emergency.run(2.0) == []
