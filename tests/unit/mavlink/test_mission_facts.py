"""Traps of the mission protocol, home and terrain; each message is packed, split and decoded in both ways."""

import math
import struct
from typing import Any

import pytest
from fastcrc import crc16

from companion.mavlink.dialect import CRC_EXTRA, Encoder, mavlink
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
from companion.mavlink.framing import Frame, FrameSplitter, decode
from companion.mavlink.translate import frame_to_fact, to_fact

SENDER, TARGET = Sender(1, 1), Sender(7, 196)
ADDRESS = (TARGET.system_id, TARGET.component_id)


def frame_of(message: Any) -> Frame:
    (frame,) = FrameSplitter().feed(Encoder().encode(message, SENDER.system_id, SENDER.component_id))
    return frame


def fact_of(message: Any) -> Fact | None:
    frame = frame_of(message)
    fact = frame_to_fact(frame, 0.0)
    assert fact == to_fact(decode(frame), 0.0)
    return fact


def item(**changes: Any) -> MissionItem:
    fields: dict[str, Any] = {
        "target_system": 7, "target_component": 196, "seq": 3, "frame": 3, "command": 16, "current": 0,
        "autocontinue": 1, "param1": 1.5, "param2": math.nan, "param3": 0.0, "param4": math.inf,
        "x": 471_234_567, "y": -81_234_567, "z": 120.0, "mission_type": 1,
    }  # fmt: skip
    fact = fact_of(mavlink.MAVLink_mission_item_int_message(**{**fields, **changes}))
    assert isinstance(fact, MissionItem)
    return fact


def test_an_item_field_by_field() -> None:
    assert item() == MissionItem(
        SENDER, TARGET, 1, 3, 16, (1.5, None, 0.0, None), 47.1234567, -8.1234567, 120.0, HeightAbove.HOME
    )


@pytest.mark.parametrize(
    ("frame", "above"), [(0, "sea"), (5, "sea"), (3, "home"), (6, "home"), (10, "terrain"), (11, "terrain")]
)
def test_the_frame_gives_the_reference_of_heights(frame: int, above: str) -> None:
    assert item(frame=frame).height_above is HeightAbove(above)
    assert item(frame=frame).height_m == 120.0


@pytest.mark.parametrize("frame", [1, 2, 8, 99])
def test_items_in_other_frames_have_no_position(frame: int) -> None:
    fact = item(frame=frame)
    assert (fact.lat_deg, fact.lon_deg, fact.height_m) == (None, None, None)


def test_implausible_positions_and_heights_are_none() -> None:
    assert item(x=0, y=0).lat_deg is None
    assert item(x=2**31 - 1).lon_deg is None
    assert item(z=math.nan).height_m is None
    assert item(z=1e9).height_m is None


def test_counts_acks_and_other_messages() -> None:
    assert fact_of(mavlink.MAVLink_mission_count_message(*ADDRESS, 12, 1)) == MissionCount(
        SENDER, TARGET, 1, 12
    )
    assert fact_of(mavlink.MAVLink_mission_ack_message(*ADDRESS, 14, 0)) == MissionAck(SENDER, TARGET, 0, 14)
    for message in (
        mavlink.MAVLink_mission_request_message(*ADDRESS, 1, 1),
        mavlink.MAVLink_mission_request_int_message(*ADDRESS, 1, 1),
        mavlink.MAVLink_mission_request_list_message(*ADDRESS, 1),
        mavlink.MAVLink_mission_clear_all_message(*ADDRESS, 1),
        mavlink.MAVLink_mission_item_message(*ADDRESS, 1, 3, 16, 0, 1, 0, 0, 0, 0, 47.0, 8.0, 9.0, 1),
    ):
        assert fact_of(message) == OtherMissionMessage(SENDER, TARGET, 1)


def test_progress_with_and_without_a_total() -> None:
    assert fact_of(mavlink.MAVLink_mission_current_message(4, 9)) == MissionProgress(SENDER, 4, 9)
    for unknown in (0, 65535):
        assert fact_of(mavlink.MAVLink_mission_current_message(4, unknown)) == MissionProgress(SENDER, 4)


def test_the_ids_of_mission_and_fence_are_read_though_the_dialect_lacks_them() -> None:
    payload = struct.pack("<HHBBIB", 4, 9, 3, 1, 0x12345678, 0x21)
    header = bytes([len(payload), 0, 0, 0, 1, 1, 42, 0, 0])
    checksum = crc16.mcrf4xx(header + payload + bytes([CRC_EXTRA[42]]))
    (longer,) = FrameSplitter().feed(b"\xfd" + header + payload + struct.pack("<H", checksum))
    assert frame_to_fact(longer, 0.0) == MissionProgress(SENDER, 4, 9, 0x12345678, 0x21)


def test_fence_status_and_home() -> None:
    assert fact_of(mavlink.MAVLink_fence_status_message(1, 2, 3, 4)) == FenceStatus(SENDER, True)
    home = (471_234_567, 81_234_567, 512_300, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0)
    assert fact_of(mavlink.MAVLink_home_position_message(*home)) == HomePosition(
        SENDER, 47.1234567, 8.1234567, 512.3
    )
    assert fact_of(mavlink.MAVLink_home_position_message(0, 0, *home[2:])) is None


@pytest.mark.parametrize(
    "changes",
    [
        {"pending": 3},
        {"spacing": 0},
        {"terrain_height": math.nan},
        {"terrain_height": 12_000.0},
        {"current_height": math.inf},
        {"lat": 0, "lon": 0},
    ],
)
def test_unknown_terrain_gives_no_fact(changes: dict[str, Any]) -> None:
    fields: dict[str, Any] = {
        "lat": 470_000_000, "lon": 80_000_000, "spacing": 100, "terrain_height": 612.5,
        "current_height": 88.0, "pending": 0, "loaded": 224,
    }  # fmt: skip
    assert fact_of(mavlink.MAVLink_terrain_report_message(**fields)) == TerrainReport(
        SENDER, 47.0, 8.0, 612.5, 88.0
    )
    assert fact_of(mavlink.MAVLink_terrain_report_message(**{**fields, **changes})) is None
