"""PX4's OFFBOARD requested, and another mode shown: entered and left unheard, or the pilot's own choice."""

import pytest

from companion.control.state_machine import State
from companion.mavlink.dialect import Message
from companion.mavlink.facts import Parameter
from tests.support.pilots_seat import AUTOPILOT, HOLD, MISSION, OFFBOARD, PX4, SET_MODE, Seat


def engaging() -> Seat:
    """PX4 that enters HOLD without setpoints; it has not heard our request for OFFBOARD."""
    seat = Seat(PX4)
    seat.fly(1.0)
    seat.receive(Parameter(AUTOPILOT, "COM_OBL_RC_ACT", 5.0))
    seat.obeys = lambda message: getattr(message, "command", None) != SET_MODE
    seat.until(State.ENGAGING)
    return seat


def modes(messages: list[Message]) -> list[int]:
    return [round(m.param2) << 16 | round(m.param3) << 24 for m in messages if m.get_type() == "COMMAND_LONG"]


@pytest.mark.parametrize("after_s", [0.7, 1.0, 1.5, 2.5])
@pytest.mark.parametrize("slow_heartbeats", [False, True])
def test_a_hold_that_the_pilot_chose_while_our_request_was_lost_is_left_alone(
    after_s: float, slow_heartbeats: bool
) -> None:
    seat = engaging()
    asked = []
    for _ in range(round(after_s * 10)):
        asked += modes(seat.fly(0.1))
    assert OFFBOARD in asked
    seat.mode = HOLD
    if slow_heartbeats:  # PX4 sends one a second
        seat.heartbeats = False
        assert OFFBOARD not in modes(seat.fly(1.0))[1:]
        seat.heartbeats = True
    seat.fly(0.5)
    assert seat.state is State.HANDS_OFF
    assert seat.fly(20.0) == []


@pytest.mark.parametrize("silence_s", [1.6, 2.5, 4.0])
def test_a_hold_that_follows_an_offboard_in_a_silence_is_given_back(silence_s: float) -> None:
    """The request arrived, the link was lost, and without setpoints it fell into HOLD."""
    seat = engaging()
    seat.fly(0.7)
    telemetry = seat._telemetry
    seat._telemetry, seat.transmits = list, False  # type: ignore[method-assign]
    seat.fly(silence_s)
    seat._telemetry, seat.transmits = telemetry, True  # type: ignore[method-assign]
    seat.mode, seat.status, seat.obeys = HOLD, 5, lambda _message: True
    seat.fly(12.0)
    assert MISSION in modes(seat.sent)
