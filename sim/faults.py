"""A line with faults, one way: what goes in comes out late, twice, in another order, or never."""

import random
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Generic, TypeVar

# In flight at once; more is a flood that a real line would not carry either.
MAX_IN_FLIGHT = 10_000

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Faults:
    """What a line does to each item: probabilities of losing and of doubling it, and how long it takes.

    `jitter_s` is added by chance, between nothing and all of it, so that items overtake each other.
    `ValueError` for what is no probability or no time.
    """

    loss: float = 0.0
    duplication: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("loss", "duplication"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} {getattr(self, name)} is no probability")
        for name in ("delay_s", "jitter_s"):
            if not 0.0 <= getattr(self, name) <= 3600.0:
                raise ValueError(f"{name} {getattr(self, name)} is not within an hour")


@dataclass(slots=True)
class LineCounters:
    """`sent` went in, `delivered` came out; `cut` were on the way, or went in, while the line was cut."""

    sent: int = 0
    delivered: int = 0
    lost: int = 0
    duplicated: int = 0
    overtaken: int = 0
    cut: int = 0
    flooded: int = 0


class FaultyLine(Generic[Item]):
    """The same seed and the same times give the same faults. `faults` may be changed at any time."""

    def __init__(self, faults: Faults, seed: object) -> None:
        self.faults = faults
        self.is_cut = False
        self.counters = LineCounters()
        self._chance = random.Random(str(seed))
        self._in_flight: list[tuple[float, int, Item]] = []
        self._number = 0
        self._newest = 0

    @property
    def next_due_s(self) -> float | None:
        """When the next item comes out; `None` while nothing is on the way."""
        return self._in_flight[0][0] if self._in_flight else None

    def cut(self) -> None:
        """Nothing comes through, what is on the way included, until `mend`."""
        self.is_cut = True
        self.counters.cut += len(self._in_flight)
        self._in_flight.clear()

    def mend(self) -> None:
        """What goes in from now on has a chance again."""
        self.is_cut = False

    def put(self, item: Item, now_s: float) -> None:
        """An item goes in."""
        self.counters.sent += 1
        if self.is_cut:
            self.counters.cut += 1
        elif self._chance.random() < self.faults.loss:
            self.counters.lost += 1
        else:
            self._number += 1
            self._launch(item, now_s)
            if self._chance.random() < self.faults.duplication:
                self.counters.duplicated += 1
                self._launch(item, now_s)

    def take(self, now_s: float) -> list[Item]:
        """The items that have come out by now, in their order."""
        out = []
        while self._in_flight and self._in_flight[0][0] <= now_s:
            _, number, item = heappop(self._in_flight)
            if number < self._newest:
                self.counters.overtaken += 1
            self._newest = max(self._newest, number)
            out.append(item)
        self.counters.delivered += len(out)
        return out

    def _launch(self, item: Item, now_s: float) -> None:
        if len(self._in_flight) >= MAX_IN_FLIGHT:
            self.counters.flooded += 1
            return
        due_s = now_s + self.faults.delay_s + self._chance.random() * self.faults.jitter_s
        heappush(self._in_flight, (due_s, self._number, item))
