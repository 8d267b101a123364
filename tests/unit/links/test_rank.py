"""The rank of a peer, by the heartbeats that it sends."""

import pytest

from companion.links.rank import Rank, rank_of
from companion.mavlink.dialect import Encoder, mavlink
from companion.mavlink.framing import Frame, FrameSplitter


def heartbeat(vehicle_type: int, autopilot: int) -> list[Frame]:
    message = mavlink.MAVLink_heartbeat_message(vehicle_type, autopilot, 81, 10, 4, 3)
    return FrameSplitter().feed_datagram(Encoder().encode(message, 7, 1))


@pytest.mark.parametrize(
    ("vehicle_type", "autopilot", "rank"),
    [
        (mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_PX4, Rank.VEHICLE),
        (mavlink.MAV_TYPE_VTOL_TILTROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, Rank.VEHICLE),
        (mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, Rank.VEHICLE),
        (mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_INVALID, Rank.OTHER),
        # An autopilot of these types is never adopted, so it needs no place as a vehicle either.
        (mavlink.MAV_TYPE_GENERIC, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, Rank.OTHER),
        (mavlink.MAV_TYPE_ANTENNA_TRACKER, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, Rank.OTHER),
        (mavlink.MAV_TYPE_GPS, mavlink.MAV_AUTOPILOT_GENERIC, Rank.OTHER),
    ],
)
def test_only_what_may_be_a_vehicle_ranks_as_one(vehicle_type: int, autopilot: int, rank: Rank) -> None:
    frames = heartbeat(vehicle_type, autopilot)
    assert rank_of(frames, None) is rank
    assert rank_of(frames, (7, 1)) is Rank.OURS
    assert rank_of([], None) is Rank.SILENT
