"""Faults of both fake vehicles: fences, reboots, failsafes, sticks, unanswered commands."""

from collections.abc import Callable
from typing import Any

import pytest

from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from sim.vehicle import FakeArduPlane, FakePx4, FakeVehicle, Mode, Px4Mode
from tests.support import arduplane_bench, px4_bench
from tests.support.autopilots import MISSION_MODE, both
from tests.support.vehicle_bench import (
    ACCEPTED,
    DENIED,
    SET_INTERVAL,
    SET_MODE,
    Bench,
)

FENCE = mavlink.MAV_MISSION_TYPE_FENCE
RETURN_POINT, INCLUSION, EXCLUSION, CIRCLE_IN, CIRCLE_OUT = range(5000, 5005)

AIRBORNE: dict[str, Callable[..., Bench]] = {
    "ardupilot": arduplane_bench.airborne,
    "px4": px4_bench.airborne,
}
LOITER = {"ardupilot": (Mode.LOITER,), "px4": (4, 3)}
FENCE_ON: dict[str, dict[str, float]] = {"ardupilot": {"FENCE_ENABLE": 1}, "px4": {"GF_ACTION": 3}}
FENCE_OFF: dict[str, dict[str, float]] = {"ardupilot": {"FENCE_ENABLE": 0}, "px4": {"GF_ACTION": 0}}
HOMEWARD = {"ardupilot": "RTL", "px4": "RETURN"}


def place(bench: Bench, north_m: float, east_m: float) -> GeoPoint:
    return bench.vehicle.flight.frame.to_geo(north_m, east_m, 0.0)


def upload(bench: Bench, items: list[tuple[int, float, float, float]]) -> int:
    """Upload items of command, first parameter, north and east from home; the MISSION_ACK result."""
    bench.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), FENCE))
    for sequence, (command, value, north_m, east_m) in enumerate(items):
        there = place(bench, north_m, east_m)
        bench.send(
            mavlink.MAVLink_mission_item_int_message(
                1, 1, sequence, 0, command, 0, 1, value, 0.0, 0.0, 0.0,
                round(there.lat_deg * 1e7), round(there.lon_deg * 1e7), 0.0, FENCE,
            )
        )  # fmt: skip
    return int(bench.messages("MISSION_ACK")[-1].type)


def square(command: int, half_m: float, north_m: float = 0.0) -> list[tuple[int, float, float, float]]:
    corners = ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0))
    return [(command, 4.0, north_m + half_m * n, half_m * e) for n, e in corners]


# --- fences ---


@both
def test_a_fence_is_uploaded_downloaded_and_cleared(autopilot: str) -> None:
    bench = AIRBORNE[autopilot]()
    mission = list(bench.vehicle.flight.mission.items)
    items = [(RETURN_POINT, 0.0, 0.0, 0.0), *square(INCLUSION, 3000.0), (CIRCLE_OUT, 150.0, 900.0, 900.0)]
    assert upload(bench, items) == mavlink.MAV_MISSION_ACCEPTED
    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1, FENCE))
    assert bench.messages("MISSION_COUNT")[-1].count == 6
    for sequence in range(6):
        bench.send(mavlink.MAVLink_mission_request_int_message(1, 1, sequence, FENCE))
    received = bench.messages("MISSION_ITEM_INT")
    assert [(m.command, m.param1, m.mission_type) for m in received] == [(i[0], i[1], FENCE) for i in items]
    assert [m.x for m in received] == [round(place(bench, i[2], i[3]).lat_deg * 1e7) for i in items]
    bench.send(mavlink.MAVLink_mission_clear_all_message(1, 1, FENCE))
    bench.send(mavlink.MAVLink_mission_request_list_message(1, 1, FENCE))
    assert bench.messages("MISSION_COUNT")[-1].count == 0
    assert bench.vehicle.flight.mission.items == mission


@both
@pytest.mark.parametrize(
    ("items", "result"),
    [
        (square(INCLUSION, 500.0)[:3], mavlink.MAV_MISSION_INVALID),  # four announced, three sent
        ([(EXCLUSION, 2.0, 0.0, 0.0), (EXCLUSION, 2.0, 9.0, 0.0)], mavlink.MAV_MISSION_INVALID),
        ([(CIRCLE_IN, 0.0, 0.0, 0.0)], mavlink.MAV_MISSION_INVALID),
        ([(16, 0.0, 0.0, 0.0)], mavlink.MAV_MISSION_UNSUPPORTED),
    ],
)
def test_incomplete_fences_are_refused(autopilot: str, items: Any, result: int) -> None:
    bench = AIRBORNE[autopilot]()
    assert upload(bench, square(INCLUSION, 3000.0)) == mavlink.MAV_MISSION_ACCEPTED
    assert upload(bench, items) == result
    assert len(bench.vehicle.flight.fence.items) == 4


@both
@pytest.mark.parametrize(
    "items",
    [
        square(INCLUSION, 300.0),
        [(CIRCLE_IN, 300.0, 0.0, 0.0)],
        square(EXCLUSION, 100.0, 400.0),
        [(CIRCLE_OUT, 100.0, 400.0, 0.0)],
    ],
)
def test_a_fence_breach_returns_the_aircraft_home(autopilot: str, items: Any) -> None:
    bench = AIRBORNE[autopilot](parameters=FENCE_ON[autopilot])
    assert upload(bench, items) == mavlink.MAV_MISSION_ACCEPTED
    while bench.vehicle.truth.position_m[0] < 290.0:
        bench.fly(0.5)
        assert bench.vehicle.truth.mode == MISSION_MODE[autopilot]
    bench.fly(3.0)
    assert bench.vehicle.truth.mode == HOMEWARD[autopilot]
    assert len(bench.texts()) >= 1


@both
def test_a_disabled_fence_has_no_effect(autopilot: str) -> None:
    bench = AIRBORNE[autopilot](parameters=FENCE_OFF[autopilot])
    upload(bench, square(INCLUSION, 100.0))
    bench.fly(20.0)
    assert bench.vehicle.truth.mode == MISSION_MODE[autopilot]


def test_arduplane_reports_a_breach_without_an_action() -> None:
    bench = arduplane_bench.airborne(parameters={"FENCE_ENABLE": 1, "FENCE_ACTION": 0})
    upload(bench, square(EXCLUSION, 100.0, 400.0))
    assert bench.messages("PARAM_VALUE")[-1].param_id == "FENCE_TOTAL"
    bench.fly(40.0)
    received = bench.messages("FENCE_STATUS")
    assert [(m.breach_status, m.breach_count, m.breach_type) for m in received] == [(1, 1, 3), (0, 1, 0)]
    assert bench.vehicle.truth.mode == "AUTO"


# --- faults ---


@both
def test_a_reboot_in_flight_resets_streams_and_boot_time_only(autopilot: str) -> None:
    bench = AIRBORNE[autopilot]()
    attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE
    bench.by_long(SET_INTERVAL, attitude, 100_000)
    bench.fly(5.0)
    before = bench.vehicle.truth
    assert bench.messages("ATTITUDE")[-1].time_boot_ms > 30_000
    bench.vehicle.reboot(bench.vehicle.time_s)
    assert bench.vehicle.boots == 2
    bench.received.clear()
    bench.fly(5.0)
    assert bench.messages("ATTITUDE") == []
    bench.by_long(512, attitude)
    assert bench.messages("ATTITUDE")[-1].time_boot_ms == pytest.approx(5000, abs=100)
    truth = bench.vehicle.truth
    assert (truth.armed, truth.mode) == (True, MISSION_MODE[autopilot])
    assert truth.position_m[0] > before.position_m[0] + 50.0


def test_a_reboot_ends_the_commands_of_a_companion() -> None:
    plane = arduplane_bench.airborne()
    plane.guided()
    plane.by_int(43002, 0, 90.0, 5.0)
    plane.fly(20.0)
    here_m = plane.vehicle.truth.position_m
    plane.vehicle.reboot(plane.vehicle.time_s)
    plane.fly(60.0)
    assert abs(plane.vehicle.truth.position_m[1] - here_m[1]) < 150.0
    px4 = px4_bench.airborne()
    px4.engage()
    px4.vehicle.reboot(px4.vehicle.time_s)
    px4.fly(0.1)
    assert px4.mode() == "POSCTL"


@both
def test_a_failsafe_is_critical_and_may_return_home(autopilot: str) -> None:
    bench = AIRBORNE[autopilot]()
    bench.vehicle.fail_safe(True)
    bench.fly(1.0)
    assert bench.messages("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_CRITICAL
    assert bench.vehicle.truth.mode == MISSION_MODE[autopilot]
    bench.vehicle.fail_safe(True, return_home=True)
    assert bench.vehicle.truth.mode == HOMEWARD[autopilot]
    bench.vehicle.fail_safe(False)
    bench.fly(1.1)
    assert bench.messages("HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_ACTIVE


@both
def test_sticks_are_reported_and_flown_in_the_piloted_modes(autopilot: str) -> None:
    bench = AIRBORNE[autopilot]()
    bench.vehicle.move_sticks(roll=0.5, throttle=1.0)
    bench.by_long(SET_INTERVAL, mavlink.MAVLINK_MSG_ID_RC_CHANNELS, 500_000)
    bench.fly(1.0)
    received = bench.messages("RC_CHANNELS")[-1]
    assert (received.chan1_raw, received.chan2_raw, received.chan3_raw, received.chancount) == (
        1700,
        1500,
        1900,
        8,
    )
    assert abs(bench.vehicle.truth.bank_rad) < 0.05
    bench.vehicle.set_mode("MANUAL")
    bench.fly(5.0)
    assert bench.vehicle.truth.bank_rad > 0.3


@both
def test_a_command_is_refused_until_the_fault_ends(autopilot: str) -> None:
    bench = AIRBORNE[autopilot]()
    bench.vehicle.refuse(SET_MODE, DENIED)
    assert bench.by_long(SET_MODE, 1, *LOITER[autopilot]) == DENIED
    assert bench.vehicle.truth.mode == MISSION_MODE[autopilot]
    bench.vehicle.refuse(SET_MODE, None)
    assert bench.by_long(SET_MODE, 1, *LOITER[autopilot]) == ACCEPTED


@both
@pytest.mark.parametrize("does", [True, False])
def test_a_silenced_command_is_not_acknowledged_but_may_be_executed(autopilot: str, does: bool) -> None:
    bench = AIRBORNE[autopilot]()
    bench.vehicle.silence(SET_MODE, does=does)
    assert bench.by_long(SET_MODE, 1, *LOITER[autopilot]) == -1
    assert (bench.vehicle.truth.mode == MISSION_MODE[autopilot]) is not does
    bench.vehicle.silence(SET_MODE, does=None)
    assert bench.by_long(SET_MODE, 1, *LOITER[autopilot]) == ACCEPTED


@pytest.mark.parametrize("kind", [FakeArduPlane, FakePx4])
def test_modes_by_name(kind: type[FakeVehicle]) -> None:
    name = "ardupilot" if kind is FakeArduPlane else "px4"
    vehicle = AIRBORNE[name]().vehicle
    vehicle.set_mode("MANUAL")
    assert vehicle.truth.mode == "MANUAL"
    with pytest.raises(ValueError, match="no mode 'FLYING'"):
        vehicle.set_mode("FLYING")
    assert Px4Mode.MANUAL.name == Mode.MANUAL.name


def test_the_geoid_height_shifts_the_ellipsoid_altitude() -> None:
    bench = arduplane_bench.airborne(geoid_height_m=19.5)
    bench.by_long(512, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)
    received = bench.messages("GPS_RAW_INT")[-1]
    assert received.alt_ellipsoid - received.alt == pytest.approx(19_500, abs=1)


# --- an older ArduPlane, and its own avoidance ---


def test_the_names_of_4_3_have_the_same_effect() -> None:
    old = arduplane_bench.airborne(firmware="4.3")
    names = {p.name: p.value for p in old.vehicle.parameters}
    assert (names["ARSPD_FBW_MIN"], names["ARSPD_FBW_MAX"]) == (10.0, 30.0)
    assert (names["TRIM_ARSPD_CM"], names["LIM_ROLL_CD"], names["ALT_HOLD_RTL"]) == (2200.0, 4500.0, 10_000.0)
    assert not {"AIRSPEED_MIN", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG"} & set(names)
    new = arduplane_bench.airborne()
    assert old.vehicle.flight.limits == new.vehicle.flight.limits
    old.guided()
    old.set_parameter(b"LIM_ROLL_CD", 2000.0, 4)
    old.by_int(43002, 0, 180.0, 50.0)
    old.fly(5.0)
    assert abs(old.vehicle.truth.bank_rad) == pytest.approx(0.349, abs=0.01)
    old.by_long(512, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    assert old.messages("AUTOPILOT_VERSION")[-1].flight_sw_version >> 16 == 0x0403


def intruder(bench: Bench, ahead_m: float) -> Message:
    north_m, east_m, down_m = bench.vehicle.truth.position_m
    there = bench.vehicle.flight.frame.to_geo(north_m + ahead_m, east_m, down_m)
    return mavlink.MAVLink_adsb_vehicle_message(
        0xA00001, round(there.lat_deg * 1e7), round(there.lon_deg * 1e7), 1, round(there.altitude_m * 1e3),
        18_000, 6000, 0, b"T000", 1, 0, 415, 1200,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("parameters", "mode"),
    [
        ({"AVD_ENABLE": 1, "AVD_F_ACTION": 3}, "AVOID_ADSB"),
        ({"AVD_ENABLE": 1, "AVD_F_ACTION": 5}, "RTL"),
        ({"AVD_ENABLE": 1, "AVD_F_ACTION": 1}, "AUTO"),
        ({"AVD_ENABLE": 0, "AVD_F_ACTION": 3}, "AUTO"),
    ],
)
def test_arduplanes_own_avoidance_changes_the_mode_if_enabled(parameters: Any, mode: str) -> None:
    bench = arduplane_bench.airborne(parameters=parameters)
    bench.send(intruder(bench, 400.0), (1, 156))
    bench.fly(1.0)
    assert bench.vehicle.truth.mode == "AUTO"
    bench.send(intruder(bench, 200.0), (1, 156))
    bench.fly(1.0)
    assert bench.vehicle.truth.mode == mode
    bench.fly(12.0)
    assert bench.vehicle.truth.mode == ("RTL" if mode == "RTL" else "AUTO")


# --- rotors ---


@both
def test_the_vtol_state_is_reported_as_set(autopilot: str) -> None:
    bench = AIRBORNE[autopilot]()
    state_id = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE
    assert bench.by_long(SET_INTERVAL, state_id, 100_000) == ACCEPTED
    bench.fly(1.0)
    assert bench.messages("EXTENDED_SYS_STATE")[-1].vtol_state == 0
    bench.vehicle.show_vtol_state(3)
    bench.fly(1.0)
    assert bench.messages("EXTENDED_SYS_STATE")[-1].vtol_state == 3
