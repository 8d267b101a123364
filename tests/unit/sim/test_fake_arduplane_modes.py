"""The fake ArduPlane's modes, arming and missions against measurements on the real one."""

import math

import pytest

from companion.geodesy import wrap_pi
from companion.mavlink.dialect import mavlink
from sim.vehicle import MissionItem, Mode, takeoff_item, waypoint_item
from sim.vehicle.mission import DO_CHANGE_SPEED, NAV_LAND, NAV_LOITER_UNLIM, NAV_RETURN_TO_LAUNCH
from tests.support.arduplane_bench import (
    FRAME,
    HOME,
    airborne,
    height_m,
    on_ground,
    waypoint,
)
from tests.support.vehicle_bench import (
    ACCEPTED,
    ARM,
    CHANGE_HEADING,
    DENIED,
    FAILED,
    SET_MODE,
)

# --- modes and arming ---


@pytest.mark.parametrize("mode", list(Mode))
def test_every_mode_keeps_flying(mode: Mode) -> None:
    bench = airborne()
    assert bench.by_long(SET_MODE, 1, mode) == ACCEPTED
    bench.fly(60.0)
    truth = bench.vehicle.truth
    assert not truth.on_ground
    assert truth.mode == mode.name
    assert truth.airspeed_mps == pytest.approx(22.0, abs=6.0)


def test_mode_by_set_mode_message_and_by_command_int() -> None:
    bench = airborne()
    bench.send(mavlink.MAVLink_set_mode_message(1, 1, Mode.CIRCLE))
    assert bench.vehicle.truth.mode == "CIRCLE"
    assert [(a.command, a.result) for a in bench.messages("COMMAND_ACK")] == [(11, ACCEPTED)]
    assert bench.by_int(SET_MODE, 1, Mode.RTL) == ACCEPTED
    assert bench.vehicle.truth.mode == "RTL"


@pytest.mark.parametrize("params", [(0.0, 15.0), (1.0, 99.0), (1.0, math.nan), (math.nan, 15.0), (1.0, 15.5)])
def test_unknown_modes_are_refused(params: tuple[float, float]) -> None:
    bench = airborne()
    assert bench.by_long(SET_MODE, *params) in (DENIED, FAILED)
    assert bench.vehicle.truth.mode == "AUTO"


def test_disarming_in_the_air_needs_force() -> None:
    bench = airborne()
    assert bench.by_long(ARM, 0.0) == FAILED
    assert bench.vehicle.truth.armed
    assert bench.by_long(ARM, 0.0, 21196.0) == ACCEPTED
    bench.fly(200.0)
    assert bench.vehicle.truth.on_ground
    assert bench.vehicle.truth.velocity_mps == (0.0, 0.0, 0.0)


def test_take_off_as_recorded() -> None:
    """60 m within 11 s of arming at 10 m/s of climb, then on a slope to the first waypoint."""
    bench = on_ground()
    assert bench.by_long(SET_MODE, 1, Mode.AUTO) == ACCEPTED
    bench.fly(5.0)
    assert bench.vehicle.truth.position_m == (0.0, 0.0, -HOME.altitude_m)  # not before arming
    assert bench.by_long(ARM, 1.0) == ACCEPTED
    fastest_mps = 0.0
    for _ in range(200):
        bench.fly(0.05)
        fastest_mps = max(fastest_mps, -bench.vehicle.truth.velocity_mps[2])
    assert fastest_mps == pytest.approx(10.0, abs=0.5)
    bench.fly(2.0)
    assert height_m(bench) > 60.0
    assert [m.seq for m in bench.messages("MISSION_ITEM_REACHED")] == [1]
    texts = bench.texts()
    assert texts[:2] == ["Mission: 1 Takeoff", "Throttle armed"]
    assert texts[2].startswith("Takeoff complete at 60.")
    assert texts[3] == "Mission: 2 WP"
    north_m, _, down_m = bench.vehicle.truth.position_m
    slope = (300.0 + HOME.altitude_m + down_m) / (4000.0 - north_m)  # to the first waypoint
    bench.fly(30.0)
    north_mps, _, down_mps = bench.vehicle.truth.velocity_mps
    assert -down_mps / north_mps == pytest.approx(slope, abs=0.01)


# --- AUTO ---


def test_the_mission_is_flown_to_its_end_and_then_home() -> None:
    bench = airborne(wind_mps=(0.0, 5.0), parameters={"WP_LOITER_RAD": 120.0})
    aside_m = 0.0
    while bench.vehicle.truth.mission_sequence == 2:
        bench.fly(1.0)
        aside_m = max(aside_m, abs(bench.vehicle.truth.position_m[1]))
    assert aside_m < 70.0  # only from turning early at the corner
    bench.fly(200.0)
    assert bench.vehicle.truth.mission_completed
    assert bench.vehicle.truth.mode == "RTL"
    assert [m.seq for m in bench.messages("MISSION_ITEM_REACHED")] == [2, 3]
    assert "Mission complete, changing mode to RTL" in bench.texts()
    bench.fly(300.0)
    assert math.hypot(*bench.vehicle.truth.position_m[:2]) == pytest.approx(120.0, abs=4.0)
    assert height_m(bench) == pytest.approx(100.0, abs=1.0)


def test_auto_resumes_the_same_item_straight() -> None:
    bench = airborne()
    bench.fly(20.0)
    bench.guided()
    assert bench.by_int(CHANGE_HEADING, 0, 90.0, 5.0) == ACCEPTED
    bench.fly(60.0)
    truth = bench.vehicle.truth
    assert truth.mission_sequence == 2
    assert bench.by_long(SET_MODE, 1, Mode.AUTO) == ACCEPTED
    assert bench.texts()[-1] == "Mission: 2 WP"
    start_n, start_e, _ = truth.position_m
    bench.fly(40.0)
    north_m, east_m, _ = bench.vehicle.truth.position_m
    line_rad = math.atan2(-start_e, 4000.0 - start_n)
    aside_m = (east_m - start_e) * math.cos(line_rad) - (north_m - start_n) * math.sin(line_rad)
    assert abs(aside_m) < 25.0
    bench.fly(140.0)
    assert [m.seq for m in bench.messages("MISSION_ITEM_REACHED")] == [2]


def test_setting_the_current_item() -> None:
    bench = airborne()
    assert bench.by_long(224, 3.0) == ACCEPTED
    assert bench.vehicle.truth.mission_sequence == 3
    assert bench.by_long(224, 17.0) == FAILED
    bench.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))
    assert bench.vehicle.truth.mission_sequence == 2


def test_an_acceptance_radius_is_used() -> None:
    place = FRAME.to_geo(1000.0, 0.0, -(HOME.altitude_m + 300.0))
    bench = airborne(
        mission=[takeoff_item(60.0), waypoint_item(place, acceptance_m=200.0), waypoint(1000.0, 900.0)]
    )
    while bench.vehicle.truth.mission_sequence == 2:
        bench.fly(0.05)
    assert 1000.0 - bench.vehicle.truth.position_m[0] == pytest.approx(200.0, abs=2.0)


def test_an_unlimited_loiter_does_not_complete_later_waypoints() -> None:
    loiter = MissionItem(
        NAV_LOITER_UNLIM,
        (0.0, 0.0, -80.0, 0.0),
        round(FRAME.to_geo(500.0, 0.0, 0.0).lat_deg * 1e7),
        round(HOME.lon_deg * 1e7),
        300.0,
    )
    bench = airborne(mission=[takeoff_item(60.0), loiter, waypoint(3000.0, 0.0)])
    bench.fly(120.0)
    headings = []
    for _ in range(20):
        bench.fly(1.0)
        truth = bench.vehicle.truth
        headings.append(truth.heading_rad)
        assert math.dist(truth.position_m[:2], (500.0, 0.0)) == pytest.approx(80.0, abs=12.0)
    assert wrap_pi(headings[3] - headings[0]) < 0.0  # a negative radius turns left
    assert not truth.mission_completed


def test_speed_rtl_and_landing_items() -> None:
    speed = MissionItem(DO_CHANGE_SPEED, (0.0, 26.0, 0.0, 0.0))
    bench = airborne(mission=[takeoff_item(60.0), waypoint(300.0, 0.0), speed, waypoint(2000.0, 0.0)])
    bench.fly(30.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(26.0, abs=0.2)

    home = MissionItem(NAV_RETURN_TO_LAUNCH)
    bench = airborne(mission=[takeoff_item(60.0), waypoint(300.0, 0.0), home])
    bench.fly(120.0)
    assert bench.vehicle.truth.mission_completed
    assert math.hypot(*bench.vehicle.truth.position_m[:2]) < 100.0

    field = FRAME.to_geo(3000.0, 0.0, 0.0)
    land = MissionItem(NAV_LAND, lat_e7=round(field.lat_deg * 1e7), lon_e7=round(field.lon_deg * 1e7))
    bench = airborne(mission=[takeoff_item(60.0), waypoint(300.0, 0.0), land])
    bench.fly(60.0)
    assert not bench.vehicle.truth.mission_completed
    bench.fly(150.0)
    truth = bench.vehicle.truth
    assert truth.on_ground
    assert not truth.armed
    assert truth.mission_completed
    assert truth.position_m[0] == pytest.approx(3000.0, abs=150.0)


def test_auto_without_a_mission_goes_home() -> None:
    bench = airborne()
    bench.send(mavlink.MAVLink_mission_clear_all_message(1, 1))
    assert bench.vehicle.truth.mode == "RTL"
    assert "Aircraft in auto without a running mission" in bench.texts()


def test_a_ground_station_moves_the_sticks_and_gives_them_back() -> None:
    bench, alone = airborne(), 65_535
    bench.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 1800, *[alone] * 7))
    assert bench.vehicle.flight.sticks.roll == pytest.approx(0.6)
    assert bench.vehicle.flight.sticks.pitch == 0.0
    bench.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 0, 0, *[alone] * 6))
    assert bench.vehicle.flight.sticks.roll == 0.0
