"""What is remembered of each aircraft that a receiver hears, in a bounded table."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Final, Generic, TypeVar

State = TypeVar("State")
Key = TypeVar("Key", bound=Hashable)

# After this silence an aircraft starts again: its address may belong to another flight.
FORGET_S: Final = 120.0
_CAPACITY: Final = 2048
_ESTABLISHED_AFTER: Final = 4


class _Entry(Generic[State]):
    __slots__ = ("heard_s", "state", "times")

    def __init__(self, state: State) -> None:
        self.state = state
        self.heard_s = 0.0
        self.times = 0


class AircraftTable(Generic[Key, State]):
    """The states of aircraft by their keys, twice `capacity` at most.

    A segmented least-recently-used cache (Karedla, Love and Wherry 1994): an aircraft heard several times is
    moved from the newcomers to the established ones, and each segment evicts only its own. A flood of
    invented addresses evicts newcomers, not aircraft that are heard again and again.
    """

    def __init__(self, make: Callable[[], State], capacity: int = _CAPACITY) -> None:
        self._make = make
        self._capacity = capacity
        self._newcomers: OrderedDict[Key, _Entry[State]] = OrderedDict()
        self._established: OrderedDict[Key, _Entry[State]] = OrderedDict()

    def __len__(self) -> int:
        return len(self._newcomers) + len(self._established)

    def heard(self, key: Key, now_s: float) -> State:
        """The state of an aircraft heard now; a new one if it was unknown or silent for long."""
        entry = self._established.pop(key, None) or self._newcomers.pop(key, None)
        if entry is None or now_s - entry.heard_s > FORGET_S:
            entry = _Entry(self._make())
        entry.heard_s = now_s
        entry.times += 1
        segment = self._established if entry.times >= _ESTABLISHED_AFTER else self._newcomers
        segment[key] = entry
        if len(segment) > self._capacity:
            segment.popitem(last=False)
        return entry.state

    def known(self, key: Key, now_s: float) -> State | None:
        """The state of an aircraft heard before; `None` if it is unknown or was silent for long."""
        entry = self._established.get(key) or self._newcomers.get(key)
        return None if entry is None or now_s - entry.heard_s > FORGET_S else entry.state
