"""The errors that a user can cause. Each is shown as one line; any other is a bug and keeps its traceback."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

# What to do about EADDRINUSE.
PORT_IN_USE = "Address already in use: end the other program (ss -lntup lists them), or choose another port"


class CompanionError(Exception):
    """A failure that its one-line message explains."""


class ConfigError(CompanionError):
    """The configuration cannot be used; the message has file, line, key and what is allowed."""


class LinkError(CompanionError):
    """A link address cannot be understood, or cannot be opened."""


class LinkDownError(LinkError):
    """A link does not work now, but may work later."""


class LogError(CompanionError):
    """A log cannot be read or written."""


def require(package: str, command: str, extra: str) -> None:
    """Raise `ConfigError` that says what to install if the optional `package` of a command is missing."""
    if find_spec(package) is None:
        raise ConfigError(f"{command} needs {package}: pip install 'mavlink-companion[{extra}]'")


@contextmanager
def ungrouped() -> Iterator[None]:
    """Raise the first `CompanionError` of an `ExceptionGroup` in its place, if it holds no other errors.

    `except*` cannot do this: before 3.11.4 Python wraps an error raised there in a group again.
    """
    try:
        yield
    except ExceptionGroup as group:
        error: BaseException = group
        if group.split(CompanionError)[1] is None:
            while isinstance(error, ExceptionGroup):
                error = error.exceptions[0]
        raise error from None
