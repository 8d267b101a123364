"""The errors a user can cause. Each is shown as one line; anything else is a bug and keeps its traceback."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec


class CompanionError(Exception):
    """Something failed in a way that its one-line message explains."""


class ConfigError(CompanionError):
    """The configuration cannot be used: says file, line, key and what is allowed."""


class LinkError(CompanionError):
    """A link address cannot be understood, or cannot be opened."""


class LinkDownError(LinkError):
    """A link does not work now; there is hope that it will later."""


class LogError(CompanionError):
    """A log cannot be read or written."""


def require(package: str, command: str, extra: str) -> None:
    """Raise `ConfigError` that says what to install if the optional `package` of a command is missing."""
    if find_spec(package) is None:
        raise ConfigError(f"{command} needs {package}: pip install 'mavlink-companion[{extra}]'")


@contextmanager
def alone() -> Iterator[None]:
    """Raise the first `CompanionError` of a group of tasks in place of the group, if all it holds are such.

    By `except*` it would be in a group again: Python before 3.11.4 wraps what is raised there.
    """
    try:
        yield
    except ExceptionGroup as group:
        error: BaseException = group
        if group.split(CompanionError)[1] is None:
            while isinstance(error, ExceptionGroup):
                error = error.exceptions[0]
        raise error from None
