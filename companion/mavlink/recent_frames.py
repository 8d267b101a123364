"""The frames of the last seconds, by which a later copy is recognized."""

from collections.abc import Hashable
from typing import Generic, TypeVar

# Frames are remembered for this long: no echo and no copy is later.
_REMEMBERED_S = 15.0
# At most so many, against a flood: 256 sequence numbers of each of 16 senders.
_MOST = 4096

_Key = TypeVar("_Key", bound=Hashable)


class RecentFrames(Generic[_Key]):
    """One frame for each key, the newest, for 15 s; the oldest go first when there are too many."""

    def __init__(self) -> None:
        self._frames: dict[_Key, tuple[bytes, float]] = {}

    def __len__(self) -> int:
        return len(self._frames)

    def put(self, key: _Key, raw: bytes, now_s: float) -> None:
        """Remember a frame in place of the former one with this key."""
        self._frames.pop(key, None)
        self._frames[key] = raw, now_s  # the last one is the newest
        while len(self._frames) > _MOST or now_s - self._oldest_s() > _REMEMBERED_S:
            del self._frames[next(iter(self._frames))]

    def holds(self, key: _Key, raw: bytes, now_s: float) -> bool:
        """Whether the newest frame with this key has these bytes."""
        found, at_s = self._frames.get(key, (b"", now_s))
        return found == raw and now_s - at_s <= _REMEMBERED_S

    def _oldest_s(self) -> float:
        _, at_s = next(iter(self._frames.values()))
        return at_s
