"""Datagrams that overtook each other: which heartbeat is older than one that was heard already."""

from dataclasses import dataclass

from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame

_TURN = 256  # of the sequence number
# So many old heartbeats in a row are no stragglers: their sender started anew.
_MOST_STRAGGLERS = 3
# In so long a silence the number may have gone around: it tells nothing then, and nothing straggles so long.
_SILENCE_S = 1.0


@dataclass(slots=True)
class _Sender:
    newest: int  # counted on over all turns, over all frames
    heartbeat: int  # the newest heartbeat's, in the same count
    heard_s: float
    stragglers: int = 0


class HeartbeatSequence:
    """Watches the sequence numbers of one link, by sender."""

    def __init__(self) -> None:
        self._senders: dict[tuple[int, int], _Sender] = {}

    def is_overtaken(self, frame: Frame, now_s: float) -> bool:
        """Whether this is a heartbeat, and a later one was heard already; a repetition counts too.

        To be called with every frame of the link: that keeps the count over the turns of the number. `now_s`
        is when it arrived, by any clock [s].
        """
        address = frame.system_id, frame.component_id
        sender = self._senders.get(address)
        if sender is None or not abs(now_s - sender.heard_s) < _SILENCE_S:
            sender = self._senders[address] = _Sender(frame.sequence, frame.sequence - _TURN, now_s)
        sender.heard_s = now_s
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
