"""Whom the operator has decided about: he has sent the aircraft on its mission in spite of them."""

from companion.gcs.settings import Settings
from companion.model import Decision


class SuppressedThreats:
    """Aircraft that are not avoided again before they have been no conflict for `supervisor.settle_s`.

    Everybody else is avoided as ever, and while that is flown, it keeps clear of those dismissed too.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._conflict_s: dict[str, float] = {}  # when each was a conflict the last time

    def __bool__(self) -> bool:
        return bool(self._conflict_s)

    def add(self, decision: Decision, now_s: float) -> None:
        """All who are a conflict now."""
        self._conflict_s |= dict.fromkeys((threat.track_id for threat in decision.threats), now_s)

    def observe(self, decision: Decision, now_s: float) -> None:
        """Take note of who still is one; at every tick."""
        if not self._conflict_s:
            return
        conflicts = {threat.track_id for threat in decision.threats}
        last_s = {track: now_s if track in conflicts else at_s for track, at_s in self._conflict_s.items()}
        settle_s = self._settings.supervisor.settle_s
        self._conflict_s = {track: at_s for track, at_s in last_s.items() if now_s - at_s <= settle_s}

    def forget(self) -> None:
        """Nobody is dismissed any more."""
        self._conflict_s = {}

    def cover(self, decision: Decision) -> bool:
        """Whether nobody else is in conflict with us."""
        return bool(self) and all(threat.track_id in self._conflict_s for threat in decision.threats)
