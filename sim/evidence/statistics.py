"""Statistics of errors: root mean squares, percentiles, and chi-square intervals."""

import math
from collections.abc import Sequence

import numpy as np


def rms(values: Sequence[float]) -> float:
    """Root of the mean square; NaN without values."""
    return float(np.sqrt(np.mean(np.square(values)))) if values else math.nan


def percentile(values: Sequence[float], share: float) -> float:
    """The value that this share of the absolute values does not exceed; NaN without values."""
    return float(np.percentile(np.abs(values), 100.0 * share, method="lower")) if values else math.nan


def chi2_interval(freedom: int, runs: int) -> tuple[float, float]:
    """95 % interval of the mean of `runs` independent chi-square numbers, divided by their `freedom`.

    Bar-Shalom, Li and Kirubarajan (2001), 5.4.2; quantiles after Wilson and Hilferty (1931).
    """
    n = 2.0 / (9.0 * freedom * runs)
    low, high = ((1.0 - n + z * math.sqrt(n)) ** 3 for z in (-1.96, 1.96))
    return low, high
