"""A replay in the browser: keeps the state of every tick, then serves and plays them."""

import asyncio
import bisect
import json
import math
import time
import zlib
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from companion.engine import Engine
from companion.sources.receiver import Receiver
from companion.web.app import build
from companion.web.health import Health, LoopTimes, ReceiverCount
from companion.web.live_snapshot import live_snapshot_of
from companion.web.rolling_stats import RollingStats
from companion.web.serving import listen, serve
from companion.web.settings import Settings
from companion.web.source import Source, View
from companion.web.state import state_of

_SLOWEST, _FASTEST = 0.1, 50.0
_FRAME_S = 0.1


class RecordedSource(Source):
    """A recorded flight: its states and their times since the start [s]."""

    kind = "replay"

    def __init__(self) -> None:
        self.at_s: list[float] = []
        self._states: list[bytes] = []
        self._layers: list[tuple[float, str, str]] = []
        self._last = ("", "")

    def add(self, at_s: float, state: dict[str, Any]) -> None:
        """Add a state that is later than those before."""
        self.at_s.append(at_s)
        # Compressed: an hour has 36,000 states.
        self._states.append(zlib.compress(json.dumps(state, separators=(",", ":")).encode(), 1))
        decision = state["decision"]
        present = decision["layer"], decision.get("announced", "")
        if present != self._last:
            self._layers.append((at_s, present[0], present[1] or decision["because"]))
            self._last = present
        self.duration_s = at_s

    def state_at(self, at_s: float) -> str:
        """The last state at or before a time since the start."""
        return zlib.decompress(self._states[max(bisect.bisect_right(self.at_s, at_s) - 1, 0)]).decode()

    def newest(self) -> str | None:
        """The last state."""
        return self.state_at(math.inf) if self._states else None

    def view(self) -> "RecordedView":
        """Each viewer plays independently."""
        return RecordedView(self)

    def layers(self) -> list[tuple[float, str, str]]:
        """All changes of layer or of the manoeuvre."""
        return self._layers


class RecordedView(View):
    """Plays, pauses and seeks for one viewer."""

    def __init__(self, source: RecordedSource) -> None:
        self._source = source
        self._at_s = 0.0
        self._playing = True
        self._speed = 1.0
        self._controlled = asyncio.Event()

    async def states(self) -> AsyncIterator[str]:
        """Ten states a second while playing; one after each message of the viewer."""
        while True:
            self._controlled.clear()  # a message that comes while this state is sent changes the next
            begun_s = time.monotonic()
            yield self._text()
            try:
                async with asyncio.timeout(_FRAME_S if self._playing else None):
                    await self._controlled.wait()
            except TimeoutError:
                duration_s = self._source.duration_s or 0.0
                self._at_s = min(self._at_s + self._speed * (time.monotonic() - begun_s), duration_s)
                self._playing = self._at_s < duration_s

    def control(self, message: Mapping[str, Any]) -> None:
        """Apply `play`, `speed` and `seek_s` of a message; invalid values change nothing."""
        play, speed, seek_s = (
            message.get("play"),
            _number(message.get("speed")),
            _number(message.get("seek_s")),
        )
        duration_s = self._source.duration_s or 0.0
        if isinstance(play, bool):
            self._playing = play
            if play and self._at_s >= duration_s:
                self._at_s = 0.0
        if speed is not None:
            self._speed = min(max(speed, _SLOWEST), _FASTEST)
        if seek_s is not None:
            self._at_s = min(max(seek_s, 0.0), duration_s)
        self._controlled.set()

    def _text(self) -> str:
        replay = {
            "at_s": round(self._at_s, 2),
            "duration_s": round(self._source.duration_s or 0.0, 2),
            "playing": self._playing,
            "speed": self._speed,
        }
        return f'{self._source.state_at(self._at_s)[:-1]},"replay":{json.dumps(replay)}}}'


class ReplayServer:
    """Keeps the states of an engine in a replay, then serves them. `CompanionError` if it cannot listen."""

    def __init__(
        self,
        engine: Engine,
        settings: Settings,
        receivers: Callable[[], Iterable[Receiver]] = lambda: (),
    ) -> None:
        self.settings = settings
        self._receivers = receivers
        self._engine = engine
        self._socket = listen(settings)
        self.source = RecordedSource()
        self._stats = RollingStats()  # of the links: a replay has none
        self._receiver_stats = RollingStats(lambda: self._last_s)
        self._health = Health.of(0.0, LoopTimes(), ())
        self._last_s = -1.0

    def take(self, since_s: float, now_s: float) -> None:
        """Keep the state of a tick `since_s` after the start of the log, `now_s` by the engine's clock."""
        if since_s <= self._last_s:
            return
        self._last_s = since_s
        counts = tuple(ReceiverCount.of_recorded(one, now_s) for one in self._receivers())
        self._receiver_stats.add(replace(self._health, receivers=counts))
        snapshot = live_snapshot_of(self._engine, now_s, self._health)
        state = state_of(snapshot, len(self.source.at_s) + 1, self._stats)
        self.source.add(since_s, state | {"receivers": self._receiver_stats.receivers()})

    def close(self) -> None:
        """Close the socket, unless `show` did."""
        self._socket.close()

    async def show(self) -> None:
        """Serve the states until cancelled."""
        await serve(build(self.source, self.settings), self._socket)


def _number(value: Any) -> float | None:
    """A finite number, else `None`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
