"""Mission and fence as lists of items: one download by the mission protocol, and when each list is read."""

import math
from dataclasses import dataclass
from enum import Enum

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    Fact,
    MissionAck,
    MissionCount,
    MissionItem,
    MissionProgress,
    OtherMissionMessage,
    Sender,
)

MISSION, FENCE = mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_MISSION_TYPE_FENCE
_ALL_TYPES = mavlink.MAV_MISSION_TYPE_ALL
MISSION_PROTOCOL = (MissionCount, MissionItem, MissionAck, OtherMissionMessage)
_Protocol = MissionCount | MissionItem | MissionAck | OtherMissionMessage

_FIRST_ANSWER_S, _LONGEST_ANSWER_S = 1.0, 4.0
# With 30 % of the datagrams lost in each direction, one item in a thousand is still unanswered after these.
_TRIES = 10
# A list that changes more often than this during its download is being edited.
_RESTARTS = 3
# No board stores more; a larger count is wrong.
_MOST_ITEMS = 3_000
# A ground station's transfer is over this long after its last message.
_QUIET_S = 3.0
_REREAD_S, _CONFIRMED_S = 300.0, 8.0
_FIRST_RETRY_S, _LONGEST_RETRY_S = 10.0, 300.0


class DownloadOutcome(Enum):
    """The result of a download."""

    DONE = "done"
    UNSUPPORTED = "unsupported"  # the autopilot has no such list
    FAILED = "failed"  # not answered, refused, cancelled, or the list changed too often


class MissionDownload:
    """One download. `outcome` is `None` while it is under way; `items` is the list when it is DONE."""

    def __init__(self, mission_type: int) -> None:
        self.mission_type = mission_type
        self.items: list[MissionItem] = []
        self.outcome: DownloadOutcome | None = None
        self._count: int | None = None
        self._tries = 0
        self._restarts = 0
        self._due_s = -math.inf
        self._final_ack: int | None = None

    def observe(self, fact: MissionCount | MissionItem | MissionAck, now_s: float) -> None:
        """Process an answer that is addressed to us; one that does not fit is late and ignored."""
        if self.outcome is not None or fact.mission_type != self.mission_type:
            return
        match fact:
            case MissionCount():
                self._counted(fact.count, now_s)
            case MissionItem():
                self._received(fact, now_s)
            case MissionAck():
                self._refused(fact.result, now_s)

    def tick(self, target: Sender, now_s: float) -> Message | None:
        """The message to send now, if any; after the outcome, one final MISSION_ACK."""
        if self.outcome is not None:
            return self._ack(target)
        if now_s < self._due_s:
            return None
        if self._tries >= _TRIES:
            self._end(DownloadOutcome.FAILED, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            return self._ack(target)
        self._due_s = now_s + min(_FIRST_ANSWER_S * 1.5**self._tries, _LONGEST_ANSWER_S)
        self._tries += 1
        if self._count is None:
            return mavlink.MAVLink_mission_request_list_message(
                target.system_id, target.component_id, mission_type=self.mission_type
            )
        return mavlink.MAVLink_mission_request_int_message(
            target.system_id, target.component_id, seq=len(self.items), mission_type=self.mission_type
        )

    @property
    def counted(self) -> bool:
        """Whether the number of items is known."""
        return self._count is not None

    def cancel(self) -> None:
        """End the download, because a ground station transfers a list."""
        if self.outcome is None:
            self._end(DownloadOutcome.FAILED, mavlink.MAV_MISSION_OPERATION_CANCELLED)

    def _counted(self, count: int, now_s: float) -> None:
        if count == self._count:
            return
        if self._count is not None and not self._may_restart():
            return
        if count > _MOST_ITEMS:
            self._end(DownloadOutcome.FAILED, mavlink.MAV_MISSION_NO_SPACE)
            return
        self._count = count
        self.items.clear()
        self._go_on(now_s)

    def _received(self, item: MissionItem, now_s: float) -> None:
        if self._count is not None and item.sequence == len(self.items):
            self.items.append(item)
            self._go_on(now_s)

    def _refused(self, result: int, now_s: float) -> None:
        if result == mavlink.MAV_MISSION_UNSUPPORTED:
            self._end(DownloadOutcome.UNSUPPORTED, None)
        elif result == mavlink.MAV_MISSION_INVALID_SEQUENCE:
            if self._count is not None and self._may_restart():
                # The list became shorter during the download.
                self._count = None
                self.items.clear()
                self._go_on(now_s)
        elif result != mavlink.MAV_MISSION_ACCEPTED:
            self._end(DownloadOutcome.FAILED, None)

    def _go_on(self, now_s: float) -> None:
        self._tries, self._due_s = 0, now_s
        if self._count is not None and len(self.items) >= self._count:
            self._end(DownloadOutcome.DONE, mavlink.MAV_MISSION_ACCEPTED)

    def _may_restart(self) -> bool:
        self._restarts += 1
        if self._restarts > _RESTARTS:
            self._end(DownloadOutcome.FAILED, mavlink.MAV_MISSION_OPERATION_CANCELLED)
        return self._restarts <= _RESTARTS

    def _end(self, outcome: DownloadOutcome, final_ack: int | None) -> None:
        self.outcome, self._final_ack = outcome, final_ack

    def _ack(self, target: Sender) -> Message | None:
        result, self._final_ack = self._final_ack, None
        if result is None:
            return None
        return mavlink.MAVLink_mission_ack_message(
            target.system_id, target.component_id, result, mission_type=self.mission_type
        )


@dataclass(slots=True)
class _List:
    """One list, `None` while it is unknown, and the time of its next download."""

    items: tuple[MissionItem, ...] | None = None
    due_s: float = -math.inf
    failures: int = 0
    changed: bool = False  # since it was last read


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
    def mission_arrives(self) -> bool:
        """Whether the mission is being read, and the number of its items is known."""
        download = self._download
        return download is not None and download.mission_type == MISSION and download.counted

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
                one.due_s, one.failures, one.changed = now_s, 0, True
                if kind == MISSION:
                    one.items = None  # sequence numbers may mean other items now
                # The mission comes before the fence: until it is known, the aircraft may be about to land.
                under_way = None if self._download is None else self._download.mission_type
                if under_way == kind or (kind == MISSION and under_way == FENCE):
                    self._download = None

    def observe(self, fact: Fact, us: Sender, autopilot: Sender, now_s: float) -> None:
        """Process a fact from any sender; `us` and `autopilot` are addresses."""
        match fact:
            case MissionProgress() if fact.sender == autopilot:
                self._compare(fact, now_s)
            case MissionCount() | MissionItem() | MissionAck() | OtherMissionMessage():
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
        unknown = self._lists[MISSION].items is None and now_s >= self._lists[MISSION].due_s
        if unknown:
            return MissionDownload(MISSION)
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
        # Answers from before a change may arrive after it: read once more.
        one.failures, one.due_s = 0, now_s + (_CONFIRMED_S if one.changed else _REREAD_S)
        one.changed = False

    def _answered(self, fact: _Protocol, now_s: float) -> None:
        if self._download is not None and not isinstance(fact, OtherMissionMessage):
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
            # What was read before may have been of an older mission.
            under_way = self._download is not None and self._download.mission_type == MISSION
            if under_way or self._lists[MISSION].items is not None:
                self.changed(MISSION, now_s)
            return
        if (before.total, before.mission_id) != (fact.total, fact.mission_id):
            self.changed(MISSION, now_s)
        if before.fence_id != fact.fence_id:
            self.changed(FENCE, now_s)
