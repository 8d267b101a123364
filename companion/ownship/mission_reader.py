"""The autopilot's mission and fence, downloaded again whenever they may have changed.

Ground stations have precedence: while one transfers a list nothing is requested, and our download ends.
"""

import math
from dataclasses import dataclass

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    Fact,
    MissionAck,
    MissionCount,
    MissionItem,
    MissionProgress,
    MissionTalk,
    Sender,
)
from companion.ownship.mission_download import DownloadOutcome, MissionDownload

MISSION, FENCE = mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_FENCE
_ALL_TYPES = mavlink.MAV_MISSION_TYPE_ALL
# A ground station's transfer is over this long after its last message.
_QUIET_S = 3.0
_REREAD_S = 300.0
_FIRST_RETRY_S, _LONGEST_RETRY_S = 10.0, 300.0

MISSION_PROTOCOL = (MissionCount, MissionItem, MissionAck, MissionTalk)
_Protocol = MissionCount | MissionItem | MissionAck | MissionTalk


@dataclass(slots=True)
class _List:
    """One list, `None` while it is unknown, and the time of its next download."""

    items: tuple[MissionItem, ...] | None = None
    due_s: float = -math.inf
    failures: int = 0


class MissionReader:
    """Copies of the autopilot's mission and fence, as tuples of items; `None`: unknown."""

    def __init__(self) -> None:
        self._lists = {MISSION: _List(), FENCE: _List()}
        self._download: MissionDownload | None = None
        self._busy_until_s = -math.inf
        self._progress: MissionProgress | None = None

    @property
    def mission(self) -> tuple[MissionItem, ...] | None:
        """The mission; with ArduPilot its first item is home."""
        return self._lists[MISSION].items

    @property
    def fence(self) -> tuple[MissionItem, ...] | None:
        """The items of the fence; they stay known while they are read again."""
        return self._lists[FENCE].items

    def restart(self) -> None:
        """Read both lists again, because the autopilot restarted or was out of contact."""
        self._download = None
        for one in self._lists.values():
            one.due_s, one.failures = -math.inf, 0

    def changed(self, mission_type: int, now_s: float) -> None:
        """Read the lists of this type again, as they may have changed; until then the mission is unknown."""
        for kind, one in self._lists.items():
            if mission_type in (kind, _ALL_TYPES):
                one.due_s, one.failures = now_s, 0
                if kind == MISSION:
                    one.items = None  # sequence numbers may mean other items now
                if self._download is not None and self._download.mission_type == kind:
                    self._download = None

    def observe(self, fact: Fact, us: Sender, autopilot: Sender, now_s: float) -> None:
        """Process a fact from any sender; `us` and `autopilot` are addresses."""
        match fact:
            case MissionProgress() if fact.sender == autopilot:
                self._compare(fact, now_s)
            case MissionCount() | MissionItem() | MissionAck() | MissionTalk():
                if fact.sender == autopilot and fact.target == us:
                    self._answered(fact, now_s)
                elif fact.sender == autopilot or fact.target == autopilot:
                    self._overheard(fact, autopilot, now_s)
            case _:
                pass

    def tick(self, autopilot: Sender, now_s: float) -> Message | None:
        """The message to send now, if any."""
        if self._download is None and now_s >= self._busy_until_s:
            self._download = self._start(now_s)
        if self._download is None:
            return None
        message = self._download.tick(autopilot, now_s)
        if self._download.outcome is not None:
            self._finish(self._download, now_s)
        return message

    def _start(self, now_s: float) -> MissionDownload | None:
        due = [(one.due_s, kind) for kind, one in self._lists.items() if now_s >= one.due_s]
        return MissionDownload(min(due)[1]) if due else None

    def _finish(self, download: MissionDownload, now_s: float) -> None:
        self._download = None
        one = self._lists[download.mission_type]
        if download.outcome is DownloadOutcome.FAILED:
            wait_s = min(_FIRST_RETRY_S * 2.0**one.failures, _LONGEST_RETRY_S)
            one.failures += 1
            one.due_s = now_s + wait_s
            return
        one.items = tuple(download.items)
        one.failures, one.due_s = 0, now_s + _REREAD_S

    def _answered(self, fact: _Protocol, now_s: float) -> None:
        if self._download is not None and not isinstance(fact, MissionTalk):
            self._download.observe(fact, now_s)

    def _overheard(self, fact: _Protocol, autopilot: Sender, now_s: float) -> None:
        """Wait while a ground station transfers a list; an upload begins with COUNT and ends with an ACK."""
        self._busy_until_s = now_s + _QUIET_S
        if self._download is not None:
            self._download.cancel()
        accepted = isinstance(fact, MissionAck) and fact.result == mavlink.MAV_MISSION_ACCEPTED
        announced = isinstance(fact, MissionCount)
        if (accepted and fact.sender == autopilot) or (announced and fact.target == autopilot):
            self.changed(fact.mission_type, now_s)

    def _compare(self, fact: MissionProgress, now_s: float) -> None:
        before, self._progress = self._progress, fact
        if before is None:
            return
        if (before.total, before.mission_id) != (fact.total, fact.mission_id):
            self.changed(MISSION, now_s)
        if before.fence_id != fact.fence_id:
            self.changed(FENCE, now_s)
