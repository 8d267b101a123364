"""Position, velocity, airspeed and the heights of commands."""

import math

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import AirData, OwnPosition, Sender
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
