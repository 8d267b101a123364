"""The fake ArduPlane's telemetry against recordings of the real one: content, rates and addresses."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import FrameSplitter, decode
from sim.vehicle import Mode
from tests.support.arduplane_bench import (
    HOME,
    START_S,
    airborne,
    on_ground,
)
from tests.support.paths import TLOGS
from tests.support.vehicle_bench import (
    ACCEPTED,
    CHANGE_ALTITUDE,
    DENIED,
    FAILED,
    GCS,
    SET_INTERVAL,
    SET_MODE,
    UNSUPPORTED,
)

# Fields that never change, as a real ArduPlane sends them in AUTO: the last of each in this recorded flight.
CONSTANT: dict[str, dict[str, float]] = {
    "HEARTBEAT": {
        "type": 1, "autopilot": 3, "base_mode": 217, "custom_mode": 10, "system_status": 4,
        "mavlink_version": 3,
    },
    "POSITION_TARGET_GLOBAL_INT": {
        "coordinate_frame": 0, "type_mask": 65016, "vx": 0.0, "afx": 0.0, "yaw": 0.0,
    },
    "MISSION_CURRENT": {"mission_state": 3, "mission_mode": 1},
    "SYS_STATUS": {
        "onboard_control_sensors_present": 325188671, "onboard_control_sensors_health": 322042943,
    },
    "GPS_RAW_INT": {"fix_type": 6, "satellites_visible": 10, "eph": 121, "epv": 200},
    "BATTERY_STATUS": {"id": 0, "temperature": 32767, "charge_state": 1},
    "HOME_POSITION": {"approach_x": 0.0},
}  # fmt: skip
RECORDED = "arduplane_sitl_adsb_two_intruders"

# --- content ---


def test_heartbeat_once_a_second_on_every_channel_with_the_recorded_modes() -> None:
    bench = on_ground(channels=(0, 1))
    bench.fly(10.0)
    assert len(bench.messages("HEARTBEAT", 0)) == len(bench.messages("HEARTBEAT", 1)) == 10
    bench.vehicle.set_mode(Mode.AUTO)
    bench.fly(1.0)
    bench.vehicle.arm()
    bench.fly(20.0)
    received = [
        (m.type, m.autopilot, m.base_mode, m.custom_mode, m.system_status)
        for m in bench.messages("HEARTBEAT")
    ]
    assert received[0] == (1, 3, 81, 0, 3)
    assert (1, 3, 89, 10, 3) in received
    assert received[-1] == (1, 3, 217, 10, 4)


def test_every_message_can_be_packed_and_carries_the_true_state() -> None:
    bench = airborne(rate_hz=2.0, wind_mps=(2.0, -1.0))
    bench.guided()
    bench.by_int(CHANGE_ALTITUDE, frame=3, place=(0, 0, 400.0))
    bench.fly(15.0)
    encoder, splitter = Encoder(), FrameSplitter()
    decoded: dict[str, Any] = {}
    for _, message in bench.received:
        assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 1)
        (frame,) = splitter.feed_datagram(encoder.encode(message, 1, 1))
        decoded[message.get_type()] = decode(frame)
    truth = bench.vehicle.truth
    position = decoded["GLOBAL_POSITION_INT"]
    assert position.lat / 1e7 == pytest.approx(truth.place.lat_deg, abs=1e-6)
    assert position.alt / 1e3 == pytest.approx(truth.place.altitude_m, abs=0.1)
    assert position.relative_alt == position.alt - 584_100
    climb_mps = -truth.velocity_mps[2]
    assert climb_mps > 3.0
    assert position.vz / 100.0 == pytest.approx(-climb_mps, abs=0.1)  # down is positive
    assert decoded["VFR_HUD"].climb == pytest.approx(climb_mps, abs=0.1)  # up is positive
    assert position.hdg / 100.0 == pytest.approx(math.degrees(truth.heading_rad), abs=1.0)
    assert decoded["ATTITUDE"].roll == pytest.approx(truth.bank_rad, abs=0.02)
    assert decoded["WIND"].direction == pytest.approx(math.degrees(math.atan2(1.0, -2.0)))  # comes from
    assert decoded["WIND"].speed == pytest.approx(math.hypot(2.0, 1.0))
    assert decoded["POSITION_TARGET_GLOBAL_INT"].alt == pytest.approx(984.1, abs=0.01)
    assert decoded["LOCAL_POSITION_NED"].z == pytest.approx(HOME.altitude_m + truth.position_m[2], abs=0.1)
    assert decoded["SYSTEM_TIME"].time_unix_usec == pytest.approx(truth.time_s * 1e6, abs=1e6)
    assert 0 < decoded["BATTERY_STATUS"].battery_remaining <= 100


def fly_level() -> dict[str, Message]:
    """The last message of each kind of the fake, level to the north in AUTO."""
    bench = airborne(rate_hz=2.0)
    bench.by_long(512, mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    bench.fly(2.0)
    return {message.get_type(): message for _, message in bench.received}


def recorded() -> dict[str, Message]:
    """The last message of each kind of the recorded flight, level to the north in AUTO."""
    messages = map(decode, FrameSplitter().feed(TLOGS[RECORDED].read_bytes()))
    return {message.get_type(): message for message in messages if message is not None}


@pytest.mark.parametrize("said", [fly_level, *([recorded] if RECORDED in TLOGS else [])])
def test_fields_that_never_change_are_those_of_the_recorded_flight(
    said: Callable[[], dict[str, Message]],
) -> None:
    messages = said()
    for kind, fields in CONSTANT.items():
        assert {name: getattr(messages[kind], name) for name in fields} == fields, kind
    assert all(math.isnan(q) for q in messages["HOME_POSITION"].q)
    # Both fly level to the north, so signs and sizes show the meaning of the fields.
    assert abs(messages["ATTITUDE"].yaw) < 0.1
    assert abs(messages["VFR_HUD"].airspeed - 22.0) < 0.5
    assert abs(messages["GLOBAL_POSITION_INT"].relative_alt - 300_000) < 1000


def test_message_intervals_belong_to_the_channel() -> None:
    bench = on_ground(channels=(0, 1))
    assert bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 100_000, channel=1) == ACCEPTED
    bench.fly(10.0)
    assert len(bench.messages("ATTITUDE", 0)) == 0
    assert len(bench.messages("ATTITUDE", 1)) == 100
    assert bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, -1, channel=1) == ACCEPTED
    bench.fly(10.0)
    assert len(bench.messages("ATTITUDE", 1)) == 100


def test_an_interval_for_an_unknown_message_is_denied_with_a_text() -> None:
    bench = on_ground()
    assert bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_COLLISION, 1_000_000) == DENIED
    assert "No ap_message for mavlink id (247)" in bench.texts()


def test_data_streams_set_a_group_at_once() -> None:
    bench = on_ground()
    group = mavlink.MAV_DATA_STREAM_POSITION
    bench.send(mavlink.MAVLink_request_data_stream_message(1, 1, group, 5, 1))
    bench.fly(4.0)
    assert len(bench.messages("GLOBAL_POSITION_INT")) == len(bench.messages("LOCAL_POSITION_NED")) == 20
    bench.send(mavlink.MAVLink_request_data_stream_message(1, 1, group, 5, 0))
    bench.fly(4.0)
    assert len(bench.messages("GLOBAL_POSITION_INT")) == 20


def test_a_message_on_request() -> None:
    bench = on_ground()
    assert bench.by_long(512, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == ACCEPTED
    (version,) = bench.messages("AUTOPILOT_VERSION")
    assert version.flight_sw_version >> 16 == 0x0407
    assert bench.by_long(512, 9999) == FAILED


def test_timesync_and_ping_are_answered() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_timesync_message(tc1=0, ts1=123))
    (answer,) = bench.messages("TIMESYNC")
    assert answer.ts1 == 123
    assert answer.tc1 > 0
    bench.send(mavlink.MAVLink_ping_message(5, 7, 0, 0))
    (pong,) = bench.messages("PING")
    assert (pong.seq, pong.target_system, pong.target_component) == (7, *GCS)


# --- addresses ---


@pytest.mark.parametrize(
    ("target", "answered"),
    [((1, 1), True), ((1, 0), True), ((0, 0), True), ((2, 1), False), ((1, 191), False), ((255, 0), False)],
)
def test_only_messages_to_its_own_addresses_are_handled(target: tuple[int, int], answered: bool) -> None:
    bench = airborne()
    assert (bench.by_long(SET_MODE, 1, Mode.LOITER, target=target) == ACCEPTED) is answered
    assert (bench.vehicle.truth.mode == "LOITER") is answered


def test_the_answer_goes_to_the_channel_of_the_request() -> None:
    bench = airborne(channels=(0, 1))
    assert bench.by_long(SET_MODE, 1, Mode.LOITER, channel=1) == ACCEPTED
    assert bench.messages("COMMAND_ACK", 0) == []


def test_unknown_commands_are_unsupported() -> None:
    assert airborne().by_long(31_000, 1.0) == UNSUPPORTED


# --- time ---


def test_the_rhythm_of_stepping_has_no_effect() -> None:
    often, seldom = airborne(rate_hz=2.0), airborne(rate_hz=2.0)
    for step in range(1, 15_001):
        often.received += often.vehicle.step(START_S + step * 0.01)
    for step in range(1, 31):
        seldom.received += seldom.vehicle.step(START_S + step * 5.0)
    assert often.vehicle.truth == seldom.vehicle.truth
    assert [str(m) for _, m in often.received] == [str(m) for _, m in seldom.received]
