"""The rank of a peer: who keeps its place when a link has more senders than places."""

from collections.abc import Iterable
from enum import IntEnum

from companion.mavlink.dialect import is_vehicle, mavlink
from companion.mavlink.framing import Frame

Address = tuple[int, int]  # system and component

_HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
_TYPE, _AUTOPILOT = 4, 5  # bytes of a HEARTBEAT's payload


class Rank(IntEnum):
    """A sender may take the place of one of its own rank or a lower one, the longest unheard first."""

    SILENT = 0  # a connection without a good frame so far
    OTHER = 1
    VEHICLE = 2  # sends heartbeats of an autopilot
    OURS = 3  # the autopilot that is flown


def rank_of(frames: Iterable[Frame], ours: Address | None) -> Rank:
    """The rank that these frames give their sender; `ours` is the address of the autopilot that is flown."""
    rank = Rank.SILENT
    for frame in frames:
        if ours == (frame.system_id, frame.component_id):
            return Rank.OURS
        rank = max(rank, Rank.VEHICLE if _is_vehicles_heartbeat(frame) else Rank.OTHER)
    return rank


def _is_vehicles_heartbeat(frame: Frame) -> bool:
    payload = frame.payload
    if frame.message_id != _HEARTBEAT or len(payload) <= _AUTOPILOT:
        return False
    return is_vehicle(payload[_TYPE], payload[_AUTOPILOT])
