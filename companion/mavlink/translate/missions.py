"""From messages to facts, about missions, fences, home and terrain.

The wire's traps: places are degrees times 1e7 only in a global frame, a mission type that is not sent arrives
as 0, "not given" is NaN, and terrain that the autopilot has no data for is reported as 0 m.
"""

import math
import struct
from collections import namedtuple
from typing import Any

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    Fact,
    FenceStatus,
    HeightAbove,
    HomePosition,
    MissionAck,
    MissionCount,
    MissionItem,
    MissionProgress,
    MissionTalk,
    Sender,
    TerrainReport,
)
from companion.mavlink.translate.wire import UINT16_MAX, Translation, place_deg

# No land is lower than the shore of the Dead Sea, none is higher than Everest.
_LOWEST_TERRAIN_M, _HIGHEST_TERRAIN_M = -500.0, 9_000.0
_FARTHEST_HEIGHT_M = 40_000.0
_HEIGHTS_ABOVE = {
    mavlink.MAV_FRAME_GLOBAL: HeightAbove.SEA,
    mavlink.MAV_FRAME_GLOBAL_INT: HeightAbove.SEA,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT: HeightAbove.HOME,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: HeightAbove.HOME,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT: HeightAbove.TERRAIN,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: HeightAbove.TERRAIN,
}


def _progress(message: Message, sender: Sender, _received_s: float) -> Fact:
    """The identities are newer than the dialect, see `LAYOUTS`; 0 stands for "not told" in all but `seq`."""
    total = message.total
    return MissionProgress(
        sender=sender,
        sequence=message.seq,
        total=None if total in (0, UINT16_MAX) else total,
        mission_id=getattr(message, "mission_id", 0) or None,
        fence_id=getattr(message, "fence_id", 0) or None,
    )


def _item(message: Message, sender: Sender, _received_s: float) -> Fact:
    above = _HEIGHTS_ABOVE.get(message.frame)
    place = None if above is None else place_deg(message.x, message.y)
    height_m = None if above is None else _finite(message.z)
    if height_m is not None and abs(height_m) > _FARTHEST_HEIGHT_M:
        height_m = None
    return MissionItem(
        sender=sender,
        target=_target(message),
        mission_type=message.mission_type,
        sequence=message.seq,
        command=message.command,
        params=(
            _finite(message.param1),
            _finite(message.param2),
            _finite(message.param3),
            _finite(message.param4),
        ),
        lat_deg=None if place is None else place[0],
        lon_deg=None if place is None else place[1],
        height_m=height_m,
        height_above=above or HeightAbove.SEA,
    )


def _count(message: Message, sender: Sender, _received_s: float) -> Fact:
    return MissionCount(sender, _target(message), message.mission_type, message.count)


def _ack(message: Message, sender: Sender, _received_s: float) -> Fact:
    return MissionAck(sender, _target(message), message.mission_type, message.type)


def _talk(message: Message, sender: Sender, _received_s: float) -> Fact:
    return MissionTalk(sender, _target(message), message.mission_type)


def _fence_status(message: Message, sender: Sender, _received_s: float) -> Fact:
    return FenceStatus(sender, bool(message.breach_status))


def _home_position(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    place = place_deg(message.latitude, message.longitude)
    return None if place is None else HomePosition(sender, *place, message.altitude / 1000.0)


def _terrain_report(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """Without data for the place `spacing` is 0; `pending` blocks are still on their way."""
    place = place_deg(message.lat, message.lon)
    terrain_m, height_m = message.terrain_height, message.current_height
    if place is None or message.pending or not message.spacing:
        return None
    if not _LOWEST_TERRAIN_M <= terrain_m <= _HIGHEST_TERRAIN_M or not abs(height_m) <= _FARTHEST_HEIGHT_M:
        return None
    return TerrainReport(sender, *place, terrain_m, height_m)


def _target(message: Message) -> Sender:
    return Sender(message.target_system, message.target_component)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: _progress,
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT: _count,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: _item,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK: _ack,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM: _talk,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST: _talk,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: _talk,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: _talk,
    mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: _talk,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: _fence_status,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: _home_position,
    mavlink.MAVLINK_MSG_ID_TERRAIN_REPORT: _terrain_report,
}

# https://mavlink.io/en/messages/common.html: the identities of MISSION_CURRENT are extension fields, which
# the checksum leaves out.
LAYOUTS: dict[int, tuple[struct.Struct, Any, tuple[int, ...]]] = {
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: (
        struct.Struct("<HHBBIII"),
        namedtuple(
            "MISSION_CURRENT", "seq total mission_state mission_mode mission_id fence_id rally_points_id"
        ),
        (),
    ),
}
