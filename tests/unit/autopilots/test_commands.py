"""Commands under way: repeated until they are answered."""

import pytest

from companion.autopilots.commands import CommandRetrier, Outcome
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import CommandResult, Sender

AUTOPILOT = Sender(1, 1)
SET_MODE = mavlink.MAV_CMD_DO_SET_MODE


def command(number: int = SET_MODE) -> object:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, 1, 15, 0, 0, 0, 0, 0)


def answer(result: int, number: int = SET_MODE) -> CommandResult:
    return CommandResult(AUTOPILOT, number, result, None)


def sent_until(commands: CommandRetrier, until_s: float, from_s: float = 0.0) -> list[tuple[float, int]]:
    sent = []
    for tenth in range(round(from_s * 10) + 1, round(until_s * 10) + 1):
        sent += [(tenth / 10, message.confirmation) for message in commands.due(tenth / 10)]
    return sent


def test_a_command_is_repeated_with_rising_confirmation_and_then_given_up() -> None:
    commands = CommandRetrier()
    commands.ask(command(), 0.0)
    assert commands.outcome(SET_MODE) is Outcome.PENDING
    assert sent_until(commands, 10.0) == [(0.5, 1), (1.0, 2), (1.5, 3), (2.0, 4), (2.5, 5)]
    assert commands.outcome(SET_MODE) is Outcome.UNANSWERED


def test_a_command_that_is_renewed_often_is_found_unanswered() -> None:
    commands = CommandRetrier()
    for second in range(6):
        commands.ask(command(), float(second))
        sent_until(commands, second + 0.9, float(second))
    assert commands.refusals[0] == "DO_SET_MODE not answered"
    commands.ask(command(), 7.0)
    commands.answered(answer(mavlink.MAV_RESULT_ACCEPTED), 7.1)
    commands.ask(command(), 8.0)
    assert sent_until(commands, 11.0, 8.0) == [(8.5, 1), (9.0, 2), (9.5, 3), (10.0, 4), (10.5, 5)]


@pytest.mark.parametrize(
    ("result", "outcome", "words"),
    [
        (mavlink.MAV_RESULT_ACCEPTED, Outcome.ACCEPTED, []),
        (mavlink.MAV_RESULT_DENIED, Outcome.REFUSED, ["DO_SET_MODE denied: bad value"]),
        (mavlink.MAV_RESULT_UNSUPPORTED, Outcome.REFUSED, ["DO_SET_MODE unsupported"]),
        (mavlink.MAV_RESULT_FAILED, Outcome.REFUSED, ["DO_SET_MODE failed"]),
        (6, Outcome.REFUSED, ["DO_SET_MODE cancelled"]),
    ],
)
def test_an_answer_ends_a_command(result: int, outcome: Outcome, words: list[str]) -> None:
    commands = CommandRetrier()
    commands.ask(command(), 0.0)
    commands.answered(answer(result), 0.1)
    assert commands.outcome(SET_MODE) is outcome
    assert commands.refusals == words
    assert sent_until(commands, 5.0) == []


def test_in_progress_delays_the_repetition() -> None:
    commands = CommandRetrier()
    commands.ask(command(), 0.0)
    commands.answered(answer(mavlink.MAV_RESULT_IN_PROGRESS), 0.1)
    assert sent_until(commands, 5.0) == []
    assert sent_until(commands, 5.2, 5.0) == [(5.1, 1)]


def test_a_temporarily_rejected_command_is_repeated() -> None:
    commands = CommandRetrier()
    commands.ask(command(), 0.0)
    commands.answered(answer(mavlink.MAV_RESULT_TEMPORARILY_REJECTED), 0.1)
    assert sent_until(commands, 0.6) == [(0.5, 1)]


def test_a_newer_command_of_a_kind_replaces_the_older() -> None:
    commands = CommandRetrier()
    commands.ask(command(), 0.0)
    newer = commands.ask(command(), 0.3)
    assert commands.due(0.6) == []
    assert commands.due(0.8) == [newer]


def test_a_dropped_command_is_not_repeated() -> None:
    commands = CommandRetrier()
    commands.ask(command(), 0.0)
    commands.forget()
    assert sent_until(commands, 5.0) == []
    assert commands.outcome(SET_MODE) is None


def test_answers_without_a_command_are_ignored() -> None:
    commands = CommandRetrier()
    commands.answered(answer(mavlink.MAV_RESULT_DENIED), 0.0)
    assert commands.outcome(SET_MODE) is None
    assert commands.refusals == []
