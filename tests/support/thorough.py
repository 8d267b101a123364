"""The two sizes of the test suite: `make test` flies a sample of what `make thorough` flies in full."""

import os

# Set by `make thorough`.
THOROUGH = bool(os.environ.get("THOROUGH"))


def sample(usual: int, thorough: int) -> int:
    """How many of a kind are tried: the first number in `make test`, the second in `make thorough`."""
    return thorough if THOROUGH else usual
