"""Conflicts that are not avoided, because the operator resumed the mission in spite of them.

A suppressed track is not avoided again before it has been out of conflict for `settle_s`. All others are
avoided as usual, and that manoeuvre keeps clear of the suppressed ones too.
"""

from companion.control.state_machine import StateData
from companion.model import Decision


def suppress(data: StateData, decision: Decision, now_s: float) -> None:
    """Suppress every track that is in conflict now."""
    data.suppressed_s = data.suppressed_s | {threat.track_id: now_s for threat in decision.threats}


def update(data: StateData, decision: Decision, settle_s: float, now_s: float) -> None:
    """Forget the tracks that have been out of conflict for `settle_s`; call this on every tick."""
    conflicts = {threat.track_id for threat in decision.threats}
    last_s = {track: now_s if track in conflicts else at_s for track, at_s in data.suppressed_s.items()}
    data.suppressed_s = {track: at_s for track, at_s in last_s.items() if now_s - at_s <= settle_s}


def covers(data: StateData, decision: Decision) -> bool:
    """Whether every track in conflict is suppressed."""
    suppressed = data.suppressed_s
    return bool(suppressed) and all(threat.track_id in suppressed for threat in decision.threats)
