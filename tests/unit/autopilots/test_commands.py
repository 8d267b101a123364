"""Commands under way: sent again until answered."""

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


def sent_until(desk: CommandRetrier, until_s: float, from_s: float = 0.0) -> list[tuple[float, int]]:
    sent = []
    for tenth in range(round(from_s * 10) + 1, round(until_s * 10) + 1):
        sent += [(tenth / 10, message.confirmation) for message in desk.due(tenth / 10)]
    return sent


def test_repeated_with_rising_confirmation_until_it_gives_up() -> None:
    desk = CommandRetrier()
    desk.ask(command(), 0.0)
    assert desk.outcome(SET_MODE) is Outcome.PENDING
    assert sent_until(desk, 10.0) == [(0.5, 1), (1.0, 2), (1.5, 3), (2.0, 4), (2.5, 5)]
    assert desk.outcome(SET_MODE) is Outcome.UNANSWERED


def test_one_that_is_renewed_all_the_time_is_found_unanswered_too() -> None:
    desk = CommandRetrier()
    told: list[str] = []
    for second in range(6):
        desk.ask(command(), float(second))
        sent_until(desk, second + 0.9, float(second))
        told += desk.refusals()
    assert told[0] == "DO_SET_MODE not answered"
    desk.ask(command(), 7.0)
    desk.answered(answer(mavlink.MAV_RESULT_ACCEPTED), 7.1)
    desk.ask(command(), 8.0)
    assert sent_until(desk, 11.0, 8.0) == [(8.5, 1), (9.0, 2), (9.5, 3), (10.0, 4), (10.5, 5)]


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
def test_an_answer_ends_it(result: int, outcome: Outcome, words: list[str]) -> None:
    desk = CommandRetrier()
    desk.ask(command(), 0.0)
    desk.answered(answer(result), 0.1)
    assert desk.outcome(SET_MODE) is outcome
    assert desk.refusals() == words
    assert desk.refusals() == [], "told once"
    assert sent_until(desk, 5.0) == []


def test_in_progress_extends_the_wait() -> None:
    desk = CommandRetrier()
    desk.ask(command(), 0.0)
    desk.answered(answer(mavlink.MAV_RESULT_IN_PROGRESS), 0.1)
    assert sent_until(desk, 5.0) == []
    assert sent_until(desk, 5.2, 5.0) == [(5.1, 1)]


def test_temporarily_rejected_is_asked_again() -> None:
    desk = CommandRetrier()
    desk.ask(command(), 0.0)
    desk.answered(answer(mavlink.MAV_RESULT_TEMPORARILY_REJECTED), 0.1)
    assert sent_until(desk, 0.6) == [(0.5, 1)]


def test_a_newer_command_of_the_kind_replaces_the_older() -> None:
    desk = CommandRetrier()
    desk.ask(command(), 0.0)
    newer = desk.ask(command(), 0.3)
    assert desk.due(0.6) == []
    assert desk.due(0.8) == [newer]


def test_what_is_forgotten_is_never_sent() -> None:
    desk = CommandRetrier()
    desk.ask(command(), 0.0)
    desk.forget()
    assert sent_until(desk, 5.0) == []
    assert desk.outcome(SET_MODE) is None


def test_answers_to_nothing_are_ignored() -> None:
    desk = CommandRetrier()
    desk.answered(answer(mavlink.MAV_RESULT_DENIED), 0.0)
    assert desk.outcome(SET_MODE) is None
    assert desk.refusals() == []
