"""The fake ArduPlane in GUIDED against measurements on the real one, quirks included."""

import math

import pytest

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle import Mode
from tests.support.arduplane_bench import (
    FRAME,
    airborne,
    course_deg,
    height_m,
)
from tests.support.vehicle_bench import (
    ACCEPTED,
    CHANGE_ALTITUDE,
    CHANGE_HEADING,
    CHANGE_SPEED,
    COMPANION,
    DENIED,
    FAILED,
    INT_ONLY,
    REPOSITION,
    SET_MODE,
)


def test_guided_begins_with_a_loiter_at_the_present_position() -> None:
    """The radius is that of the recorded aircraft. A bank of 45 degrees flies no tighter circle than 75 m."""
    bench = airborne(parameters={"WP_LOITER_RAD": 80.0})
    bench.fly(20.0)
    here_m = bench.vehicle.truth.position_m
    bench.guided()
    bench.fly(60.0)
    for _ in range(20):
        bench.fly(1.0)
        assert math.dist(bench.vehicle.truth.position_m[:2], here_m[:2]) == pytest.approx(80.0, abs=2.0)
    assert height_m(bench) == pytest.approx(300.0, abs=0.5)


def test_change_heading_turns_as_measured_and_holds() -> None:
    bench = airborne(wind_mps=(-3.0, 4.0))
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 91.0, 5.0)
    bench.fly(30.0)
    bench.by_int(CHANGE_HEADING, 0, 10.0, 5.0)
    bench.fly(4.0)
    assert math.degrees(-bench.vehicle.truth.bank_rad) == pytest.approx(
        math.degrees(math.atan(5 / 9.80665)), abs=0.5
    )
    bench.fly(26.0)
    assert course_deg(bench) == pytest.approx(10.0, abs=0.1)  # over ground, in wind
    bench.fly(600.0)
    assert course_deg(bench) == pytest.approx(10.0, abs=0.01)


def test_a_heading_may_be_commanded_instead_of_a_course() -> None:
    bench = airborne(wind_mps=(0.0, 6.0))
    bench.guided()
    assert bench.by_int(CHANGE_HEADING, 1, 20.0, 5.0) == ACCEPTED
    bench.fly(60.0)
    assert math.degrees(bench.vehicle.truth.heading_rad) == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize(
    "params",
    [
        (0.0, 360.0, 5.0),
        (0.0, -1.0, 5.0),
        (0.0, math.nan, 5.0),
        (0.0, math.inf, 5.0),
        (0.0, 90.0, math.nan),
        (7.0, 90.0, 5.0),
        (math.nan, 90.0, 5.0),
    ],
)
def test_bad_headings_are_denied_without_effect(params: tuple[float, float, float]) -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 270.0, 5.0)
    assert bench.by_int(CHANGE_HEADING, *params) == DENIED
    bench.fly(30.0)
    assert course_deg(bench) == pytest.approx(270.0, abs=0.2)


def test_the_roll_limit_caps_the_bank() -> None:
    bench = airborne()
    bench.send(mavlink.MAVLink_param_set_message(1, 1, b"ROLL_LIMIT_DEG", 20.0, 9))
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 180.0, 50.0)
    bench.fly(5.0)
    assert math.degrees(abs(bench.vehicle.truth.bank_rad)) == pytest.approx(20.0, abs=0.1)


def test_only_speeds_within_the_parameters_are_flown() -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_SPEED, 0, 26.0, 1.0) == ACCEPTED
    bench.fly(15.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(26.0, abs=0.1)
    assert bench.by_int(CHANGE_SPEED, 0, 9.0) == FAILED
    assert bench.by_int(CHANGE_SPEED, 0, 31.0) == FAILED
    assert bench.by_int(CHANGE_SPEED, 0, math.nan) == FAILED
    assert bench.by_int(CHANGE_SPEED, 1, 20.0) == DENIED  # ground speed
    bench.fly(15.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(26.0, abs=0.1)


@pytest.mark.parametrize(
    ("frame", "z_m", "expected_m"),
    [(3, 360.0, 360.0), (6, 250.0, 250.0), (0, 944.1, 360.0), (5, 834.1, 250.0)],
)
def test_altitude_is_flown_in_every_frame(frame: int, z_m: float, expected_m: float) -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_ALTITUDE, frame=frame, place=(0, 0, z_m)) == ACCEPTED
    bench.fly(8.0)
    assert abs(height_m(bench) - 300.0) == pytest.approx(22.0, abs=4.0)  # as recorded, less in a turn
    bench.fly(30.0)
    assert height_m(bench) == pytest.approx(expected_m, abs=0.5)


def test_altitude_with_a_rate() -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_ALTITUDE, 0.0, 0.0, 1.0, frame=3, place=(0, 0, 330.0)) == ACCEPTED
    bench.fly(20.0)
    assert height_m(bench) == pytest.approx(317.0, abs=1.0)
    bench.fly(40.0)
    assert height_m(bench) == pytest.approx(330.0, abs=0.5)


@pytest.mark.parametrize(("frame", "z_m"), [(3, 0.0), (3, -1.0), (0, math.nan), (1, 300.0), (8, 300.0)])
def test_bad_altitudes_are_denied(frame: int, z_m: float) -> None:
    bench = airborne()
    bench.guided()
    assert bench.by_int(CHANGE_ALTITUDE, frame=frame, place=(0, 0, z_m)) == DENIED


@pytest.mark.parametrize("command", [CHANGE_SPEED, CHANGE_ALTITUDE, CHANGE_HEADING])
def test_guided_commands_fail_outside_guided_and_need_command_int(command: int) -> None:
    bench = airborne()
    assert bench.by_int(command, 0, 20.0, 1.0, frame=3, place=(0, 0, 330.0)) == FAILED
    bench.guided()
    assert bench.by_long(command, 0, 20.0, 1.0) == INT_ONLY
    assert bench.by_int(command, 0, 20.0, 1.0, frame=3, place=(0, 0, 330.0)) == ACCEPTED


@pytest.mark.parametrize("between", [Mode.LOITER, Mode.AUTO, Mode.FBWA])
def test_a_mode_change_clears_the_guided_targets(between: Mode) -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 90.0, 5.0)
    bench.by_int(CHANGE_SPEED, 0, 28.0)
    bench.by_int(CHANGE_ALTITUDE, frame=3, place=(0, 0, 500.0))
    bench.fly(10.0)
    bench.by_long(SET_MODE, 1, between)
    bench.guided()
    here_m = bench.vehicle.truth.position_m
    bench.fly(90.0)
    truth = bench.vehicle.truth
    assert math.dist(truth.position_m[:2], here_m[:2]) < 100.0
    assert truth.position_m[2] == pytest.approx(here_m[2], abs=10.0)
    assert truth.airspeed_mps == pytest.approx(22.0, abs=0.2)


def test_reposition_enters_guided_flies_there_and_circles() -> None:
    bench = airborne()
    place = FRAME.to_geo(1500.0, 1500.0, 0.0)
    target = (round(place.lat_deg * 1e7), round(place.lon_deg * 1e7), 250.0)
    assert bench.by_int(REPOSITION, -1, 0, 0, math.nan, frame=3, place=target) == FAILED  # without the flag
    assert bench.vehicle.truth.mode == "AUTO"
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 270.0, 5.0)
    bench.by_long(SET_MODE, 1, Mode.AUTO)
    assert bench.by_int(REPOSITION, -1, 1, 0, math.nan, frame=3, place=target) == ACCEPTED
    assert bench.vehicle.truth.mode == "GUIDED"
    bench.fly(150.0)
    assert math.dist(bench.vehicle.truth.position_m[:2], (1500.0, 1500.0)) == pytest.approx(60.0, abs=15.0)
    assert height_m(bench) == pytest.approx(250.0, abs=0.5)
    bench.by_int(CHANGE_HEADING, 0, 270.0, 5.0)
    bench.fly(30.0)
    assert bench.by_int(REPOSITION, -1, 0, 120, 1.0, frame=3, place=target) == ACCEPTED  # cancels the course
    bench.fly(120.0)
    assert math.dist(bench.vehicle.truth.position_m[:2], (1500.0, 1500.0)) == pytest.approx(120.0, abs=15.0)
    assert bench.vehicle.truth.bank_rad < 0.0  # p4 = 1 turns left
    assert bench.by_long(REPOSITION, -1, 1) == INT_ONLY


def position_target(frame: int, alt_m: float, mask: int, *, local: bool = False) -> Message:
    build = mavlink.MAVLink_set_position_target_global_int_message
    place: tuple[float, float, float] = (round(-35.3e7), round(149.3e7), alt_m)
    if local:
        build = mavlink.MAVLink_set_position_target_local_ned_message
        place = (0.0, 0.0, alt_m)
    return build(0, 1, 1, frame, mask, *place, 0.0, 25.0, 0.0, 0.0, 0.0, 0.0, 1.5, 0.0)


def test_local_setpoints_are_silently_ignored() -> None:
    bench, undisturbed = airborne(), airborne()
    for each in (bench, undisturbed):
        each.guided()
    before = len(bench.received)
    for _ in range(50):
        bench.send(position_target(mavlink.MAV_FRAME_LOCAL_NED, -100.0, 0, local=True), COMPANION)
        for each in (bench, undisturbed):
            each.fly(0.2)
    assert bench.vehicle.truth == undisturbed.vehicle.truth
    assert {m.get_type() for _, m in bench.received[before:]} == {"HEARTBEAT"}


def test_only_the_height_of_a_local_offset_is_flown() -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 45.0, 5.0)
    bench.send(position_target(mavlink.MAV_FRAME_LOCAL_OFFSET_NED, -50.0, 0, local=True), COMPANION)
    assert bench.texts()[-1] == "Change alt to 350.0"
    bench.fly(40.0)
    assert height_m(bench) == pytest.approx(350.0, abs=0.5)
    assert course_deg(bench) == pytest.approx(45.0, abs=0.2)


@pytest.mark.parametrize(
    ("frame", "alt_m"), [(0, 944.1), (5, 944.1), (3, 360.0), (6, 360.0), (10, 360.0), (11, 360.0)]
)
def test_only_the_height_of_a_global_setpoint_is_flown_and_kept(frame: int, alt_m: float) -> None:
    bench = airborne()
    bench.guided()
    bench.by_int(CHANGE_HEADING, 0, 90.0, 5.0)
    for _ in range(90):
        bench.send(position_target(frame, alt_m, 0), COMPANION)
        bench.fly(0.2)
    assert height_m(bench) == pytest.approx(360.0, abs=3.0)  # 60 m in 18 s
    assert course_deg(bench) == pytest.approx(90.0, abs=2.0)
    bench.fly(60.0)
    assert height_m(bench) == pytest.approx(360.0, abs=0.5)
    assert bench.texts() == []


def test_targets_with_wrong_frame_masked_height_or_outside_guided_are_ignored() -> None:
    bench = airborne()
    bench.send(position_target(0, 944.1, 0), COMPANION)  # in AUTO
    bench.guided()
    bench.send(position_target(0, 944.1, 4), COMPANION)  # Z masked
    assert bench.texts() == []
    bench.send(position_target(1, 944.1, 0), COMPANION)
    assert bench.texts() == ["Invalid coord frame"]
    bench.send(position_target(0, math.nan, 0), COMPANION)
    bench.fly(30.0)
    assert height_m(bench) == pytest.approx(300.0, abs=0.5)
