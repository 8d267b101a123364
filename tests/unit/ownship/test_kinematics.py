"""Position, velocity, airspeed and the heights of commands."""

import math

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import AirData, OwnPosition, Sender, Wind
from companion.ownship.kinematics import Kinematics

AUTOPILOT = Sender(1, 1)
FRAME = LocalFrame(47.0, 8.0)


def moving(north_mps: float, east_mps: float, heading_rad: float | None = None) -> Kinematics:
    kinematics = Kinematics()
    position = OwnPosition(AUTOPILOT, 0.0, 47.0, 8.0, 700.0, 200.0, (north_mps, east_mps, 0.0), heading_rad)
    kinematics.observe_position(position, 100.0)
    return kinematics


def test_without_a_position_there_is_no_place_and_no_command() -> None:
    kinematics = Kinematics()
    assert kinematics.place() is None
    assert kinematics.home_altitude_m() is None
    assert kinematics.ownship(FRAME) is None
    assert kinematics.command(kinematics.guidance(), 0.5) is None
    assert kinematics.position_lost(0.0)


def test_a_position_is_lost_after_five_seconds() -> None:
    kinematics = moving(20.0, 0.0)
    assert kinematics.place() == GeoPoint(47.0, 8.0, 700.0)
    assert kinematics.home_altitude_m() == 500.0
    assert not kinematics.position_lost(105.0)
    assert kinematics.position_lost(105.1)


@pytest.mark.parametrize(("airspeed_mps", "expected_mps"), [(18.0, 18.0), (0.0, 25.0), (None, 25.0)])
def test_ground_speed_replaces_a_missing_airspeed(airspeed_mps: float | None, expected_mps: float) -> None:
    kinematics = moving(15.0, 20.0)
    kinematics.observe_air_data(AirData(AUTOPILOT, airspeed_mps), 100.0)
    assert kinematics.airspeed_mps() == expected_mps


def test_the_course_replaces_a_missing_heading() -> None:
    for heading_rad, expected_rad in ((0.3, 0.3), (None, math.pi / 2.0)):
        own = moving(0.0, 20.0, heading_rad).ownship(FRAME)
        assert own is not None
        assert own.heading_rad == pytest.approx(expected_rad)
        assert own.time_s == 100.0


def test_present_guidance_is_the_course_and_height_now_flown() -> None:
    guidance = moving(0.0, -20.0).guidance()
    assert guidance.course_rad == pytest.approx(1.5 * math.pi)
    assert (guidance.airspeed_mps, guidance.altitude_m) == (20.0, 700.0)


@pytest.mark.parametrize(("air_data_s", "altitude_m"), [(100.4, 700.0), (101.0, 712.0)])
def test_a_command_starts_from_the_height_by_air_data_when_the_position_is_old(
    air_data_s: float, altitude_m: float
) -> None:
    kinematics = Kinematics()
    kinematics.observe_air_data(AirData(AUTOPILOT, 20.0, 690.0), 99.9)
    position = OwnPosition(AUTOPILOT, 0.0, 47.0, 8.0, 700.0, 200.0, (20.0, 0.0, 0.0), 0.0)
    kinematics.observe_position(position, 100.0)
    kinematics.observe_air_data(AirData(AUTOPILOT, 20.0, 702.0), air_data_s)
    command = kinematics.command(kinematics.guidance(), 0.5)
    assert command is not None
    assert command.position.altitude_m == altitude_m


# --- airspeed: measured, or a substitute for predictions that is never commanded


def flying_north(ground_mps: float = 30.0) -> Kinematics:
    own = Kinematics()
    own.observe_position(
        OwnPosition(AUTOPILOT, 10.0, 47.0, 8.0, 500.0, 100.0, (ground_mps, 0.0, 0.0), 0.0), 10.0
    )
    return own


def shown(own: Kinematics, airspeed_mps: float | None, *, usable: bool | None = True) -> Kinematics:
    own.observe_air_data(AirData(AUTOPILOT, airspeed_mps, 500.0), 4.0)
    own.observe_air_data(AirData(AUTOPILOT, airspeed_mps, 500.0), 9.9)
    own.airspeed.sensor_usable = usable
    return own


def test_a_sensor_measures_the_airspeed() -> None:
    own = shown(flying_north(), 22.0)
    assert own.measured_airspeed_mps() == own.airspeed_mps() == 22.0


@pytest.mark.parametrize(
    ("airspeed_mps", "usable"), [(0.0, None), (None, None), (22.0, False), (30.0, False)]
)
def test_without_a_sensor_the_airspeed_follows_from_the_wind_or_the_cruise(
    airspeed_mps: float | None, usable: bool | None
) -> None:
    own = shown(flying_north(), airspeed_mps, usable=usable)
    own.airspeed.cruise_mps = 21.0
    assert own.measured_airspeed_mps() is None
    assert own.airspeed_mps() == 21.0
    own.wind.report(Wind(AUTOPILOT, 8.0, 0.0), 9.5)
    assert own.airspeed_mps() == pytest.approx(22.0)
    command = own.command(own.guidance(), 0.5)
    assert command is not None
    assert command.airspeed_mps is None


def test_ground_speed_shown_as_airspeed_is_no_airspeed() -> None:
    own = shown(flying_north(), 30.0, usable=None)
    assert own.measured_airspeed_mps() == 30.0, "without a wind nothing contradicts it"
    own.wind.report(Wind(AUTOPILOT, 8.0, 0.0), 9.5)
    assert own.measured_airspeed_mps() is None
    assert own.airspeed_mps() == pytest.approx(22.0)


def test_an_old_airspeed_does_not_count() -> None:
    own = shown(flying_north(), 22.0)
    own.observe_position(OwnPosition(AUTOPILOT, 15.0, 47.0, 8.0, 500.0, 100.0, (30.0, 0.0, 0.0), 0.0), 15.0)
    assert own.measured_airspeed_mps() is None


def test_the_statement_about_the_sensor_is_awaited_before_a_speed_is_commanded() -> None:
    own = flying_north()
    own.observe_air_data(AirData(AUTOPILOT, 22.0, 500.0), 9.0)
    assert own.measured_airspeed_mps() is None
    assert own.airspeed_mps() == 22.0, "for predictions"
    own.airspeed.sensor_usable = True
    assert own.measured_airspeed_mps() == 22.0


def test_a_wind_that_makes_no_sense_is_not_used_for_the_airspeed() -> None:
    own = shown(flying_north(), 0.0, usable=False)
    own.airspeed.cruise_mps = 21.0
    own.wind.report(Wind(AUTOPILOT, 25.0, 0.0), 9.5)
    assert own.airspeed_mps() == 21.0
