"""Resume now: the operator resumes the mission despite a conflict; other traffic is still avoided."""

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.engine import EngineConfig, Transmit
from companion.mavlink.dialect import Message, mavlink
from companion.model import Layer, Role
from sim.scenario import Autopilot
from tests.closed_loop.test_operator import by_command
from tests.support.autopilots import ARDUPILOT, GUIDED_MODE, MISSION_MODE, PX4_1_18, every, ways
from tests.support.monitored_loop import MonitoredLoop, without_traffic
from tests.support.overrides import in_state
from tests.support.thorough import sample

US = (1, 196)
CONTINUE = mavlink.MAV_CMD_DO_PAUSE_CONTINUE
SECOND = 0xBBBBBB, "SECOND"
ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED


def by_long(confirmation: int = 0) -> Message:
    return mavlink.MAVLink_command_long_message(*US, CONTINUE, confirmation, 1, 0, 0, 0, 0, 0, 0)


def by_int() -> Message:
    return mavlink.MAVLink_command_int_message(*US, 0, CONTINUE, 0, 0, 1, 0, 0, 0, 0, 0, 0)


def result_of(loop: MonitoredLoop, message: Message) -> int:
    """The companion's result for a command."""
    answers: list[Message] = []
    drops = loop.drops

    def recording(effect: Transmit) -> bool:
        if effect.message.get_type() == "COMMAND_ACK":
            answers.append(effect.message)
        return drops(effect)

    loop.drops = recording
    loop.send_to_companion(message)
    loop.drops = drops
    (answer,) = answers
    assert (answer.command, answer.target_system, answer.target_component) == (CONTINUE, 255, 190)
    result: int = answer.result
    return result


def until_released(loop: MonitoredLoop, autopilot: Autopilot) -> None:
    loop.drops = lambda _: False
    loop.until(State.MONITOR, limit_s=4.0)
    assert loop.mode_name == MISSION_MODE[autopilot]


# Both forms of the command are one request.
FLOWN = (State.ENGAGING, State.OUTER, State.INNER, State.RELEASING)
ROWS = [(by_long, state) for state in FLOWN] + [(by_int, state) for state in sample(FLOWN[1:2], FLOWN)]


@every
@pytest.mark.parametrize(("command", "state"), ROWS)
def test_the_mission_resumes_at_once_and_this_conflict_is_not_avoided_again(
    autopilot: Autopilot, command: type, state: State
) -> None:
    loop = in_state(autopilot, state)
    assert result_of(loop, command()) == ACCEPTED
    assert loop.state is State.RELEASING, "at once"
    until_released(loop, autopilot)
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
        texts = [text for text in loop.flight.texts if text.startswith("Resuming")]
        near = "near, " if state is State.INNER else ""
        assert texts == [f"Resuming {MISSION_MODE[autopilot]}: SUDDEN {near}not avoided"]
        assert len(texts[0]) <= 50


@every
def test_a_repeated_command_is_accepted_again(autopilot: Autopilot) -> None:
    loop = in_state(autopilot, State.OUTER)
    assert [result_of(loop, by_long(count)) for count in range(3)] == [ACCEPTED] * 3
    until_released(loop, autopilot)
    assert result_of(loop, by_long(3)) == ACCEPTED, "already done"
    loop.run(2.0)
    assert loop.state is State.MONITOR
    assert len([text for text in loop.flight.texts if text.startswith("Resuming")]) == 1


def test_without_an_avoidance_it_is_denied() -> None:
    loop = MonitoredLoop(without_traffic())
    loop.run(2.5)
    assert result_of(loop, by_long()) == DENIED
    loop.run(5.0)
    assert loop.state is State.MONITOR
    loop.intrude(3500.0)
    loop.until(State.OUTER, limit_s=10.0)


@every
def test_another_intruder_is_avoided_meanwhile(autopilot: Autopilot) -> None:
    loop = in_state(autopilot, State.OUTER)
    result_of(loop, by_long())
    until_released(loop, autopilot)
    loop.intrude(2500.0, named=SECOND)
    loop.until(State.OUTER, State.INNER, limit_s=5.0)
    assert loop.mode_name == GUIDED_MODE[autopilot]


@ways(PX4_1_18)
def test_after_the_conflict_the_suppression_ends(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(settle_s=3.0))
    loop = in_state(autopilot, State.OUTER, config)
    result_of(loop, by_long())
    until_released(loop, autopilot)
    loop.until_true(lambda: loop.engine.decision.layer is Layer.CLEAR, 90.0)  # type: ignore[union-attr]
    loop.run(4.0)
    assert loop.state is State.MONITOR
    assert result_of(loop, by_long()) == DENIED, "no conflict left"
    loop.intrude(3500.0, named=SECOND)
    loop.until(State.OUTER, limit_s=10.0)


def test_role_fly_ends_the_suppression() -> None:
    loop = in_state(ARDUPILOT, State.OUTER)
    result_of(loop, by_long())
    until_released(loop, ARDUPILOT)
    loop.send_to_companion(by_command(Role.ADVISE))
    loop.run(0.5)
    loop.send_to_companion(by_command(Role.FLY))
    loop.until(State.OUTER, State.INNER, limit_s=2.0)


@every
def test_a_pilot_override_meanwhile_is_respected(autopilot: Autopilot) -> None:
    loop = in_state(autopilot, State.OUTER)
    result_of(loop, by_long())
    name = "FBWA" if autopilot == ARDUPILOT else "ALTCTL"
    loop.world.vehicle.set_mode(name)
    loop.run(8.0)
    assert loop.mode_name == name
    assert loop.state is State.HANDS_OFF
