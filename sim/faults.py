"""A one-way line with faults: items are delayed, duplicated, reordered or lost."""

import random
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Generic, TypeVar

# Items in flight at once; a real line has a limit too.
MAX_IN_FLIGHT = 10_000

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Faults:
    """The faults of a line: probabilities of loss and duplication of an item, and its delay.

    A random share of `jitter_s` is added to each delay, so items overtake each other. With `copy_after_s` a
    second, slower path delivers every item again, that much later. `ValueError` for an impossible probability
    or time.
    """

    loss: float = 0.0
    duplication: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    copy_after_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("loss", "duplication"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} {getattr(self, name)} is not a probability")
        for name in ("delay_s", "jitter_s", "copy_after_s"):
            if not 0.0 <= getattr(self, name) <= 3600.0:
                raise ValueError(f"{name} {getattr(self, name)} is not within an hour")


@dataclass(slots=True)
class LineCounters:
    """Items in (`sent`) and out (`delivered`); `cut` were in flight or sent while the line was cut."""

    sent: int = 0
    delivered: int = 0
    lost: int = 0
    duplicated: int = 0
    overtaken: int = 0
    cut: int = 0
    flooded: int = 0


class FaultyLine(Generic[Item]):
    """A line for items. The same seed and times give the same faults; `faults` may change at any time."""

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
        """Time at which the next item comes out; `None` without items in flight."""
        return self._in_flight[0][0] if self._in_flight else None

    def cut(self) -> None:
        """Lose all items, those in flight included, until `mend`."""
        self.is_cut = True
        self.counters.cut += len(self._in_flight)
        self._in_flight.clear()

    def mend(self) -> None:
        """End a cut."""
        self.is_cut = False

    def put(self, item: Item, now_s: float) -> None:
        """Send an item."""
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
            if self.faults.copy_after_s > 0.0:
                self.counters.duplicated += 1
                self._launch(item, now_s + self.faults.copy_after_s)

    def take(self, now_s: float) -> list[Item]:
        """The items that came out by `now_s`, in order of arrival."""
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
