"""Where the page's states come from: the interface, and a live flight."""

import asyncio
import json
import time
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Mapping
from typing import Any

from companion.web.live_snapshot import LiveSnapshot
from companion.web.rolling_stats import RollingStats
from companion.web.state import state_of

_STALE_S = 2.0


class Source(ABC):
    """States as JSON text, for any number of viewers."""

    kind: str
    duration_s: float | None = None

    @abstractmethod
    def newest(self) -> str | None:
        """The newest state; `None` when there is none yet."""

    @abstractmethod
    def view(self) -> "View":
        """A new viewer's view of the states."""

    def layers(self) -> list[tuple[float, str, str]]:
        """Changes of layer or manoeuvre (time since the start [s], layer, words), if known in advance."""
        return []


class View(ABC):
    """The states of one viewer. A slow viewer misses states and delays no other."""

    @abstractmethod
    def states(self) -> AsyncIterator[str]:
        """One state after the other, without end."""

    def control(self, message: Mapping[str, Any]) -> None:  # noqa: B027 - a live flight has no such controls
        """Handle a message of the viewer: play, speed, seek."""


class LiveSource(Source):
    """A live flight."""

    kind = "live"

    def __init__(self) -> None:
        self.snapshot: LiveSnapshot | None = None
        self.sequence = 0
        self.changed = asyncio.Event()
        self._stats = RollingStats()
        self._text: str | None = None
        self._arrived_s = -_STALE_S

    def show(self, snapshot: LiveSnapshot) -> None:
        """Take the newest snapshot."""
        self._stats.add(snapshot.health)
        self.sequence += 1
        self.snapshot, self._text = snapshot, None
        self._arrived_s = time.monotonic()
        self.changed.set()
        self.changed = asyncio.Event()

    @property
    def is_fresh(self) -> bool:
        """True while snapshots arrive."""
        return self.snapshot is not None and time.monotonic() - self._arrived_s < _STALE_S

    def newest(self) -> str | None:
        """The newest state; computed once for all viewers."""
        if self._text is None and self.snapshot is not None:
            state = state_of(self.snapshot, self.sequence, self._stats)
            self._text = json.dumps(state, separators=(",", ":"), allow_nan=False)
        return self._text

    def view(self) -> "LiveView":
        """All viewers see the same states."""
        return LiveView(self)


class LiveView(View):
    """The newest state whenever the viewer is ready for one."""

    def __init__(self, source: LiveSource) -> None:
        self._source = source
        self._seen = 0

    async def states(self) -> AsyncIterator[str]:
        """The newest states; those in between are left out."""
        while True:
            while self._source.sequence == self._seen:
                await self._source.changed.wait()
            self._seen = self._source.sequence
            text = self._source.newest()
            if text is not None:
                yield text
