"""OFFBOARD of the fake PX4 against measurements: what it flies, and what invalidates its setpoint."""

import math

import pytest

from companion.geodesy import wrap_pi
from companion.mavlink.dialect import mavlink
from sim.vehicle import Px4Mode
from tests.support.px4_bench import (
    NO_HEIGHT,
    POSITION,
    POSITION_VELOCITY,
    RELATIVE,
    VELOCITY,
    Px4Bench,
    airborne,
)
from tests.support.vehicle_bench import ACCEPTED, CHANGE_HEADING, REJECTED, UNSUPPORTED

UNTIL_WITHIN_5_DEG_S = {30.0: 1.9, 90.0: 3.4, 179.9: 4.7}


def engaged(**options: object) -> Px4Bench:
    bench = airborne(**options)  # type: ignore[arg-type]
    bench.engage()
    return bench


# --- entering, losing and coming back ---


def test_offboard_needs_a_stream() -> None:
    bench = airborne()
    assert bench.request_mode(Px4Mode.OFFBOARD) == REJECTED
    bench.stream(0.2, VELOCITY)
    assert bench.request_mode(Px4Mode.OFFBOARD) == REJECTED
    bench.stream(0.3, VELOCITY)
    assert bench.request_mode(Px4Mode.OFFBOARD) == ACCEPTED
    assert bench.vehicle.truth.companion_flies


def test_a_stream_below_2_hz_does_not_count() -> None:
    bench = airborne()
    for _ in range(5):
        bench.send(bench.setpoint(VELOCITY))
        bench.fly(0.6)
    bench.send(bench.setpoint(VELOCITY))
    assert bench.request_mode(Px4Mode.OFFBOARD) == REJECTED


def test_a_new_mode_is_reported_by_an_early_heartbeat() -> None:
    bench = airborne()
    bench.stream(0.55, VELOCITY)
    bench.received.clear()
    bench.request_mode(Px4Mode.OFFBOARD)
    bench.fly(0.15)
    (received,) = bench.messages("HEARTBEAT")
    assert (received.custom_mode, received.autopilot, received.type) == (6 << 16, 12, 1)


@pytest.mark.parametrize(
    ("action", "mode"), [(0, "POSCTL"), (1, "ALTCTL"), (2, "MANUAL"), (3, "RETURN"), (4, "LAND"), (5, "HOLD")]
)
def test_a_silent_second_ends_offboard_and_a_new_stream_re_enters_it(action: int, mode: str) -> None:
    bench = engaged(parameters={"COM_OBL_RC_ACT": action})
    bench.fly(0.8)
    assert bench.mode() == "OFFBOARD"
    bench.fly(0.2)
    assert bench.mode() == mode
    bench.fly(5.0)
    assert bench.mode() == mode
    bench.stream(0.2, VELOCITY)
    assert bench.mode() == "OFFBOARD"
    bench.stream(0.5, VELOCITY)
    bench.stream(1.0)
    assert not bench.vehicle.truth.uncontrolled


def test_a_stream_does_not_re_enter_after_a_commanded_mode() -> None:
    bench = engaged()
    bench.release()
    bench.stream(3.0, VELOCITY)
    assert bench.mode() == "MISSION"
    lost = engaged()
    lost.fly(2.0)
    lost.request_mode(Px4Mode.HOLD)
    lost.stream(3.0, VELOCITY)
    assert lost.mode() == "HOLD"


def test_the_stream_timeout_is_a_parameter() -> None:
    bench = engaged(parameters={"COM_OF_LOSS_T": 3.0})
    bench.fly(2.8)
    assert bench.mode() == "OFFBOARD"
    bench.fly(0.3)
    assert bench.mode() == "POSCTL"


# --- what it flies ---


@pytest.mark.parametrize(("turn_deg", "expected_s"), UNTIL_WITHIN_5_DEG_S.items())
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turns_take_as_long_as_measured(turn_deg: float, expected_s: float, side: float) -> None:
    bench = engaged()
    bench.stream(2.0)
    started_s = arrived_s = math.nan
    beyond_deg = 0.0
    since_s = bench.vehicle.time_s
    for _ in range(150):
        bench.stream(0.1, course_deg=side * turn_deg)
        seconds = bench.vehicle.time_s - since_s
        turned_deg = side * math.degrees(wrap_pi(math.radians(bench.course_deg())))
        off_deg = side * math.degrees(wrap_pi(math.radians(side * turn_deg - bench.course_deg())))
        if math.isnan(started_s) and turned_deg > 0.5:
            started_s = seconds
        if math.isnan(arrived_s) and abs(off_deg) < 5.0:
            arrived_s = seconds
        beyond_deg = max(beyond_deg, -off_deg if not math.isnan(arrived_s) else 0.0)
    assert started_s == pytest.approx(0.5, abs=0.11)
    # No point mass turns the second 90 degrees as fast at a bank of 50 degrees.
    assert arrived_s == pytest.approx(expected_s, abs=0.35 if turn_deg < 100.0 else 0.5)
    assert beyond_deg < 1.0
    assert bench.course_deg() == pytest.approx(side * turn_deg % 360.0, abs=0.3)


def test_a_climb_takes_as_long_as_measured() -> None:
    bench = engaged()
    bench.stream(10.0, height_m=130.0)
    assert 120.0 < bench.height_m() < 129.0
    bench.stream(10.0, height_m=130.0)
    assert bench.height_m() == pytest.approx(130.0, abs=1.0)


def test_it_flies_the_line_through_the_position_in_wind() -> None:
    bench = engaged(wind_mps=(3.0, 4.0))
    point = bench.setpoint(course_deg=90.0, height_m=100.0)
    point.lat_int += round(200.0 / 111_200.0 * 1e7)
    north_m = bench.vehicle.truth.position_m[0] + 200.0
    for _ in range(600):
        bench.send(point)
        bench.fly(0.1)
    assert bench.vehicle.truth.position_m[0] == pytest.approx(north_m, abs=1.0)
    assert bench.course_deg() == pytest.approx(90.0, abs=0.5)


def test_airspeed_follows_the_parameter_not_velocity_or_change_speed() -> None:
    bench = engaged()
    assert bench.by_long(178, 0, 19.0, -1) == ACCEPTED
    bench.stream(10.0, speed_mps=19.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(14.0, abs=0.1)
    bench.set_parameter(b"FW_AIRSPD_TRIM", 18.0)
    bench.stream(90.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(18.0, abs=0.2)


def test_a_position_alone_is_circled() -> None:
    bench = engaged()
    bench.stream(0.5, POSITION_VELOCITY)
    place_m = bench.vehicle.truth.position_m
    message = bench.setpoint(POSITION, height_m=100.0)
    for _ in range(900):
        bench.send(message)
        bench.fly(0.1)
    assert math.dist(bench.vehicle.truth.position_m[:2], place_m[:2]) == pytest.approx(80.0, abs=15.0)


@pytest.mark.parametrize("body", [False, True])
def test_velocity_alone_freezes_attitude_and_thrust(body: bool) -> None:
    bench = engaged()
    bench.stream(1.2, course_deg=180.0)
    bank_rad = bench.vehicle.truth.bank_rad
    assert abs(bank_rad) > 0.5
    for _ in range(200):
        message = bench.setpoint(VELOCITY, course_deg=0.0)
        if body:
            message = mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, mavlink.MAV_FRAME_BODY_NED, VELOCITY, 0, 0, 0, 14.0, 0, 0, 0, 0, 0, 0, 0
            )
        bench.send(message)
        bench.fly(0.1)
    assert bench.vehicle.truth.bank_rad == pytest.approx(bank_rad, abs=0.3)
    assert abs(bench.vehicle.truth.bank_rad) > 0.5
    assert not bench.vehicle.truth.uncontrolled
    assert bench.mode() == "OFFBOARD"


def test_an_acceleration_turns_without_end() -> None:
    bench = engaged()
    for _ in range(3):
        bench.stream(10.0, POSITION_VELOCITY & ~192, acceleration_mps2=(0.0, 3.0))
        assert abs(bench.vehicle.truth.bank_rad) > 0.2


def test_local_frame_and_height_above_home() -> None:
    bench = engaged()
    bench.stream(20.0, frame=RELATIVE, height_m=110.0)
    assert bench.height_m() == pytest.approx(110.0, abs=1.0)
    for _ in range(200):
        north_m, east_m, _ = bench.vehicle.truth.position_m
        bench.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, 1, POSITION_VELOCITY, north_m, east_m, -100.0, 0.0, 9.0, 0, 0, 0, 0, 0, 0
            )
        )
        bench.fly(0.1)
    assert bench.height_m() == pytest.approx(100.0, abs=1.0)
    assert bench.course_deg() == pytest.approx(90.0, abs=0.5)


@pytest.mark.parametrize("frame", [0, 3, 8])
def test_other_frames_do_not_count_as_a_stream(frame: int) -> None:
    bench = airborne()
    bench.stream(2.0, VELOCITY, frame=frame)
    assert bench.request_mode(Px4Mode.OFFBOARD) == REJECTED
    bench.engage()
    bench.stream(1.5, frame=frame)
    assert bench.mode() == "POSCTL"


def test_setpoints_without_a_valid_field_do_not_count() -> None:
    bench = engaged()
    bench.stream(1.5, 4095)
    assert bench.mode() == "POSCTL"


def test_there_are_no_guided_commands() -> None:
    assert engaged().by_int(CHANGE_HEADING, 0, 90.0, 5.0) == UNSUPPORTED


# --- what invalidates the setpoint ---


def test_correct_entry_and_exit_keep_the_setpoint_valid() -> None:
    bench = airborne(quiet=False)
    for number in range(5):
        bench.engage()
        bench.stream(4.0, course_deg=40.0 * number, height_m=100.0 + 20.0 * (number % 2))
        bench.release()
        bench.fly(5.0)
        assert not bench.vehicle.truth.uncontrolled
    assert bench.mode() == "MISSION"
    assert not [text for text in bench.texts() if text.startswith("FAKE VEHICLE")]
    assert all(math.isfinite(m.q[0]) for m in bench.messages("ATTITUDE_TARGET"))


@pytest.mark.parametrize("off_m", [15.0, -15.0, 5.5])
def test_leaving_far_from_the_commanded_height_invalidates_the_setpoint(off_m: float) -> None:
    bench = engaged(height_m=200.0, quiet=False)
    bench.stream(0.5, height_m=200.0 + off_m)
    assert bench.request_mode(Px4Mode.MISSION) == ACCEPTED
    bench.fly(10.0)
    truth = bench.vehicle.truth
    assert truth.uncontrolled
    assert truth.mode == "MISSION"
    assert abs(truth.bank_rad) > 0.3
    assert bench.height_m() < 190.0
    assert "FAKE VEHICLE: attitude setpoint is NaN" in bench.texts()
    assert all(math.isnan(q) for q in bench.messages("ATTITUDE_TARGET")[-1].q)


@pytest.mark.parametrize("off_m", [0.0, 4.0])
def test_leaving_at_the_commanded_height_keeps_the_setpoint_valid(off_m: float) -> None:
    bench = engaged()
    bench.stream(0.5, height_m=100.0 + off_m)
    bench.request_mode(Px4Mode.MISSION)
    bench.fly(1.0)
    assert not bench.vehicle.truth.uncontrolled


def test_one_level_setpoint_just_before_leaving_is_too_late() -> None:
    bench = engaged()
    bench.stream(0.5, height_m=130.0)
    bench.stream(0.1)
    bench.request_mode(Px4Mode.MISSION)
    bench.fly(0.1)
    assert bench.vehicle.truth.uncontrolled


def test_a_stream_lost_far_from_the_commanded_height_invalidates_too() -> None:
    bench = engaged()
    bench.stream(0.5, height_m=130.0)
    bench.fly(1.2)
    assert bench.mode() == "POSCTL"
    assert bench.vehicle.truth.uncontrolled


def test_velocity_far_from_the_commanded_height_invalidates_and_the_recovery_restores() -> None:
    bench = engaged(height_m=300.0)
    bench.stream(0.5, height_m=330.0)
    bench.stream(0.2, VELOCITY)
    assert bench.vehicle.truth.uncontrolled
    bench.stream(0.8, VELOCITY)
    bench.stream(0.5)
    assert bench.vehicle.truth.uncontrolled, "a second of velocity is too short"
    bench.stream(1.5, VELOCITY)
    assert bench.vehicle.truth.uncontrolled
    bench.stream(0.2)
    assert not bench.vehicle.truth.uncontrolled
    bench.stream(20.0, course_deg=90.0)
    assert bench.course_deg() == pytest.approx(90.0, abs=1.0)
    assert bench.texts()[-1] == "FAKE VEHICLE: attitude setpoint is sane again"


@pytest.mark.parametrize("strict", [True, False])
def test_direct_entry_with_position_and_velocity_invalidates_when_strict(strict: bool) -> None:
    bench = airborne(strict=strict)
    bench.stream(0.6)
    assert bench.request_mode(Px4Mode.OFFBOARD) == ACCEPTED
    bench.stream(0.3)
    assert bench.vehicle.truth.uncontrolled is strict


def test_re_entry_with_position_and_velocity_invalidates_too() -> None:
    bench = engaged()
    bench.fly(2.0)
    bench.stream(0.3)
    assert bench.mode() == "OFFBOARD"
    assert bench.vehicle.truth.uncontrolled


@pytest.mark.parametrize(("mask", "speed_mps"), [(NO_HEIGHT, 14.0), (POSITION_VELOCITY, 0.0)])
def test_setpoints_that_make_the_attitude_nan(mask: int, speed_mps: float) -> None:
    bench = engaged()
    bench.stream(0.6, mask, speed_mps=speed_mps)
    assert bench.vehicle.truth.uncontrolled
    assert bench.mode() == "OFFBOARD"


def test_manual_bypasses_the_invalid_setpoint() -> None:
    bench = engaged()
    bench.stream(0.5, height_m=130.0)
    bench.vehicle.set_mode("MANUAL")
    bench.fly(1.0)
    assert not bench.vehicle.truth.uncontrolled
    bench.vehicle.set_mode("HOLD")
    bench.fly(1.0)
    assert bench.vehicle.truth.uncontrolled
