"""The two sizes of the test suite: `make test` flies a sample of what `make thorough` flies in full."""

import os
from collections.abc import Sequence
from itertools import product
from typing import TypeVar

# Set by `make thorough`.
THOROUGH = bool(os.environ.get("THOROUGH"))


_First = TypeVar("_First")
_Second = TypeVar("_Second")


def sample(usual: _First, thorough: _First) -> _First:
    """What is tried, or how many: the first in `make test`, the second in `make thorough`."""
    return thorough if THOROUGH else usual


def pairs(first: Sequence[_First], second: Sequence[_Second]) -> list[tuple[_First, _Second]]:
    """Pairs of two lists: so many that each value of both is in one of them, or all (`make thorough`)."""
    if THOROUGH:
        return list(product(first, second))
    count = max(len(first), len(second))
    return [(first[place % len(first)], second[place % len(second)]) for place in range(count)]
