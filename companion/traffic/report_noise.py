"""The noise of reports: as stated, as usual, and as it turns out to be."""

import math
from typing import Final

# The noise is estimated from the innovations, averaged over about this many reports (Mehra, "Approaches to
# adaptive filtering", IEEE Transactions on Automatic Control 17, 1972), and limited to these multiples of its
# sigma: senders state it rarely, as a class, or too well.
_AVERAGED_REPORTS: Final = 20
_FIRST_AVERAGED: Final = 3
_MIN_SCALE2, _MAX_SCALE2 = 0.25**2, 4.0**2
# A larger squared innovation, in units of its variance, is not noise: a turn began, or the report is wrong.
_MAX_INNOVATION2: Final = 10.0


class NoiseScale:
    """Standard deviation of the reports of one sender, relative to what it states or to the usual one."""

    __slots__ = ("_averaged", "_scale2", "scale")

    def __init__(self) -> None:
        self.scale = self._scale2 = 1.0
        self._averaged = _FIRST_AVERAGED

    def observe(self, innovation2: float, noise_share: float) -> None:
        """Process an innovation: its square in units of its variance, the mean of its axes.

        The noise has a share of the variance, the rest is the uncertainty of the prediction: where that
        dominates, a small innovation says little of the noise.
        """
        if innovation2 < 1.0:
            scale2 = self._scale2 * (1.0 + noise_share * (innovation2 - 1.0) / self._averaged)
            self._scale2 = scale2 if scale2 > _MIN_SCALE2 else _MIN_SCALE2
        else:
            if innovation2 > _MAX_INNOVATION2:
                innovation2 = _MAX_INNOVATION2
            scale2 = self._scale2 * (1.0 + (innovation2 - 1.0) / self._averaged)
            self._scale2 = scale2 if scale2 < _MAX_SCALE2 else _MAX_SCALE2
        self.scale = math.sqrt(self._scale2)
        if self._averaged < _AVERAGED_REPORTS:
            self._averaged += 1
