"""Told to resume the mission now, we obey, whoever is in the way; and avoid everybody else as ever."""

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.engine import EngineConfig, Transmit
from companion.mavlink.dialect import Message, mavlink
from companion.model import Layer, Role
from sim.scenario import Autopilot
from tests.closed_loop.test_operator import by_command
from tests.support.takings import ARDUPILOT, BOTH, GUIDED_MODE, MISSION_MODE, begun
from tests.support.watched import Watched, alone

US = (1, 196)
CONTINUE = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
SECOND = 0xBBBBBB, "SECOND"
ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
both = pytest.mark.parametrize("autopilot", BOTH)


def long(confirmation: int = 0) -> Message:
    return mavlink.MAVLink_command_long_message(*US, CONTINUE, confirmation, 1, 0, 0, 0, 0, 0, 0)


def whole() -> Message:
    return mavlink.MAVLink_command_int_message(*US, 0, CONTINUE, 0, 0, 1, 0, 0, 0, 0, 0, 0)


def told(loop: Watched, message: Message) -> int:
    """What the answer to a command is."""
    answers: list[Message] = []
    deaf = loop.deaf

    def listening(effect: Transmit) -> bool:
        if effect.message.get_type() == "COMMAND_ACK":
            answers.append(effect.message)
        return deaf(effect)

    loop.deaf = listening
    loop.tell_companion(message)
    loop.deaf = deaf
    (answer,) = answers
    assert (answer.command, answer.target_system, answer.target_component) == (CONTINUE, 255, 190)
    result: int = answer.result
    return result


def until_given_back(loop: Watched, autopilot: Autopilot) -> None:
    loop.deaf = lambda _: False
    loop.until(State.MONITOR, limit_s=4.0)
    assert loop.mode_name == MISSION_MODE[autopilot]


@both
@pytest.mark.parametrize("says", [long, whole])
@pytest.mark.parametrize("state", [State.ENGAGING, State.OUTER, State.INNER, State.RELEASING])
def test_the_mission_goes_on_at_once_and_this_conflict_is_not_avoided_again(
    autopilot: Autopilot, says: type, state: State
) -> None:
    loop = begun(autopilot, state)
    assert told(loop, says()) == ACCEPTED
    assert loop.state is State.RELEASING, "at once"
    until_given_back(loop, autopilot)
    engagements = loop.flight.engagements
    still_conflict = 0
    for _ in range(80):
        loop.run(0.1)
        still_conflict += loop.engine.decision.layer is not Layer.CLEAR  # type: ignore[union-attr]
        assert loop.state is State.MONITOR
    assert loop.flight.engagements == engagements
    assert loop.sent_since(State.MONITOR) == []
    assert loop.mode_name == MISSION_MODE[autopilot]
    assert not loop.world.vehicle.truth.uncontrolled
    if state is not State.RELEASING:
        assert still_conflict > 10, "the conflict went on"
        texts = [text for text in loop.flight.texts if text.startswith("Told to resume")]
        near = "near, " if state is State.INNER else ""
        assert texts == [f"Told to resume {MISSION_MODE[autopilot]}: SUDDEN {near}not avoided"]
        assert len(texts[0]) <= 50


@both
def test_a_lost_answer_does_no_harm_asked_again_it_is_done_again(autopilot: Autopilot) -> None:
    loop = begun(autopilot, State.OUTER)
    assert [told(loop, long(count)) for count in range(3)] == [ACCEPTED] * 3
    until_given_back(loop, autopilot)
    assert told(loop, long(3)) == ACCEPTED, "it is as he wants it"
    loop.run(2.0)
    assert loop.state is State.MONITOR
    assert len([text for text in loop.flight.texts if text.startswith("Told to resume")]) == 1


def test_of_an_aircraft_that_is_not_flown_by_us_it_is_denied() -> None:
    loop = Watched(alone())
    loop.run(2.5)
    assert told(loop, long()) == DENIED
    loop.run(1.0)
    assert loop.state is State.MONITOR
    loop.intrude(3500.0)
    loop.until(State.OUTER, limit_s=10.0)


@both
def test_somebody_else_is_avoided_meanwhile(autopilot: Autopilot) -> None:
    loop = begun(autopilot, State.OUTER)
    told(loop, long())
    until_given_back(loop, autopilot)
    loop.intrude(2500.0, named=SECOND)
    loop.until(State.OUTER, State.INNER, limit_s=5.0)
    assert loop.mode_name == GUIDED_MODE[autopilot]


@both
def test_when_it_is_over_nothing_is_left_of_it(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(settle_s=3.0))
    loop = begun(autopilot, State.OUTER, config)
    told(loop, long())
    until_given_back(loop, autopilot)
    loop.until_so(lambda: loop.engine.decision.layer is Layer.CLEAR, 90.0)  # type: ignore[union-attr]
    loop.run(4.0)
    assert loop.state is State.MONITOR
    assert told(loop, long()) == DENIED, "there is nothing left to decide about"
    loop.intrude(3500.0, named=SECOND)
    loop.until(State.OUTER, limit_s=10.0)


def test_told_to_fly_it_avoids_everybody_again() -> None:
    loop = begun(ARDUPILOT, State.OUTER)
    told(loop, long())
    until_given_back(loop, ARDUPILOT)
    loop.tell_companion(by_command(Role.ADVISE))
    loop.run(0.5)
    loop.tell_companion(by_command(Role.FLY))
    loop.until(State.OUTER, State.INNER, limit_s=2.0)


@both
def test_a_pilot_who_takes_it_meanwhile_has_it(autopilot: Autopilot) -> None:
    loop = begun(autopilot, State.OUTER)
    told(loop, long())
    name = "FBWA" if autopilot == ARDUPILOT else "ALTCTL"
    loop.world.vehicle.set_mode(name)
    loop.run(8.0)
    assert loop.mode_name == name
    assert loop.state is State.HANDS_OFF
