"""The fake PX4 outside OFFBOARD: telemetry, modes, commands, mission, parameters, traffic."""

import math
import struct
from typing import Any

import pytest

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.framing import FrameSplitter, decode
from sim.vehicle import Px4Mode
from tests.support.px4_bench import FRAME, HOME, MISSION, Px4Bench, airborne, on_ground, waypoint
from tests.support.vehicle_bench import (
    ACCEPTED,
    ARM,
    DENIED,
    FAILED,
    GCS,
    REJECTED,
    REPOSITION,
    REQUEST_MESSAGE,
    SET_INTERVAL,
    SET_MODE,
    UNSUPPORTED,
)

INT32, REAL32 = 6, 9


# --- telemetry ---


def test_every_message_can_be_packed_and_carries_the_true_state() -> None:
    bench = airborne(quiet=False, wind_mps=(2.0, -1.0))
    bench.engage()
    bench.stream(5.0, course_deg=60.0, height_m=150.0)
    encoder, splitter = Encoder(), FrameSplitter()
    decoded: dict[str, Any] = {}
    for _, message in bench.received:
        assert (message.get_srcSystem(), message.get_srcComponent()) == (1, 1)
        (frame,) = splitter.feed_datagram(encoder.encode(message, 1, 1))
        decoded[message.get_type()] = decode(frame)
    truth = bench.vehicle.truth
    position = decoded["GLOBAL_POSITION_INT"]
    assert position.lat / 1e7 == pytest.approx(truth.place.lat_deg, abs=1e-6)
    assert position.vz / 100.0 == pytest.approx(-3.0, abs=0.1)
    assert (decoded["WIND_COV"].wind_x, decoded["WIND_COV"].wind_y) == (2.0, -1.0)
    assert decoded["POSITION_TARGET_GLOBAL_INT"].alt == pytest.approx(HOME.altitude_m + 150.0, abs=0.1)
    w, x, y, z = decoded["ATTITUDE_TARGET"].q
    roll_rad = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    assert roll_rad == pytest.approx(truth.bank_rad, abs=0.05)
    assert decoded["EXTENDED_SYS_STATE"].landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
    assert decoded["HOME_POSITION"].altitude == round(HOME.altitude_m * 1000)
    assert decoded["RC_CHANNELS"].chan1_raw == 1500
    assert {"SYS_STATUS", "SCALED_PRESSURE", "GPS_RAW_INT", "VFR_HUD", "MISSION_CURRENT"} <= set(decoded)
    assert "WIND" not in decoded


def test_heartbeats_of_the_modes() -> None:
    bench = airborne()
    for mode, base_mode in ((Px4Mode.HOLD, 128 + 29), (Px4Mode.POSCTL, 128 + 81), (Px4Mode.MANUAL, 128 + 65)):
        bench.received.clear()
        bench.vehicle.set_mode(mode)
        bench.fly(0.3)
        (received,) = bench.messages("HEARTBEAT")
        assert (received.custom_mode, received.base_mode, received.system_status) == (mode, base_mode, 4)
        bench.fly(1.0)


def test_the_version_and_unknown_messages() -> None:
    bench = on_ground()
    assert bench.by_long(REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == ACCEPTED
    (version,) = bench.messages("AUTOPILOT_VERSION")
    assert version.flight_sw_version >> 16 == 0x0110
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    assert bench.by_long(REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_WIND) == FAILED
    assert bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_COLLISION, 1e6) == FAILED
    assert bench.texts() == []


# --- modes and commands ---


@pytest.mark.parametrize("mode", [m for m in Px4Mode if m not in (Px4Mode.OFFBOARD, Px4Mode.LAND)])
def test_every_mode_keeps_flying(mode: Px4Mode) -> None:
    bench = airborne(firmware="1.18")
    assert bench.request_mode(mode) == ACCEPTED
    bench.fly(60.0)
    truth = bench.vehicle.truth
    assert not truth.on_ground
    assert truth.mode == ("HOLD" if mode is Px4Mode.TAKEOFF else mode.name)
    assert truth.airspeed_mps == pytest.approx(14.0, abs=0.5)
    assert bench.height_m() == pytest.approx(100.0, abs=1.0)


@pytest.mark.parametrize("params", [(0.0, 4.0, 3.0), (1.0, 9.0, 0.0), (1.0, 4.0, 99.0), (1.0, math.nan, 0.0)])
def test_unknown_modes_change_nothing(params: tuple[float, float, float]) -> None:
    answers = {(1.0, 9.0, 0.0): (ACCEPTED, REJECTED), (1.0, 4.0, 99.0): (REJECTED, REJECTED)}
    for bench, answer in zip(
        (airborne(), airborne(firmware="1.18")), answers.get(params, (DENIED, DENIED)), strict=True
    ):
        assert bench.by_long(SET_MODE, *params) == answer
        assert bench.mode() == "MISSION"


def test_mode_by_set_mode_message() -> None:
    bench = airborne()
    bench.send(mavlink.MAVLink_set_mode_message(1, 1, int(Px4Mode.RETURN)))
    assert bench.mode() == "RETURN"
    assert [(a.command, a.result) for a in bench.messages("COMMAND_ACK")] == [(SET_MODE, ACCEPTED)]


def test_mission_mode_needs_a_mission() -> None:
    bench = airborne(mission=[waypoint(1000.0, 0.0), waypoint(2000.0, 0.0)])
    bench.send(mavlink.MAVLink_mission_clear_all_message(1, 1))
    assert bench.mode() == "HOLD"
    assert bench.request_mode(Px4Mode.MISSION) == REJECTED


def test_landing_ends_on_the_ground_and_disarmed() -> None:
    bench = airborne(height_m=20.0)
    assert bench.by_long(21) == ACCEPTED
    bench.fly(60.0)
    assert bench.vehicle.truth.on_ground
    assert not bench.vehicle.truth.armed
    assert not bench.vehicle.truth.mission_completed


def test_take_off_by_its_mode_ends_in_a_loiter() -> None:
    bench = on_ground()
    assert bench.by_long(ARM, 1.0) == ACCEPTED
    assert bench.by_long(22) == ACCEPTED
    bench.fly(2.0)
    assert bench.mode() == "TAKEOFF"
    bench.fly(30.0)
    assert bench.mode() == "HOLD"
    assert bench.height_m() == pytest.approx(30.0, abs=5.0)


def test_take_off_and_mission_to_its_end() -> None:
    bench = on_ground(parameters={"FW_AIRSPD_TRIM": 20.0})
    bench.vehicle.start_mission()
    bench.vehicle.arm()
    bench.fly(20.0)
    assert bench.vehicle.truth.mission_sequence == 1
    bench.fly(480.0)
    truth = bench.vehicle.truth
    assert truth.mission_completed
    assert truth.mode == "MISSION"
    assert math.dist(truth.position_m[:2], (4000.0, 3000.0)) == pytest.approx(80.0, abs=25.0)
    assert [m.seq for m in bench.messages("MISSION_ITEM_REACHED")] == [0, 1, 2]
    assert bench.texts().count("Mission finished, loitering") == 1


def test_reposition_holds_there_at_a_height_above_sea_level_in_any_frame() -> None:
    bench = airborne()
    place = FRAME.to_geo(800.0, 800.0, 0.0)
    target = (round(place.lat_deg * 1e7), round(place.lon_deg * 1e7), HOME.altitude_m + 120.0)
    assert bench.by_int(REPOSITION, -1, 0, 30, math.nan, frame=6, place=target) == UNSUPPORTED
    assert bench.mode() == "MISSION"
    assert bench.by_int(REPOSITION, -1, 1, 30, math.nan, frame=6, place=target) == ACCEPTED
    assert bench.mode() == "HOLD"
    bench.fly(150.0)
    assert math.dist(bench.vehicle.truth.position_m[:2], (800.0, 800.0)) == pytest.approx(80.0, abs=20.0)
    assert bench.height_m() == pytest.approx(120.0, abs=1.0)


def test_change_speed_is_flown_outside_offboard() -> None:
    bench = airborne()
    assert bench.by_long(178, 0, 18.0, -1) == ACCEPTED
    bench.fly(10.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(15.2, abs=0.2)  # 1 m/s in 8 s, as flown
    bench.fly(80.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(18.0, abs=0.2)


# --- the mission resumed ---


def test_the_mission_resumes_at_the_same_item_straight() -> None:
    bench = airborne()
    bench.engage()
    bench.stream(20.0, course_deg=60.0)
    bench.release()
    assert bench.vehicle.truth.mission_sequence == 1
    start_n, start_e, _ = bench.vehicle.truth.position_m
    bench.fly(40.0)
    north_m, east_m, _ = bench.vehicle.truth.position_m
    line_rad = math.atan2(-start_e, 4000.0 - start_n)
    aside_m = (east_m - start_e) * math.cos(line_rad) - (north_m - start_n) * math.sin(line_rad)
    assert abs(aside_m) < 25.0


def test_it_climbs_in_a_loiter_first_if_it_is_far_below_the_item() -> None:
    bench = airborne(mission=[MISSION[0], waypoint(4000.0, 0.0, 160.0)])
    bench.request_mode(Px4Mode.HOLD)
    bench.fly(5.0)
    here_m = bench.vehicle.truth.position_m
    bench.request_mode(Px4Mode.MISSION)
    farthest_m = 0.0
    while bench.height_m() < 145.0:
        bench.fly(1.0)
        farthest_m = max(farthest_m, math.dist(bench.vehicle.truth.position_m[:2], here_m[:2]))
    assert farthest_m < 250.0
    bench.fly(60.0)
    assert bench.vehicle.truth.position_m[0] > 600.0


def test_items_are_requested_as_integers_and_counted_from_zero() -> None:
    bench = on_ground()
    items = [MISSION[0], waypoint(500.0, 0.0)]
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    for sequence, item in enumerate(items):
        assert bench.messages("MISSION_REQUEST_INT")[-1].seq == sequence
        bench.send(
            mavlink.MAVLink_mission_item_int_message(
                1, 1, sequence, item.frame, item.command, 0, 1, *item.params,
                item.lat_e7, item.lon_e7, item.altitude_m,
            )
        )  # fmt: skip
    assert bench.messages("MISSION_ACK")[-1].type == mavlink.MAV_MISSION_ACCEPTED
    assert bench.vehicle.flight.mission.items == items
    bench.vehicle.add_channel(0, stream_rate_hz=1.0)
    bench.fly(2.0)
    received = bench.messages("MISSION_CURRENT")[-1]
    assert (received.seq, received.total) == (0, 2)


# --- parameters ---


def as_float(value: int) -> float:
    return float(struct.unpack("<f", struct.pack("<i", value))[0])


def as_int(value: float) -> int:
    return int(struct.unpack("<i", struct.pack("<f", value))[0])


def test_integers_are_encoded_as_bytes() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_param_request_read_message(1, 1, b"SYS_AUTOSTART", -1))
    (received,) = bench.messages("PARAM_VALUE")
    assert (received.param_type, as_int(received.param_value)) == (INT32, 2100)
    bench.set_parameter(b"COM_OBL_RC_ACT", as_float(5), INT32)
    assert bench.vehicle.parameters["COM_OBL_RC_ACT"] == 5.0
    assert as_int(bench.messages("PARAM_VALUE")[-1].param_value) == 5


@pytest.mark.parametrize(("value", "kind"), [(5.0, REAL32), (as_float(5), 2)])
def test_an_integer_with_another_type_is_refused(value: float, kind: int) -> None:
    bench = on_ground()
    bench.set_parameter(b"COM_OBL_RC_ACT", value, kind)
    assert bench.vehicle.parameters["COM_OBL_RC_ACT"] == 0.0
    assert as_int(bench.messages("PARAM_VALUE")[-1].param_value) == 0


def test_the_list_has_the_envelope_parameters() -> None:
    bench = on_ground()
    bench.send(mavlink.MAVLink_param_request_list_message(1, 1))
    received = bench.messages("PARAM_VALUE")
    assert [m.param_index for m in received] == list(range(len(received)))
    assert len(received) >= 30
    assert {
        "FW_AIRSPD_MIN", "FW_AIRSPD_TRIM", "FW_AIRSPD_MAX", "FW_R_LIM", "FW_T_CLMB_MAX", "FW_T_SINK_MAX",
        "NAV_LOITER_RAD", "NAV_TRAFF_AVOID", "COM_OF_LOSS_T", "COM_OBL_RC_ACT", "MIS_TAKEOFF_ALT",
    } <= {m.param_id for m in received}  # fmt: skip


# --- traffic ---


def report(north_m: float = 3000.0, height_m: float = 300.0) -> Message:
    place = FRAME.to_geo(north_m, 0.0, -(HOME.altitude_m + height_m))
    return mavlink.MAVLink_adsb_vehicle_message(
        0xA00001, round(place.lat_deg * 1e7), round(place.lon_deg * 1e7), 1, round(place.altitude_m * 1e3),
        18_000, 6000, 0, b"T000", 1, 0, 415, 1200,
    )  # fmt: skip


def test_traffic_is_forwarded_once_and_echoed_to_its_sender() -> None:
    bench = Px4Bench(airborne().vehicle, channels=(0, 1))
    bench.send(report(), (1, 156), channel=1)
    bench.fly(2.0)
    for channel in (0, 1):
        (received,) = bench.messages("ADSB_VEHICLE", channel)
        assert (received.get_srcSystem(), received.get_srcComponent()) == (1, 1)
        assert received.to_dict() == report().to_dict()


def test_traffic_follows_an_interval_and_can_be_stopped() -> None:
    bench = airborne()
    bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, 1_000_000)
    bench.send(report(), (1, 156))
    bench.fly(0.5)
    assert bench.messages("ADSB_VEHICLE") == []
    bench.fly(0.6)
    assert len(bench.messages("ADSB_VEHICLE")) == 1
    bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE, -1)
    bench.send(report(), (1, 156))
    bench.fly(3.0)
    assert len(bench.messages("ADSB_VEHICLE")) == 1


@pytest.mark.parametrize(("action", "mode"), [(0, "OFFBOARD"), (1, "OFFBOARD"), (2, "RETURN"), (4, "HOLD")])
def test_its_own_traffic_action_ends_offboard(action: int, mode: str) -> None:
    bench = airborne(parameters={"NAV_TRAFF_AVOID": action})
    bench.engage()
    bench.send(report(north_m=400.0, height_m=110.0), (1, 156))
    bench.stream(1.0)
    assert bench.mode() == mode
    assert bench.texts() == (["Traffic alert"] if action else [])


def test_only_its_own_addresses_are_handled_and_the_sender_is_answered() -> None:
    bench = airborne()
    assert bench.by_long(SET_MODE, 1, 4, 3, target=(2, 1)) == -1
    assert bench.by_long(SET_MODE, 1, 4, 3) == ACCEPTED
    answer = bench.messages("COMMAND_ACK")[-1]
    assert (answer.target_system, answer.target_component) == GCS


def test_the_rhythm_of_stepping_has_no_effect() -> None:
    often, seldom = airborne(quiet=False), airborne(quiet=False)
    for step in range(1, 3001):
        often.received += often.vehicle.step(1_800_000_000.0 + step * 0.01)
    seldom.fly(30.0)
    assert often.vehicle.truth == seldom.vehicle.truth
    assert [str(m) for _, m in often.received] == [str(m) for _, m in seldom.received]
