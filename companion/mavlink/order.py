"""Datagrams that overtook each other: which heartbeat is older than one that was heard already."""

from dataclasses import dataclass

from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame

_TURN = 256  # of the sequence number
# So many old heartbeats in a row are no stragglers: their sender started anew.
_MOST_STRAGGLERS = 3


@dataclass(slots=True)
class _Sender:
    newest: int  # counted on over all turns, over all frames
    heartbeat: int  # the newest heartbeat's, in the same count
    stragglers: int = 0


class Order:
    """Watches the sequence numbers of one link, by sender."""

    def __init__(self) -> None:
        self._senders: dict[tuple[int, int], _Sender] = {}

    def is_overtaken(self, frame: Frame) -> bool:
        """Whether this is a heartbeat, and a later one was heard already; a repetition counts too.

        To be called with every frame of the link: that keeps the count over the turns of the number.
        """
        address = frame.system_id, frame.component_id
        sender = self._senders.get(address)
        if sender is None:
            self._senders[address] = _Sender(frame.sequence, frame.sequence - _TURN)
            sender = self._senders[address]
        ahead = (frame.sequence - sender.newest + _TURN // 2) % _TURN - _TURN // 2
        place = sender.newest + ahead
        sender.newest = max(place, sender.newest)
        if frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return False
        if place <= sender.heartbeat and sender.stragglers < _MOST_STRAGGLERS:
            sender.stragglers += 1
            return True
        if sender.stragglers:
            sender.newest = place
        sender.heartbeat, sender.stragglers = place, 0
        return False
