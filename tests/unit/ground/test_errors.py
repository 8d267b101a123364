"""Of what a group of tasks raises, the user sees one line."""

import pytest

from companion.errors import CompanionError, ConfigError, LinkError, alone


def test_the_first_of_a_group_of_our_errors_is_raised_alone() -> None:
    inner = ExceptionGroup("tasks", [LinkError("first"), ConfigError("second")])
    with pytest.raises(LinkError, match=r"^first$"), alone():
        raise ExceptionGroup("outer", [inner])


def test_a_bug_among_them_keeps_the_group_and_its_traceback() -> None:
    group = ExceptionGroup("tasks", [LinkError("first"), ValueError("bug")])
    with pytest.raises(ExceptionGroup) as raised, alone():
        raise group
    assert raised.value is group


def test_what_is_no_group_is_as_it_was() -> None:
    with pytest.raises(CompanionError, match=r"^one$"), alone():
        raise CompanionError("one")
    with alone():
        pass
