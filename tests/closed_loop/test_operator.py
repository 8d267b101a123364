"""The role set by the operator in flight: fly, advise or off, on both autopilots."""

import pytest

from companion.control.state_machine import State, SupervisorParams
from companion.engine import EngineConfig
from companion.mavlink.dialect import Message, mavlink
from companion.model import Layer, Role
from sim.scenario import Autopilot
from tests.support.autopilots import MISSION_MODE, PX4, every
from tests.support.monitored_loop import DO_SET_MODE, MonitoredLoop, without_traffic
from tests.support.overrides import HOLDS, in_state

US = (1, 196)
RELEASED_WITHIN_S = 3.0


def by_parameter(role: Role) -> Message:
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    return mavlink.MAVLink_param_set_message(*US, b"CA_ROLE", float(role), kind)


def by_command(role: Role) -> Message:
    custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return mavlink.MAVLink_command_long_message(*US, DO_SET_MODE, 0, custom, float(role), 0, 0, 0, 0, 0)


by_either = pytest.mark.parametrize("request_of", [by_parameter, by_command])


@every
@by_either
@pytest.mark.parametrize("state", [State.OUTER, State.INNER])
@pytest.mark.parametrize("role", [Role.ADVISE, Role.OFF])
def test_advise_or_off_releases_the_aircraft_and_ends_all_commands(
    autopilot: Autopilot, request_of: type, state: State, role: Role
) -> None:
    loop = in_state(autopilot, state)
    loop.send_to_companion(request_of(role))
    assert loop.state is State.RELEASING, "at once"
    loop.until_true(lambda: loop.mode_name == MISSION_MODE[autopilot], RELEASED_WITHIN_S)
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


@every
@by_either
def test_after_fly_it_takes_over_again(autopilot: Autopilot, request_of: type) -> None:
    loop = in_state(autopilot, State.OUTER)
    loop.send_to_companion(request_of(Role.ADVISE))
    loop.until(State.STANDBY, limit_s=RELEASED_WITHIN_S + 1.0)
    loop.run(1.0)
    loop.send_to_companion(request_of(Role.FLY))
    loop.until(State.OUTER, State.INNER, limit_s=2.0)


@every
def test_advise_computes_and_reports_as_in_flight(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(role="advise"))
    sent: list[str] = []
    loop = MonitoredLoop(
        without_traffic(), autopilot=autopilot, config=config, parameters=HOLDS if autopilot == PX4 else {}
    )
    transmit = loop._transmit

    def recording(time_us: int, effect: object) -> None:
        sent.append(effect.message.get_type())  # type: ignore[attr-defined]
        transmit(time_us, effect)  # type: ignore[arg-type]

    loop._transmit = recording  # type: ignore[method-assign]
    loop.run(2.5)
    loop.intrude(3500.0)
    loop.run(10.0)
    assert loop.sent == []
    assert loop.state is State.STANDBY
    assert loop.engine.decision.guidance is not None
    assert any(text.startswith("Advise ") and "SUDDEN" in text for text in loop.flight.texts)
    assert sent.count("COLLISION") >= 7
    assert len(loop.flight.records) > 80


@every
def test_fly_during_a_conflict_takes_over(autopilot: Autopilot) -> None:
    config = EngineConfig(supervisor=SupervisorParams(role="off"))
    loop = MonitoredLoop(without_traffic(), autopilot=autopilot, config=config)
    loop.run(2.5)
    loop.intrude(3500.0)
    loop.run(4.0)
    assert loop.sent == []
    assert loop.flight.layers == []
    loop.send_to_companion(by_parameter(Role.FLY))
    loop.until(State.OUTER, limit_s=2.0)
