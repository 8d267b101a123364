"""The times [s] at which flights and tracks are predicted."""

from bisect import bisect_left, bisect_right

import numpy as np

from companion.avoidance.geometry import Array
from companion.compiled import kernels

# Fine where a turn happens, coarse where flight is straight: at a closing speed of 90 m/s a step of 2 s
# misjudges a miss distance of 600 m by 7 m at most.
TIMES_S = np.concatenate([np.arange(0.0, 12.0, 1.0), np.arange(12.0, 60.0, 2.0), np.arange(60.0, 91.0, 3.0)])
HORIZON_S = float(TIMES_S[-1])
_TIMES_S: list[float] = TIMES_S.tolist()  # for bisection
_STEPS_S = np.diff(TIMES_S)
_MIDDLES_S = TIMES_S[:-1] + 0.5 * _STEPS_S
# The share of the whole time that each step takes.
TIME_SHARES = _STEPS_S / HORIZON_S
# The end of a turn is unknown. In the encounter models of MIT Lincoln Laboratory a turning aircraft flies on,
# in the mean, like one whose turn rate decays with this time constant.
_TURN_DECAY_S = 35.0
# Multiplied with the initial turn rate: the change of course by the middle of each step.
_TURNED_S = _TURN_DECAY_S * (1.0 - np.exp(-_MIDDLES_S / _TURN_DECAY_S))
KERNEL_TIMES = kernels.Times(TIMES_S, _TURNED_S, TIME_SHARES)


def times_until(time_s: float) -> Array:
    """The times until the first one that is not before `time_s`, at least two, (T,)."""
    return TIMES_S[: index_at(time_s) + 1]


def index_at(time_s: float) -> int:
    """Index of the first time that is not before `time_s`, at least 1."""
    return min(max(bisect_left(_TIMES_S, time_s), 1), len(_TIMES_S) - 1)


def count_until(time_s: float) -> int:
    """Number of times that are not after `time_s`, at least 2."""
    return max(bisect_right(_TIMES_S, time_s), 2)
