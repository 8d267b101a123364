"""The radio between the members of a formation: each datagram reaches each other member late, or never."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush

import numpy as np

# The shortest delay, as a share of the longest: datagrams overtake each other.
_SHORTEST_DELAY = 0.5


@dataclass(frozen=True, slots=True)
class RadioQuality:
    """The probability that a datagram is lost between two members, and its longest delay [s]."""

    loss: float = 0.0
    delay_s: float = 0.0

    @property
    def label(self) -> str:
        """In words, as in reports."""
        return f"{100.0 * self.loss:.3g} % lost, {self.delay_s:g} s"


@dataclass
class Radio:
    """The datagrams under way, for each receiver; the same seed draws the same losses and delays.

    Each pair of sender and receiver has its own random numbers: what one member sends does not change the
    losses of another.
    """

    members: int
    quality: RadioQuality
    seed: int = 0
    _waiting: list[list[tuple[float, int, bytes]]] = field(init=False)
    _random: dict[tuple[int, int], np.random.Generator] = field(init=False, default_factory=dict)
    _sent: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self._waiting = [[] for _ in range(self.members)]

    def send(self, sender: int, raw: bytes, now_s: float) -> None:
        """Send a datagram to all other members."""
        self._sent += 1
        for receiver in range(self.members):
            if receiver != sender and not math.isinf(arrives_s := self._arrival_s(sender, receiver, now_s)):
                heappush(self._waiting[receiver], (arrives_s, self._sent, raw))

    def arrived(self, receiver: int, now_s: float) -> Sequence[tuple[float, bytes]]:
        """The time of arrival and the content of the datagrams that arrived since the last call, in order."""
        waiting, arrived = self._waiting[receiver], []
        while waiting and waiting[0][0] <= now_s:
            arrives_s, _, raw = heappop(waiting)
            arrived.append((arrives_s, raw))
        return arrived

    def _arrival_s(self, sender: int, receiver: int, now_s: float) -> float:
        """When a datagram arrives; infinite if it is lost."""
        key = sender, receiver
        if key not in self._random:
            self._random[key] = np.random.default_rng([self.seed, *key])
        chance, share = self._random[key].random(2)
        if chance < self.quality.loss:
            return math.inf
        return now_s + self.quality.delay_s * (_SHORTEST_DELAY + (1.0 - _SHORTEST_DELAY) * float(share))
