"""Types of `pairs.py`, whose own annotations are C types."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

def pair_distances(
    one_m: _Array, other_m: _Array, times_s: _Array, reach_m: float
) -> tuple[_Array, _Array]: ...
def improve(
    alone_: _Array, value_: _Array, least_: _Array, separation_m: float, rows: Sequence[int], rounds: int
) -> list[int]: ...
