"""The errors a user can cause. Each is shown as one line; anything else is a bug and keeps its traceback."""


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
