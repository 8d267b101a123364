"""Observers of a flight: the display, ten times a second, and the record, every ten seconds."""

import json
import logging
from collections.abc import Callable

from companion.engine import Engine
from companion.recording.recorder import Recorder
from companion.web.display import Display
from companion.web.health import Health
from companion.web.live_snapshot import live_snapshot_of
from companion.web.rolling_stats import RollingStats
from companion.web.state import state_of

_log = logging.getLogger("companion")

# Decisions are recorded at every tick. The state adds the mission, fences and links, which seldom change.
_RECORDED_EVERY_US = 10_000_000


class Observers:
    """Takes snapshots of the engine for display and record. An observer that fails is switched off."""

    def __init__(self, display: Display | None, recorder: Recorder | None) -> None:
        self._display = display
        self._recorder = recorder
        self._recorded_us: int | None = None
        self._stats = RollingStats(over_s=2e-6 * _RECORDED_EVERY_US)
        self._count = 0
        self._broken: set[str] = set()

    def look(self, engine: Engine, now_us: int, health: Callable[[], Health]) -> None:
        """Take the snapshots that are due after a tick."""
        if self._display is not None and self._display.is_ready():
            self._try("display", lambda: self._show(engine, now_us, health))
        if self._recorder is not None and self._is_due(now_us):
            self._try("state in the record", lambda: self._record(engine, now_us, health))

    def _try(self, what: str, act: Callable[[], None]) -> None:
        """Run an observer. Its failure switches it off and does not end the flight."""
        if what in self._broken:
            return
        try:
            act()
        except Exception:  # noqa: BLE001 - as in `Runtime._guarded`, and to less effect
            self._broken.add(what)
            _log.exception("%s: switched off", what)

    def _show(self, engine: Engine, now_us: int, health: Callable[[], Health]) -> None:
        if self._display is not None:
            self._display.show(live_snapshot_of(engine, now_us / 1e6, health()))

    def _record(self, engine: Engine, now_us: int, health: Callable[[], Health]) -> None:
        self._recorded_us = now_us
        self._count += 1
        snapshot = live_snapshot_of(engine, now_us / 1e6, health())
        self._stats.add(snapshot.health)
        state = state_of(snapshot, self._count, self._stats)
        if self._recorder is not None:
            self._recorder.state(now_us, json.dumps(state, separators=(",", ":"), allow_nan=False))

    def _is_due(self, now_us: int) -> bool:
        last_us = self._recorded_us
        return last_us is None or not 0 <= now_us - last_us < _RECORDED_EVERY_US
