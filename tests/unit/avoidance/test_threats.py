"""The threats of a decision: position, motion, and how near the mission would come."""

import math

import pytest

from companion.avoidance import AvoidanceParams, Avoider
from companion.model import Goal, Ownship, Threat, Track, TrafficKind

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)
GOAL = Goal(course_rad=0.0, airspeed_mps=22.0, altitude_m=300.0)


def threat_of(track: Track) -> Threat:
    at_once = AvoidanceParams(reserve_s=60.0)  # no conflict waits
    return Avoider(at_once).decide(0.0, OWN, [track], GOAL).threats[0]


@pytest.mark.parametrize(("down_m", "miss_m"), [(-330.0, 0.0), (-270.0, 30.0)])
def test_an_obstacle_is_missed_only_above_its_top(down_m: float, miss_m: float) -> None:
    mast = Track("M", 0.0, (600.0, 10.0, down_m), (0.0, 0.0, 0.0), kind=TrafficKind.OBSTACLE)
    assert threat_of(mast).miss_vertical_m == pytest.approx(miss_m)


def test_a_threat_has_its_position_and_its_miss_distances_on_the_mission() -> None:
    crossing = Track("A", 0.0, (1000.0, 1500.0, -320.0), (0.0, -30.0, -0.5), icao=0xABCDEF)
    threat = threat_of(crossing)
    assert (threat.track_id, threat.icao) == ("A", 0xABCDEF)
    assert threat.distance_m == pytest.approx(math.hypot(1000.0, 1500.0))
    assert threat.relative_altitude_m == pytest.approx(20.0)
    assert threat.bearing_rad == pytest.approx(math.atan2(1500.0, 1000.0))
    closest_s = (1000.0 * 22.0 + 1500.0 * 30.0) / (22.0**2 + 30.0**2)
    assert threat.time_to_closest_s == pytest.approx(closest_s)
    north_m, east_m = 1000.0 - 22.0 * closest_s, 1500.0 - 30.0 * closest_s
    assert threat.miss_horizontal_m == pytest.approx(math.hypot(north_m, east_m))
    assert threat.miss_vertical_m == pytest.approx(20.0 + 0.5 * closest_s)
