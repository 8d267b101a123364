"""One list of mission items on its way from the autopilot: the download half of the mission protocol.

https://mavlink.io/en/services/mission.html#download_mission: REQUEST_LIST, COUNT, then REQUEST_INT and
ITEM_INT for each item, ACK. Datagrams may get lost, come twice, late, or in another order.
"""

import math
from enum import Enum

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import MissionAck, MissionCount, MissionItem, Sender

_FIRST_ANSWER_S, _LONGEST_ANSWER_S = 1.0, 4.0
# Where three of ten datagrams get lost each way, one item in a thousand is not answered by then.
_TRIES = 10
# A list that changes again and again while it is read is being worked on.
_RESTARTS = 3
# More than any board stores; a count beyond it would keep us busy for nothing.
_MOST_ITEMS = 3_000


class Outcome(Enum):
    """How a download ended."""

    DONE = "done"
    UNSUPPORTED = "unsupported"  # the autopilot has no such list
    FAILED = "failed"  # no answer, refused, or changing all the time


class Download:
    """One transfer. `outcome` is `None` while it is under way; then `items` is the list, when it is done."""

    def __init__(self, mission_type: int) -> None:
        self.mission_type = mission_type
        self.items: list[MissionItem] = []
        self.outcome: Outcome | None = None
        self._count: int | None = None
        self._tries = 0
        self._restarts = 0
        self._due_s = -math.inf
        self._farewell: int | None = None

    def observe(self, fact: MissionCount | MissionItem | MissionAck, now_s: float) -> None:
        """Take an answer in that was meant for us; what does not fit is an echo of something older."""
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
        """The message to send now, if any; after the outcome one more, which says farewell."""
        if self.outcome is not None:
            return self._goodbye(target)
        if now_s < self._due_s:
            return None
        if self._tries >= _TRIES:
            self._end(Outcome.FAILED, mavlink.MAV_MISSION_OPERATION_CANCELLED)
            return self._goodbye(target)
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
        """Somebody else needs the autopilot's attention."""
        if self.outcome is None:
            self._end(Outcome.FAILED, mavlink.MAV_MISSION_OPERATION_CANCELLED)

    def _counted(self, count: int, now_s: float) -> None:
        if count == self._count:
            return
        if self._count is not None and not self._may_restart():
            return
        if count > _MOST_ITEMS:
            self._end(Outcome.FAILED, mavlink.MAV_MISSION_NO_SPACE)
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
            self._end(Outcome.UNSUPPORTED, None)
        elif result == mavlink.MAV_MISSION_INVALID_SEQUENCE:
            if self._count is not None and self._may_restart():
                # There are fewer items than there were.
                self._count = None
                self.items.clear()
                self._go_on(now_s)
        elif result != mavlink.MAV_MISSION_ACCEPTED:
            self._end(Outcome.FAILED, None)

    def _go_on(self, now_s: float) -> None:
        self._tries, self._due_s = 0, now_s
        if self._count is not None and len(self.items) >= self._count:
            self._end(Outcome.DONE, mavlink.MAV_MISSION_ACCEPTED)

    def _may_restart(self) -> bool:
        self._restarts += 1
        if self._restarts > _RESTARTS:
            self._end(Outcome.FAILED, mavlink.MAV_MISSION_OPERATION_CANCELLED)
        return self._restarts <= _RESTARTS

    def _end(self, outcome: Outcome, farewell: int | None) -> None:
        self.outcome, self._farewell = outcome, farewell

    def _goodbye(self, target: Sender) -> Message | None:
        farewell, self._farewell = self._farewell, None
        if farewell is None:
            return None
        return mavlink.MAVLink_mission_ack_message(
            target.system_id, target.component_id, farewell, mission_type=self.mission_type
        )
