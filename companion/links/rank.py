"""The rank of a peer: who keeps its place when a link has more senders than places."""

from collections.abc import Iterable
from enum import IntEnum

from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame

Address = tuple[int, int]  # system and component

_HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
_TYPE, _AUTOPILOT = 4, 5  # bytes of a HEARTBEAT's payload
_NO_AUTOPILOT = mavlink.MAV_AUTOPILOT_INVALID
# The types of HEARTBEAT that are no vehicles, whatever autopilot they name.
_NO_VEHICLES = frozenset(
    {
        mavlink.MAV_TYPE_ANTENNA_TRACKER,
        mavlink.MAV_TYPE_GCS,
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_TYPE_GIMBAL,
        mavlink.MAV_TYPE_ADSB,
        mavlink.MAV_TYPE_CAMERA,
        mavlink.MAV_TYPE_CHARGING_STATION,
        mavlink.MAV_TYPE_FLARM,
        mavlink.MAV_TYPE_SERVO,
        mavlink.MAV_TYPE_ODID,
        *range(36, 43),  # battery, parachute, log, OSD, IMU, GPS, winch
    }
)


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
        is_vehicle = frame.message_id == _HEARTBEAT and _is_vehicle(frame.payload)
        rank = max(rank, Rank.VEHICLE if is_vehicle else Rank.OTHER)
    return rank


def _is_vehicle(payload: bytes) -> bool:
    if len(payload) <= _AUTOPILOT:
        return False
    return payload[_AUTOPILOT] != _NO_AUTOPILOT and payload[_TYPE] not in _NO_VEHICLES
