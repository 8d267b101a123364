"""Where the states come from that a page shows: from a flight that goes on, or from one that was recorded."""

import asyncio
import bisect
import json
import math
import time
import zlib
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Mapping
from typing import Any

from companion.web.live_snapshot import LiveSnapshot
from companion.web.rolling_stats import RollingStats
from companion.web.state import state_of

# A state older than this is not what is going on now.
_STALE_S = 2.0
_SLOWEST, _FASTEST = 0.1, 50.0
_FRAME_S = 0.1


class Source(ABC):
    """States as JSON text, for any number of viewers."""

    kind: str
    duration_s: float | None = None

    @abstractmethod
    def newest(self) -> str | None:
        """The state to show to who asks once; `None` when there is none yet."""

    @abstractmethod
    def view(self) -> "View":
        """One viewer's own way through the states."""

    def layers(self) -> list[tuple[float, str, str]]:
        """When the layer changed [s since the start], to which, and why; where that is known beforehand."""
        return []


class View(ABC):
    """What one viewer sees. Who is slow misses states, and never delays anybody."""

    @abstractmethod
    def states(self) -> AsyncIterator[str]:
        """One state after the other, without end."""

    def ask(self, wish: Mapping[str, Any]) -> None:  # noqa: B027 - of a flight nothing can be asked for
        """What the viewer asks for: play, speed, seek."""


class Live(Source):
    """A flight that goes on."""

    kind = "live"

    def __init__(self) -> None:
        self.moment: LiveSnapshot | None = None
        self.sequence = 0
        self.changed = asyncio.Event()
        self._trends = RollingStats()
        self._text: str | None = None
        self._arrived_s = -_STALE_S

    def show(self, moment: LiveSnapshot) -> None:
        """This is the newest."""
        self._trends.show(moment.health)
        self.sequence += 1
        self.moment, self._text = moment, None
        self._arrived_s = time.monotonic()
        self.changed.set()
        self.changed = asyncio.Event()

    @property
    def silent_s(self) -> float:
        """How long ago the newest came [s]."""
        return time.monotonic() - self._arrived_s

    @property
    def is_fresh(self) -> bool:
        """Whether what is shown is what is going on."""
        return self.moment is not None and self.silent_s < _STALE_S

    def state(self) -> dict[str, Any] | None:
        """The newest state."""
        return None if self.moment is None else state_of(self.moment, self.sequence, self._trends)

    def newest(self) -> str | None:
        """The newest state; made once, for however many."""
        if self._text is None and self.moment is not None:
            self._text = json.dumps(self.state(), separators=(",", ":"), allow_nan=False)
        return self._text

    def view(self) -> "LiveView":
        """All viewers see the same."""
        return LiveView(self)


class LiveView(View):
    """The newest, whenever the viewer is ready for it."""

    def __init__(self, source: Live) -> None:
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


class Recorded(Source):
    """A flight that was, from its states and when they were [s since the start]."""

    kind = "replay"

    def __init__(self) -> None:
        self.at_s: list[float] = []
        self._states: list[bytes] = []
        self._layers: list[tuple[float, str, str]] = []

    def add(self, at_s: float, state: dict[str, Any]) -> None:
        """One more state, later than those before."""
        self.at_s.append(at_s)
        # An hour is 36,000 states: they are kept packed.
        self._states.append(zlib.compress(json.dumps(state, separators=(",", ":")).encode(), 1))
        decision = state["decision"]
        if not self._layers or self._layers[-1][1] != decision["layer"]:
            self._layers.append((at_s, decision["layer"], decision["because"]))
        self.duration_s = at_s

    def at(self, at_s: float) -> bytes:
        """The state that was the newest then, packed."""
        return self._states[max(bisect.bisect_right(self.at_s, at_s) - 1, 0)]

    def newest(self) -> str | None:
        """The last state."""
        return zlib.decompress(self._states[-1]).decode() if self._states else None

    def view(self) -> "RecordedView":
        """Each viewer plays for himself."""
        return RecordedView(self)

    def layers(self) -> list[tuple[float, str, str]]:
        """When the layer changed."""
        return self._layers


class RecordedView(View):
    """Plays, stops, and goes to wherever it is told."""

    def __init__(self, source: Recorded) -> None:
        self._source = source
        self._at_s = 0.0
        self._playing = True
        self._speed = 1.0
        self._asked = asyncio.Event()

    async def states(self) -> AsyncIterator[str]:
        """Ten a second while it plays; one after everything that is asked for."""
        while True:
            self._asked.clear()  # a wish that comes while this state is sent is seen in the next
            begun_s = time.monotonic()
            yield self._text()
            try:
                async with asyncio.timeout(_FRAME_S if self._playing else None):
                    await self._asked.wait()
            except TimeoutError:
                duration_s = self._source.duration_s or 0.0
                self._at_s = min(self._at_s + self._speed * (time.monotonic() - begun_s), duration_s)
                self._playing = self._at_s < duration_s

    def ask(self, wish: Mapping[str, Any]) -> None:
        """Play or not, how fast, from where; what makes no sense changes nothing."""
        play, speed, seek_s = wish.get("play"), _number(wish.get("speed")), _number(wish.get("seek_s"))
        duration_s = self._source.duration_s or 0.0
        if isinstance(play, bool):
            self._playing = play
            if play and self._at_s >= duration_s:
                self._at_s = 0.0
        if speed is not None:
            self._speed = min(max(speed, _SLOWEST), _FASTEST)
        if seek_s is not None:
            self._at_s = min(max(seek_s, 0.0), duration_s)
        self._asked.set()

    def _text(self) -> str:
        state = zlib.decompress(self._source.at(self._at_s)).decode()
        replay = {
            "at_s": round(self._at_s, 2),
            "duration_s": round(self._source.duration_s or 0.0, 2),
            "playing": self._playing,
            "speed": self._speed,
        }
        return f'{state[:-1]},"replay":{json.dumps(replay)}}}'


def _number(value: Any) -> float | None:
    """A finite number, else `None`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
