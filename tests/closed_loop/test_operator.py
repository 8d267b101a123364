"""What the operator lets us do, switched in flight: fly, advise only, be off; on both autopilots."""

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.engine import EngineConfig
from companion.mavlink.dialect import Message, mavlink
from companion.model import Layer, Role
from sim.scenario import Autopilot
from tests.support.takings import BOTH, HOLDS, MISSION_MODE, PX4, begun
from tests.support.watched import DO_SET_MODE, Watched, alone

US = (1, 196)
GIVEN_BACK_WITHIN_S = 3.0
both = pytest.mark.parametrize("autopilot", BOTH)


def by_parameter(role: Role) -> Message:
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    return mavlink.MAVLink_param_set_message(*US, b"CA_ROLE", float(role), kind)


def by_command(role: Role) -> Message:
    custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return mavlink.MAVLink_command_long_message(*US, DO_SET_MODE, 0, custom, float(role), 0, 0, 0, 0, 0)


by_either = pytest.mark.parametrize("says", [by_parameter, by_command])


@both
@by_either
@pytest.mark.parametrize("state", [State.OUTER, State.INNER])
@pytest.mark.parametrize("role", [Role.ADVISE, Role.OFF])
def test_told_to_stop_the_aircraft_is_given_back_and_nothing_more_commanded(
    autopilot: Autopilot, says: type, state: State, role: Role
) -> None:
    loop = begun(autopilot, state)
    loop.tell_companion(says(role))
    assert loop.state is State.RELEASING, "at once"
    loop.until_so(lambda: loop.mode_name == MISSION_MODE[autopilot], GIVEN_BACK_WITHIN_S)
    loop.until(State.STANDBY, limit_s=1.5)
    loop.run(3.0)
    assert loop.state is State.STANDBY
    assert loop.sent_since(State.STANDBY) == []
    assert loop.mode_name == MISSION_MODE[autopilot]
    assert not loop.world.vehicle.truth.uncontrolled
    decision = loop.engine.decision
    if role is Role.OFF:
        assert (decision.layer, decision.because) == (Layer.CLEAR, "off")
    else:
        assert decision.layer is not Layer.CLEAR
        assert decision.guidance is not None


@both
@by_either
def test_told_to_fly_again_it_takes_over_again(autopilot: Autopilot, says: type) -> None:
    loop = begun(autopilot, State.OUTER)
    loop.tell_companion(says(Role.ADVISE))
    loop.until(State.STANDBY, limit_s=GIVEN_BACK_WITHIN_S + 1.0)
    loop.run(1.0)
    loop.tell_companion(says(Role.FLY))
    loop.until(State.OUTER, State.INNER, limit_s=2.0)


@both
def test_advising_everything_is_computed_and_announced_as_if_flown(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(role="advise"))
    said: list[str] = []
    loop = Watched(alone(), autopilot=autopilot, config=config, parameters=HOLDS if autopilot == PX4 else {})
    transmit = loop._transmit

    def listening(time_us: int, effect: object) -> None:
        said.append(effect.message.get_type())  # type: ignore[attr-defined]
        transmit(time_us, effect)  # type: ignore[arg-type]

    loop._transmit = listening  # type: ignore[method-assign]
    loop.run(2.5)
    loop.intrude(3500.0)
    loop.run(10.0)
    assert loop.sent == []
    assert loop.state is State.STANDBY
    assert loop.engine.decision.guidance is not None
    assert any(text.startswith("Traffic SUDDEN") for text in loop.flight.texts)
    assert said.count("COLLISION") >= 7
    assert len(loop.flight.decisions) > 80


@both
def test_told_to_fly_in_the_middle_of_a_conflict_it_takes_over(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(role="off"))
    loop = Watched(alone(), autopilot=autopilot, config=config)
    loop.run(2.5)
    loop.intrude(3500.0)
    loop.run(4.0)
    assert loop.sent == []
    assert loop.flight.layers == []
    loop.tell_companion(by_parameter(Role.FLY))
    loop.until(State.OUTER, limit_s=2.0)
