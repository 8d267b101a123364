"""How long the ticks took, counted as a histogram."""

from bisect import bisect_left
from typing import ClassVar


class LoopTimes:
    """`below[i]` ticks took no longer than `BOUNDS_S[i]`; the last of them counts all."""

    BOUNDS_S: ClassVar[tuple[float, ...]] = (
        0.0005, 0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5,
    )  # fmt: skip

    def __init__(self) -> None:
        self.last_s = 0.0
        self.total_s = 0.0
        self._in = [0] * (len(self.BOUNDS_S) + 1)

    def observe(self, seconds: float) -> None:
        """A tick took so long."""
        self.last_s = seconds
        self.total_s += seconds
        self._in[bisect_left(self.BOUNDS_S, seconds)] += 1

    @property
    def below(self) -> tuple[int, ...]:
        """Cumulative counts, one more than there are bounds."""
        counts, total = [], 0
        for count in self._in:
            total += count
            counts.append(total)
        return tuple(counts)
