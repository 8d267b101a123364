"""The mission protocol, and other messages about missions: fence status, home and terrain.

Traps: positions are degrees times 1e7 only in a global frame, a mission type that is not sent arrives as 0,
NaN means "not given", and terrain without data is reported as 0 m.
"""

import struct
from collections import namedtuple

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
    OtherMissionMessage,
    Sender,
    TerrainReport,
)
from companion.mavlink.translate.wire import UINT16_MAX, Layout, Translation, finite, position_deg, target_of

# From the shore of the Dead Sea to Mount Everest.
_MIN_TERRAIN_M, _MAX_TERRAIN_M = -500.0, 9_000.0
_MAX_HEIGHT_M = 40_000.0
_HEIGHTS_ABOVE = {
    mavlink.MAV_FRAME_GLOBAL: HeightAbove.SEA,
    mavlink.MAV_FRAME_GLOBAL_INT: HeightAbove.SEA,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT: HeightAbove.HOME,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: HeightAbove.HOME,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT: HeightAbove.TERRAIN,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT: HeightAbove.TERRAIN,
}


def _progress(message: Message, sender: Sender, _received_s: float) -> Fact:
    """The ids are newer than the dialect (see `LAYOUTS`); 0 means "not given" in all fields but `seq`."""
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
    position = None if above is None else position_deg(message.x, message.y)
    height_m = None if above is None else finite(message.z)
    if height_m is not None and abs(height_m) > _MAX_HEIGHT_M:
        height_m = None
    return MissionItem(
        sender=sender,
        target=target_of(message),
        mission_type=message.mission_type,
        sequence=message.seq,
        command=message.command,
        params=(
            finite(message.param1),
            finite(message.param2),
            finite(message.param3),
            finite(message.param4),
        ),
        lat_deg=None if position is None else position[0],
        lon_deg=None if position is None else position[1],
        height_m=height_m,
        height_above=above or HeightAbove.SEA,
    )


def _count(message: Message, sender: Sender, _received_s: float) -> Fact:
    return MissionCount(sender, target_of(message), message.mission_type, message.count)


def _ack(message: Message, sender: Sender, _received_s: float) -> Fact:
    return MissionAck(sender, target_of(message), message.mission_type, message.type)


def _other_message(message: Message, sender: Sender, _received_s: float) -> Fact:
    return OtherMissionMessage(sender, target_of(message), message.mission_type)


def _fence_status(message: Message, sender: Sender, _received_s: float) -> Fact:
    return FenceStatus(sender, bool(message.breach_status))


def _home_position(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    position = position_deg(message.latitude, message.longitude)
    return None if position is None else HomePosition(sender, *position, message.altitude / 1000.0)


def _terrain_report(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    """`spacing` is 0 without data for this position; `pending` counts blocks not loaded yet."""
    position = position_deg(message.lat, message.lon)
    terrain_m, height_m = message.terrain_height, message.current_height
    if position is None or message.pending or not message.spacing:
        return None
    if not _MIN_TERRAIN_M <= terrain_m <= _MAX_TERRAIN_M or not abs(height_m) <= _MAX_HEIGHT_M:
        return None
    return TerrainReport(sender, *position, terrain_m, height_m)


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: _progress,
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT: _count,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: _item,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK: _ack,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM: _other_message,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST: _other_message,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: _other_message,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: _other_message,
    mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: _other_message,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: _fence_status,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: _home_position,
    mavlink.MAVLINK_MSG_ID_TERRAIN_REPORT: _terrain_report,
}

# https://mavlink.io/en/messages/common.html: the ids in MISSION_CURRENT are extension fields, which the
# checksum does not include.
LAYOUTS: dict[int, Layout] = {
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: (
        struct.Struct("<HHBBIII"),
        namedtuple(
            "MISSION_CURRENT", "seq total mission_state mission_mode mission_id fence_id rally_points_id"
        ),
        (),
    ),
}
