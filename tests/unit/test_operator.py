"""The operator's word: off, advise or fly, by parameter or command."""

import pytest

from companion.engine.operator import PARAMETER, Operator
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import CommandRequest, Fact, ParameterRequest, ParameterSet, Sender
from companion.supervisor import Role

OURS, AUTOPILOT, ALL, GCS = Sender(1, 196), Sender(1, 1), Sender(1, 0), Sender(255, 190)
SET_MODE = mavlink.MAV_CMD_DO_SET_MODE


@pytest.fixture
def operator() -> Operator:
    return Operator(Role.FLY, lambda: OURS)


def command(role: float | None, *, target: Sender = OURS, base: float | None = 1.0) -> CommandRequest:
    return CommandRequest(GCS, target, SET_MODE, (base, role, 0.0, 0.0))


@pytest.mark.parametrize("role", list(Role))
def test_the_command_is_obeyed_and_acknowledged_to_whoever_sent_it(operator: Operator, role: Role) -> None:
    (answer,) = operator.receive(command(float(role)))
    assert operator.role is role
    assert (answer.command, answer.result) == (SET_MODE, mavlink.MAV_RESULT_ACCEPTED)
    assert (answer.target_system, answer.target_component) == (255, 190)


@pytest.mark.parametrize(
    "request_", [command(3.0), command(0.5), command(None), command(1.0, base=0.0), command(1.0, base=None)]
)
def test_what_means_nothing_is_denied(operator: Operator, request_: CommandRequest) -> None:
    (answer,) = operator.receive(request_)
    assert answer.result == mavlink.MAV_RESULT_DENIED
    assert operator.role is Role.FLY


def test_other_commands_are_unsupported(operator: Operator) -> None:
    (answer,) = operator.receive(CommandRequest(GCS, OURS, 400, (1.0, 0.0, 0.0, 0.0)))
    assert (answer.command, answer.result) == (400, mavlink.MAV_RESULT_UNSUPPORTED)


@pytest.mark.parametrize("target", [AUTOPILOT, ALL, Sender(0, 0), Sender(2, 196)])
def test_a_mode_meant_for_the_autopilot_or_for_all_is_not_our_role(
    operator: Operator, target: Sender
) -> None:
    assert operator.receive(command(0.0, target=target)) == []
    assert operator.receive(ParameterSet(GCS, target, PARAMETER, 0.0)) == []
    assert operator.role is Role.FLY


def test_the_parameter_is_set_and_every_set_is_answered(operator: Operator) -> None:
    (answer,) = operator.receive(ParameterSet(GCS, OURS, PARAMETER, 1.0))
    assert operator.role is Role.ADVISE
    assert (answer.param_value, answer.param_count) == (1.0, 1)
    assert answer.param_id in (PARAMETER, PARAMETER.encode())
    (refused,) = operator.receive(ParameterSet(GCS, OURS, PARAMETER, 7.0))
    assert operator.role is Role.ADVISE
    assert refused.param_value == 1.0
    assert operator.receive(ParameterSet(GCS, OURS, "OTHER", 1.0)) == []


@pytest.mark.parametrize(
    ("request_", "answered"),
    [
        (ParameterRequest(GCS, OURS, None, None), True),
        (ParameterRequest(GCS, ALL, None, None), True),
        (ParameterRequest(GCS, OURS, PARAMETER, None), True),
        (ParameterRequest(GCS, OURS, None, 0), True),
        (ParameterRequest(GCS, OURS, None, 1), False),
        (ParameterRequest(GCS, OURS, "OTHER", None), False),
        (ParameterRequest(GCS, ALL, None, 0), False),
        (ParameterRequest(GCS, AUTOPILOT, None, None), False),
    ],
)
def test_reading(operator: Operator, request_: Fact, answered: bool) -> None:
    assert len(operator.receive(request_)) == answered


def test_who_only_looks_is_not_made_to_fly(operator: Operator) -> None:
    operator.role = operator.at_most = Role.ADVISE
    (answer,) = operator.receive(command(2.0))
    assert answer.result == mavlink.MAV_RESULT_DENIED
    operator.receive(ParameterSet(GCS, OURS, PARAMETER, 2.0))
    assert operator.role is Role.ADVISE
