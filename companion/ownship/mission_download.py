"""One download of a list of mission items, by the mission protocol.

https://mavlink.io/en/services/mission.html#download_mission: REQUEST_LIST, COUNT, then REQUEST_INT and
ITEM_INT for each item, ACK. Datagrams may get lost, come twice, late, or in another order.
"""

import math
from enum import Enum

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import MissionAck, MissionCount, MissionItem, Sender

_FIRST_ANSWER_S, _LONGEST_ANSWER_S = 1.0, 4.0
# With 30 % of the datagrams lost in each direction, one item in a thousand is still not answered by then.
_TRIES = 10
# A list that changes more often than this during its download is being edited.
_RESTARTS = 3
# No board stores more; a larger count is wrong.
_MOST_ITEMS = 3_000


class DownloadOutcome(Enum):
    """The result of a download."""

    DONE = "done"
    UNSUPPORTED = "unsupported"  # the autopilot has no such list
    FAILED = "failed"  # not answered, refused, cancelled, or the list changed too often


class MissionDownload:
    """One download; `outcome` is `None` while it is under way, and `items` is the list when it is DONE."""

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
