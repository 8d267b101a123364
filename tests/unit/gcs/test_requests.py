"""Requests of the operator: settings as parameters; the role and resuming the mission by command."""

from dataclasses import replace

import pytest

from companion.engine import EngineConfig
from companion.gcs.parameters import GCS_PARAMETERS
from companion.gcs.requests import ROLE, GcsRequests
from companion.gcs.settings import Settings
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandRequest, Fact, ParameterRequest, ParameterSet, Sender
from companion.model import Role

OURS, AUTOPILOT, ALL, GCS = Sender(1, 196), Sender(1, 1), Sender(1, 0), Sender(255, 190)
SET_MODE = mavlink.MAV_CMD_DO_SET_MODE


@pytest.fixture
def operator() -> GcsRequests:
    return GcsRequests(Settings(EngineConfig()), lambda: OURS)


def command(role: float | None, *, target: Sender = OURS, base: float | None = 1.0) -> CommandRequest:
    return CommandRequest(GCS, target, SET_MODE, (base, role, 0.0, 0.0))


@pytest.mark.parametrize("role", list(Role))
def test_the_role_command_is_obeyed_and_acknowledged_to_its_sender(operator: GcsRequests, role: Role) -> None:
    (answer,) = operator.receive(command(float(role)))
    assert operator.role is role
    assert (answer.command, answer.result) == (SET_MODE, mavlink.MAV_RESULT_ACCEPTED)
    assert (answer.target_system, answer.target_component) == (255, 190)


@pytest.mark.parametrize(
    "request_", [command(3.0), command(0.5), command(None), command(1.0, base=0.0), command(1.0, base=None)]
)
def test_a_command_without_a_valid_role_is_denied(operator: GcsRequests, request_: CommandRequest) -> None:
    (answer,) = operator.receive(request_)
    assert answer.result == mavlink.MAV_RESULT_DENIED
    assert operator.role is Role.FLY


def test_a_copy_of_a_command_changes_nothing_and_is_answered_as_before(operator: GcsRequests) -> None:
    """A script that counts its frames from 0 whenever it is run waits for an answer each time."""
    for role in (3.0, 1.0):
        (before,) = operator.receive(command(role))
        (answer,) = operator.receive(replace(command(role), is_copy=True))
        assert (answer.command, answer.result) == (SET_MODE, before.result)
        assert (answer.target_system, answer.target_component) == (255, 190)
    operator.receive(command(2.0))
    (answer,) = operator.receive(replace(command(1.0), is_copy=True))
    assert answer.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "it is not in force any more"
    assert operator.role is Role.FLY
    assert operator.receive(replace(command(0.0), is_copy=True)) == [], "never received"


def test_other_commands_are_unsupported(operator: GcsRequests) -> None:
    (answer,) = operator.receive(CommandRequest(GCS, OURS, 400, (1.0, 0.0, 0.0, 0.0)))
    assert (answer.command, answer.result) == (400, mavlink.MAV_RESULT_UNSUPPORTED)


@pytest.mark.parametrize("target", [AUTOPILOT, ALL, Sender(0, 0), Sender(2, 196)])
def test_a_mode_meant_for_the_autopilot_or_for_all_is_not_our_role(
    operator: GcsRequests, target: Sender
) -> None:
    assert operator.receive(command(0.0, target=target)) == []
    assert operator.receive(ParameterSet(GCS, target, ROLE, 0.0)) == []
    assert operator.role is Role.FLY


def test_the_parameter_is_set_and_every_set_is_answered(operator: GcsRequests) -> None:
    (answer,) = operator.receive(ParameterSet(GCS, OURS, ROLE, 1.0))
    assert operator.role is Role.ADVISE
    assert (answer.param_value, answer.param_count) == (1.0, len(GCS_PARAMETERS))
    assert answer.param_id in (ROLE, ROLE.encode())
    (refused,) = operator.receive(ParameterSet(GCS, OURS, ROLE, 7.0))
    assert operator.role is Role.ADVISE
    assert refused.param_value == 1.0
    assert operator.receive(ParameterSet(GCS, OURS, "OTHER", 1.0)) == []


def name_of(message: Message) -> str:
    name = message.param_id
    return name if isinstance(name, str) else name.decode()


@pytest.mark.parametrize(
    ("request_", "answered"),
    [
        (ParameterRequest(GCS, OURS, ROLE, None), True),
        (ParameterRequest(GCS, OURS, None, 0), True),
        (ParameterRequest(GCS, OURS, None, len(GCS_PARAMETERS) - 1), True),
        (ParameterRequest(GCS, OURS, None, len(GCS_PARAMETERS)), False),
        (ParameterRequest(GCS, OURS, "OTHER", None), False),
        (ParameterRequest(GCS, ALL, None, 0), False),
        (ParameterRequest(GCS, ALL, ROLE, None), False),
        (ParameterRequest(GCS, Sender(2, 196), ROLE, None), False),
    ],
)
def test_only_a_read_addressed_to_us_is_answered(
    operator: GcsRequests, request_: Fact, answered: bool
) -> None:
    assert len(operator.receive(request_)) == answered
    assert operator.listed(0.0) == []


@pytest.mark.parametrize("target", [OURS, ALL, Sender(0, 0), Sender(0, 196)])
def test_the_list_is_complete_in_order_and_spread_over_ticks(operator: GcsRequests, target: Sender) -> None:
    assert operator.receive(ParameterRequest(GCS, target, None, None)) == []
    ticks = []
    for tick in range(10):
        ticks.append(operator.listed(tick / 10))
        assert operator.listed(tick / 10 + 0.03) == [], "not in an extra tick in between"
    assert max(map(len, ticks)) == 10
    listed = [message for messages in ticks for message in messages]
    assert [(name_of(m), m.param_index) for m in listed] == [
        (t.name, i) for i, t in enumerate(GCS_PARAMETERS)
    ]
    assert {message.param_count for message in listed} == {len(GCS_PARAMETERS)}
    assert {message.param_type for message in listed} == {mavlink.MAV_PARAM_TYPE_REAL32}


def test_a_list_is_finished_before_it_begins_again(operator: GcsRequests) -> None:
    everything = ParameterRequest(GCS, OURS, None, None)
    operator.receive(everything)
    listed = [m.param_index for m in operator.listed(0.0)]
    operator.receive(everything)
    listed += [m.param_index for tick in range(1, 30) for m in operator.listed(tick / 10)]
    assert listed == 2 * list(range(len(GCS_PARAMETERS)))


def test_stations_that_ask_for_the_list_all_the_time_get_its_end(operator: GcsRequests) -> None:
    listed = []
    for tick in range(30):
        if tick % 3 == 0:
            operator.receive(ParameterRequest(GCS, OURS, None, None))
            operator.receive(ParameterRequest(Sender(254, 190), ALL, None, None))
        listed += [m.param_index for m in operator.listed(tick / 10)]
    count = len(GCS_PARAMETERS)
    assert listed == [at % count for at in range(len(listed))]
    assert len(listed) > 2 * count


@pytest.mark.parametrize("target", [AUTOPILOT, Sender(2, 0), Sender(1, 197)])
def test_a_list_request_to_another_address_is_ignored(operator: GcsRequests, target: Sender) -> None:
    operator.receive(ParameterRequest(GCS, target, None, None))
    assert operator.listed(0.0) == []


@pytest.mark.parametrize("value", [9.9, 80.1, None, -1.0, 3.4e38, 15.0])
def test_a_refused_value_is_answered_with_the_old_one_and_a_reason(
    operator: GcsRequests, value: float | None
) -> None:
    operator.settings.put(GCS_PARAMETERS[0], 2.0)
    (answer,) = operator.receive(ParameterSet(GCS, OURS, "CA_OUTER_TIME", value))
    assert (name_of(answer), answer.param_value) == ("CA_OUTER_TIME", 60.0)
    (words,) = operator.refusals
    assert words.startswith("CA_OUTER_TIME ")
    assert " refused: " in words
    assert operator.settings.changed == {}


def test_an_accepted_value_is_answered_with_the_new_one(operator: GcsRequests) -> None:
    for _ in range(2):
        (answer,) = operator.receive(ParameterSet(GCS, OURS, "CA_OUTER_TIME", 45.0))
        assert answer.param_value == 45.0
    assert operator.settings.avoidance.outer_time_s == 45.0
    assert operator.refusals == []
    assert operator.changes == ["CA_OUTER_TIME 45 s, was 60"]


def test_a_role_set_as_a_parameter_is_saved_and_a_commanded_role_is_not(operator: GcsRequests) -> None:
    operator.receive(command(1.0))
    assert operator.settings.changed == {}
    (answer,) = operator.receive(ParameterRequest(GCS, OURS, ROLE, None))
    assert answer.param_value == 1.0
    operator.receive(ParameterSet(GCS, OURS, ROLE, 0.0))
    assert operator.role is Role.OFF
    assert operator.settings.changed == {"CA_ROLE": 0.0}


def resume(continues: float | None = 1.0) -> CommandRequest:
    return CommandRequest(GCS, OURS, mavlink.MAV_CMD_DO_PAUSE_CONTINUE, (continues, 0.0, None, None))


@pytest.mark.parametrize("continues", [0.0, 2.0, None])
def test_a_pause_is_denied(operator: GcsRequests, continues: float | None) -> None:
    operator._may_resume = lambda: True
    (answer,) = operator.receive(resume(continues))
    assert answer.result == mavlink.MAV_RESULT_DENIED
    assert not operator.take_resume()


def test_resuming_the_mission_is_accepted_only_while_we_fly(operator: GcsRequests) -> None:
    (answer,) = operator.receive(resume())
    assert answer.result == mavlink.MAV_RESULT_DENIED
    assert not operator.take_resume()
    operator._may_resume = lambda: True
    for _ in range(2):
        (answer,) = operator.receive(resume())
        assert (answer.command, answer.result) == (193, mavlink.MAV_RESULT_ACCEPTED)
        assert (answer.target_system, answer.target_component) == (255, 190)
    assert operator.take_resume()
    assert not operator.take_resume()


def test_a_role_above_the_highest_allowed_is_refused(operator: GcsRequests) -> None:
    operator.role = operator.at_most = Role.ADVISE
    (answer,) = operator.receive(command(2.0))
    assert answer.result == mavlink.MAV_RESULT_DENIED
    operator.receive(ParameterSet(GCS, OURS, ROLE, 2.0))
    assert operator.role is Role.ADVISE
