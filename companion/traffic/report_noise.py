"""The noise of reports: as stated, as usual, and as it turns out to be."""

import math
from typing import Final

# The noise is estimated from the innovations, averaged over about this many reports (Mehra, "Approaches to
# adaptive filtering", IEEE Transactions on Automatic Control 17, 1972), and limited to these multiples of its
# sigma: senders state it rarely, as a class, or too well. Only the change from one innovation to the next is
# noise: what persists is a turn, or a velocity that the positions contradict, and must be followed.
_AVERAGED_REPORTS: Final = 20
_FIRST_AVERAGED: Final = 3
_MIN_SCALE2, _MAX_SCALE2 = 0.25**2, 4.0**2
# A larger squared innovation, in units of its variance, is not noise: a turn began, or the report is wrong.
_MAX_INNOVATION2: Final = 10.0


class NoiseScale:
    """Standard deviation of the reports of one sender, relative to what it states or to the usual one."""

    __slots__ = ("_averaged", "_east", "_north", "_scale2", "scale")

    def __init__(self) -> None:
        self.scale = self._scale2 = 1.0
        self._averaged = _FIRST_AVERAGED
        self._north = self._east = 0.0

    def observe(self, north: float, east: float, variance: float, noise: float) -> None:
        """Process an innovation with its variance on each axis, of which `noise` is that of the report.

        The rest is the uncertainty of the prediction: where it dominates, small innovations say little.
        """
        north_change, east_change = north - self._north, east - self._east
        self._north, self._east = north, east
        # Each axis of a change has twice the variance of an innovation.
        excess = 0.25 * (north_change * north_change + east_change * east_change) / variance - 1.0
        if excess < 0.0:
            scale2 = self._scale2 * (1.0 + excess * noise / (variance * self._averaged))
            self._scale2 = scale2 if scale2 > _MIN_SCALE2 else _MIN_SCALE2
        else:
            if excess > _MAX_INNOVATION2:
                excess = _MAX_INNOVATION2
            scale2 = self._scale2 * (1.0 + excess / self._averaged)
            self._scale2 = scale2 if scale2 < _MAX_SCALE2 else _MAX_SCALE2
        self.scale = math.sqrt(self._scale2)
        if self._averaged < _AVERAGED_REPORTS:
            self._averaged += 1
