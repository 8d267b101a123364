"""Errors of a task group reach the user as one line."""

import pytest

from companion.errors import CompanionError, ConfigError, LinkError, ungrouped


def test_the_first_error_of_a_group_is_raised_in_its_place() -> None:
    inner = ExceptionGroup("tasks", [LinkError("first"), ConfigError("second")])
    with pytest.raises(LinkError, match=r"^first$"), ungrouped():
        raise ExceptionGroup("outer", [inner])


def test_a_group_with_a_bug_in_it_stays_a_group_with_its_traceback() -> None:
    group = ExceptionGroup("tasks", [LinkError("first"), ValueError("bug")])
    with pytest.raises(ExceptionGroup) as raised, ungrouped():
        raise group
    assert raised.value is group


def test_a_single_error_is_raised_unchanged() -> None:
    with pytest.raises(CompanionError, match=r"^one$"), ungrouped():
        raise CompanionError("one")
    with ungrouped():
        pass
