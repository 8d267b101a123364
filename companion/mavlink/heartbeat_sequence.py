"""Heartbeats out of order: recognizes one that is older than a heartbeat received before it."""

from dataclasses import dataclass

from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame

_WRAP = 256  # of the sequence number
# After this many outdated heartbeats in a row the sender must have restarted.
_MAX_OUTDATED = 3
# After a silence this long the number may have wrapped, so that it proves nothing. No frame is so late.
_SILENCE_S = 1.0


@dataclass(slots=True)
class _Sender:
    newest: int  # sequence number of the newest frame, counted on over all wraps
    heartbeat: int  # the same for the newest heartbeat
    heard_s: float
    outdated: int = 0  # in a row


class HeartbeatSequence:
    """The sequence numbers of the frames on one link, by sender."""

    def __init__(self) -> None:
        self._senders: dict[tuple[int, int], _Sender] = {}

    def is_outdated(self, frame: Frame, now_s: float) -> bool:
        """Whether the frame is a heartbeat that is not newer than the newest one received.

        Call this for every frame of the link, to follow the sequence number over its wraps. `now_s` is the
        time of arrival on any clock [s].
        """
        address = frame.system_id, frame.component_id
        sender = self._senders.get(address)
        if sender is None or not abs(now_s - sender.heard_s) < _SILENCE_S:
            sender = self._senders[address] = _Sender(frame.sequence, frame.sequence - _WRAP, now_s)
        sender.heard_s = now_s
        ahead = (frame.sequence - sender.newest + _WRAP // 2) % _WRAP - _WRAP // 2
        number = sender.newest + ahead
        sender.newest = max(number, sender.newest)
        if frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return False
        if number <= sender.heartbeat and sender.outdated < _MAX_OUTDATED:
            sender.outdated += 1
            return True
        if sender.outdated:
            sender.newest = number
        sender.heartbeat, sender.outdated = number, 0
        return False
