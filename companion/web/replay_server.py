"""A replay in the browser: the state at every tick is kept, and played afterwards."""

from companion.engine import Engine
from companion.web.app import build
from companion.web.live_snapshot import Health, live_snapshot_of
from companion.web.loop_times import LoopTimes
from companion.web.rolling_stats import RollingStats
from companion.web.serving import listen, serve
from companion.web.settings import Settings
from companion.web.source import Recorded
from companion.web.state import state_of


class ReplayServer:
    """Takes the states of an engine that is driven by a log. `CompanionError` where it cannot listen."""

    def __init__(self, engine: Engine, settings: Settings) -> None:
        self.settings = settings
        self._engine = engine
        self._socket = listen(settings)
        self._source = Recorded()
        self._trends = RollingStats()
        self._still = Health.of(0.0, LoopTimes(), ())
        self._last_s = -1.0

    def take(self, since_s: float, now_s: float) -> None:
        """The engine has ticked: so long since the start of the log, at this time by its own clock [s]."""
        if since_s <= self._last_s:
            return
        self._last_s = since_s
        moment = live_snapshot_of(self._engine, now_s, self._still)
        self._source.add(since_s, state_of(moment, len(self._source.at_s) + 1, self._trends))

    async def show(self) -> None:
        """Serve what was taken, until cancelled."""
        await serve(build(self._source, self.settings), self._socket)
