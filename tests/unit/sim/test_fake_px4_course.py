"""The fake PX4 of 1.18: GUIDED_COURSE as flown in its simulation, its modes, and detect-and-avoid."""

import math

import pytest

from companion.mavlink.dialect import AVAILABLE_MODES, Message, mavlink
from companion.mavlink.facts import AvailableMode
from companion.mavlink.translate import to_fact
from sim.vehicle import FakePx4, Px4Mode
from tests.support.px4_bench import FRAME, HOME, START_S, Px4Bench, airborne
from tests.support.vehicle_bench import (
    ACCEPTED,
    CHANGE_HEADING,
    DENIED,
    FAILED,
    REJECTED,
    REPOSITION,
    REQUEST_MESSAGE,
    SET_INTERVAL,
    SET_MODE,
    UNSUPPORTED,
)

CHANGE_ALTITUDE, CHANGE_SPEED = mavlink.MAV_CMD_DO_CHANGE_ALTITUDE, mavlink.MAV_CMD_DO_CHANGE_SPEED
HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT


def guided(**parameters: float) -> Px4Bench:
    """In GUIDED_COURSE, northbound 200 m above home at 15 m/s."""
    bench = airborne(firmware="1.18", height_m=200.0, parameters={"FW_AIRSPD_TRIM": 15.0, **parameters})
    assert bench.by_long(SET_MODE, 1, 4, 19) == ACCEPTED
    bench.fly(2.0)
    return bench


def off_deg(bench: Px4Bench, course_deg: float) -> float:
    return abs((bench.course_deg() - course_deg + 180.0) % 360.0 - 180.0)


def test_entering_holds_course_height_and_speed() -> None:
    bench = guided()
    bench.fly(20.0)
    assert off_deg(bench, 0.0) < 1.0
    assert bench.height_m() == pytest.approx(200.0, abs=1.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(15.0, abs=0.2)
    assert bench.vehicle.truth.companion_flies


@pytest.mark.parametrize(("turn_deg", "takes_s"), [(90.0, 5.0), (180.0, 7.5), (-90.0, 5.0)])
def test_a_course_is_flown_with_the_measured_delay(turn_deg: float, takes_s: float) -> None:
    bench = guided()
    assert bench.by_long(CHANGE_HEADING, 0, turn_deg % 360.0, 5.0) == ACCEPTED
    bench.fly(1.2)
    assert off_deg(bench, 0.0) < 3.0
    most_deg = 0.0
    for _ in range(round((takes_s - 1.2) * 10)):
        bench.fly(0.1)
        most_deg = max(most_deg, off_deg(bench, 0.0))
    assert off_deg(bench, turn_deg) < 6.0
    bench.fly(3.0)
    assert off_deg(bench, turn_deg) < 1.5
    assert most_deg <= abs(turn_deg) + 1.0, "no overshoot"


def test_a_height_is_flown_with_the_measured_delay() -> None:
    bench = guided()
    assert bench.by_long(CHANGE_ALTITUDE, HOME.altitude_m + 240.0, 0) == ACCEPTED
    bench.fly(3.5)
    assert bench.height_m() < 201.0
    bench.fly(6.5)
    assert bench.height_m() == pytest.approx(214.5, abs=2.0), "2.4 m/s"
    bench.fly(10.0)
    assert bench.height_m() == pytest.approx(240.0, abs=4.0)
    assert bench.vehicle.flight.target is not None
    assert bench.vehicle.flight.target.altitude_m == pytest.approx(HOME.altitude_m + 240.0)


def test_a_speed_is_flown_slowly() -> None:
    bench = guided()
    assert bench.by_long(CHANGE_SPEED, 0, 17.0, -1) == ACCEPTED
    bench.fly(8.0)
    # Measured in this mode: 1 m/s in 8 s; the recording from OFFBOARD, which is fitted: 0.7 m/s.
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(15.85, abs=0.3)
    assert bench.by_long(CHANGE_SPEED, 0, 99.0, -1) == ACCEPTED, "any speed is acknowledged"


def test_what_it_does_not_take() -> None:
    bench = guided()
    assert bench.by_long(CHANGE_HEADING, 1, 90.0, 5.0) == DENIED
    assert bench.by_long(CHANGE_HEADING, 0, math.nan, 5.0) == DENIED
    assert bench.by_long(mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, 0, 17.0) == UNSUPPORTED
    assert bench.by_long(mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE, 0, 0) == UNSUPPORTED
    assert bench.request_mode(Px4Mode.MISSION) == ACCEPTED
    assert bench.by_long(CHANGE_HEADING, 0, 90.0, 5.0) == DENIED
    assert bench.by_long(CHANGE_ALTITUDE, 700.0, 0) == REJECTED
    assert bench.mode() == "MISSION"


def test_a_height_outside_the_fence_is_acknowledged_and_only_a_text_says_that_it_is_not_flown() -> None:
    bench = guided(GF_MAX_VER_DIST=220.0)
    assert bench.by_long(CHANGE_ALTITUDE, HOME.altitude_m + 260.0, 0) == ACCEPTED
    bench.fly(15.0)
    assert bench.height_m() == pytest.approx(200.0, abs=1.0)
    assert bench.texts() == ["Altitude change is outside geofence"]


def test_a_place_leaves_it_for_hold_and_it_flies_on_without_commands() -> None:
    bench = guided()
    bench.by_long(CHANGE_HEADING, 0, 90.0, 5.0)
    bench.fly(60.0)
    assert bench.mode() == "GUIDED_COURSE"
    assert off_deg(bench, 90.0) < 1.0
    assert bench.by_int(REPOSITION, -1, 1, place=(474_100_000, 85_600_000, 700.0)) == ACCEPTED
    assert bench.mode() == "HOLD"
    assert bench.by_long(CHANGE_ALTITUDE, HOME.altitude_m + 150.0, 0) == ACCEPTED
    bench.fly(60.0)
    assert bench.height_m() == pytest.approx(150.0, abs=2.0)


def test_before_1_18_the_mode_does_not_exist_and_a_height_enters_hold() -> None:
    bench = airborne()
    assert bench.by_long(SET_MODE, 1, 4, 19) == REJECTED
    assert bench.texts() == ["Unsupported auto mode"]
    assert bench.by_long(CHANGE_HEADING, 0, 90.0) == UNSUPPORTED
    assert bench.by_long(REQUEST_MESSAGE, AVAILABLE_MODES, 0) == FAILED
    assert bench.by_long(CHANGE_ALTITUDE, HOME.altitude_m + 150.0, 0) == ACCEPTED
    assert bench.mode() == "HOLD"


def test_all_its_modes_are_listed() -> None:
    bench = airborne(firmware="1.18")
    assert bench.by_long(REQUEST_MESSAGE, AVAILABLE_MODES, 0) == ACCEPTED
    facts = [to_fact(message, 0.0) for message in bench.messages("AVAILABLE_MODES")]
    modes = [fact for fact in facts if isinstance(fact, AvailableMode)]
    assert {mode.custom_mode for mode in modes} == set(Px4Mode)
    assert [mode.index for mode in modes] == list(range(1, modes[0].total + 1))
    assert all(mode.selectable for mode in modes)
    assert bench.by_long(REQUEST_MESSAGE, AVAILABLE_MODES, 99) == DENIED


def test_the_heartbeat_comes_once_a_second_or_on_request() -> None:
    bench = airborne(firmware="1.18")
    bench.fly(1.2)
    bench.received.clear()
    bench.request_mode(Px4Mode.HOLD)
    bench.fly(0.5)
    assert bench.messages("HEARTBEAT") == []
    assert bench.by_long(SET_INTERVAL, HEARTBEAT, 100_000) == FAILED
    assert bench.by_long(REQUEST_MESSAGE, HEARTBEAT) == ACCEPTED
    (heartbeat,) = bench.messages("HEARTBEAT")
    assert heartbeat.custom_mode == Px4Mode.HOLD


def test_offboard_is_left_in_a_climb_with_a_valid_setpoint() -> None:
    bench = airborne(firmware="1.18")
    bench.engage()
    bench.stream(1.0, height_m=150.0)
    assert bench.request_mode(Px4Mode.MISSION) == ACCEPTED
    bench.fly(1.0)
    assert not bench.vehicle.truth.uncontrolled


# --- detect-and-avoid


def report(north_m: float, speed_mps: float = 0.0) -> Message:
    place = FRAME.to_geo(north_m, 0.0, -(HOME.altitude_m + 200.0))
    return mavlink.MAVLink_adsb_vehicle_message(
        0xA00001, round(place.lat_deg * 1e7), round(place.lon_deg * 1e7), 1, round(place.altitude_m * 1e3),
        18_000, round(speed_mps * 100), 0, b"T000", 1, 0, 415, 1200,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("north_m", "action", "mode"),
    [
        (100.0, {"DAA_LVL_CRIT_ACT": 4}, "HOLD"),
        (100.0, {"DAA_LVL_CRIT_ACT": 0, "DAA_LVL_HIGH_ACT": 3}, "LAND"),
        (400.0, {"DAA_LVL_CRIT_ACT": 4}, "GUIDED_COURSE"),
        (400.0, {"DAA_LVL_HIGH_ACT": 2}, "RETURN"),
        (1500.0, {"DAA_LVL_LOW_ACT": 2}, "RETURN"),
        (100.0, {"DAA_LVL_CRIT_ACT": 4, "DAA_EN": 0}, "GUIDED_COURSE"),
        (100.0, {"NAV_TRAFF_AVOID": 2}, "GUIDED_COURSE"),
    ],
)
def test_it_acts_by_level_from_guided_course(north_m: float, action: dict[str, float], mode: str) -> None:
    bench = guided(**action)
    place_m = bench.vehicle.truth.position_m[0]
    bench.send(report(place_m + north_m, 20.0 if north_m > 1000.0 else 0.0), (1, 156))
    bench.fly(0.2)
    assert bench.mode() == mode


def test_it_never_acts_from_offboard() -> None:
    bench = airborne(firmware="1.18", height_m=200.0, parameters={"DAA_LVL_CRIT_ACT": 4})
    bench.engage()
    bench.send(report(bench.vehicle.truth.position_m[0] + 100.0), (1, 156))
    bench.stream(1.0)
    assert bench.mode() == "OFFBOARD"
    assert bench.texts() == ["Traffic alert"]


def test_an_unknown_version_is_refused() -> None:
    with pytest.raises(ValueError, match=r"none of 1\.16, 1\.18"):
        FakePx4(HOME, START_S, firmware="1.17")  # type: ignore[arg-type]
