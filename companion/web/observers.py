"""Who looks on while the aircraft is flown: the display, ten times a second, and now and then the record."""

import json
import logging
from collections.abc import Callable

from companion.engine import Engine
from companion.recording.recorder import Recorder
from companion.web.display import Display
from companion.web.live_snapshot import Health, live_snapshot_of
from companion.web.rolling_stats import RollingStats
from companion.web.state import state_of

_log = logging.getLogger("companion")

# Decisions are recorded at every tick with all that they are about; this is for the mission, the fences and
# the links, which change seldom.
_RECORDED_EVERY_US = 10_000_000


class Observers:
    """Shows moments to whoever wants them now. What goes wrong in that is no reason to stop flying."""

    def __init__(self, display: Display | None, recorder: Recorder | None) -> None:
        self._display = display
        self._recorder = recorder
        self._recorded_us: int | None = None
        self._trends = RollingStats(over_s=2e-6 * _RECORDED_EVERY_US)
        self._count = 0
        self._broken: set[str] = set()

    def look(self, engine: Engine, now_us: int, health: Callable[[], Health]) -> None:
        """The engine has ticked."""
        if self._display is not None and self._display.is_ready():
            self._try("display", lambda: self._show(engine, now_us, health))
        if self._recorder is not None and self._is_due(now_us):
            self._try("state in the record", lambda: self._record(engine, now_us, health))

    def _try(self, what: str, act: Callable[[], None]) -> None:
        """What cannot be drawn is no reason to give the aircraft back: it is only not drawn any more."""
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
        moment = live_snapshot_of(engine, now_us / 1e6, health())
        self._trends.show(moment.health)
        state = state_of(moment, self._count, self._trends)
        if self._recorder is not None:
            self._recorder.state(now_us, json.dumps(state, separators=(",", ":"), allow_nan=False))

    def _is_due(self, now_us: int) -> bool:
        last_us = self._recorded_us
        return last_us is None or not 0 <= now_us - last_us < _RECORDED_EVERY_US
