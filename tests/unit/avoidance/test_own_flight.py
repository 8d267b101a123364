"""Ownship and its mission: wind, course, horizon, and inputs that are refused."""

import math
from dataclasses import replace

import pytest

from companion.avoidance.avoider import require_finite
from companion.avoidance.mission_path import OwnFlight
from companion.avoidance.trajectory import HORIZON_S, own_state
from companion.model import Goal, Ownship

OWN = Ownship(0.0, (0.0, 0.0, -300.0), (22.0, 0.0, 0.0), 22.0, 0.0)


def test_the_state_is_extrapolated_to_now() -> None:
    assert own_state(2.0, OWN).position_m == (44.0, 0.0, -300.0)


def test_without_a_report_the_wind_is_the_ground_velocity_less_the_airspeed() -> None:
    assert own_state(0.0, replace(OWN, velocity_mps=(27.0, 3.0, 0.0))).wind_mps == pytest.approx((5.0, 3.0))


def test_an_implied_wind_above_60_percent_of_airspeed_is_rejected() -> None:
    backwards = replace(OWN, heading_rad=math.pi)
    assert own_state(0.0, backwards).wind_mps == (0.0, 0.0)


def test_the_heading_is_kept_only_in_a_wind_stronger_than_the_airspeed() -> None:
    assert own_state(0.0, replace(OWN, wind_mps=(0.0, 21.0))).heading_rad is None
    assert own_state(0.0, replace(OWN, wind_mps=(0.0, 23.0))).heading_rad == OWN.heading_rad


def test_the_mission_leads_to_the_position_of_the_goal() -> None:
    flight = OwnFlight.at(0.0, OWN, Goal(position_m=(0.0, 500.0, -350.0)))
    assert flight.mission.course_rad == pytest.approx(math.pi / 2.0)
    assert (flight.mission.airspeed_mps, flight.mission.altitude_m) == (22.0, 350.0)
    assert flight.onward_mps == pytest.approx((0.0, 22.0))


def test_flights_are_judged_until_the_end_of_the_mission() -> None:
    goal = Goal(position_m=(440.0, 0.0, -300.0), airspeed_mps=22.0)
    passing, ending = OwnFlight.at(0.0, OWN, goal), OwnFlight.at(0.0, OWN, replace(goal, is_end=True))
    assert passing.horizon_s == HORIZON_S
    assert ending.horizon_s == passing.time_to_goal_s == pytest.approx(20.0)
    assert OwnFlight.at(0.0, OWN, Goal(course_rad=0.0, is_end=True)).horizon_s == HORIZON_S


def test_an_aircraft_that_is_blown_back_is_judged_until_the_horizon() -> None:
    goal = Goal(position_m=(440.0, 0.0, -300.0), airspeed_mps=22.0, is_end=True)
    assert OwnFlight.at(0.0, replace(OWN, wind_mps=(-30.0, 0.0)), goal).horizon_s == HORIZON_S


@pytest.mark.parametrize(
    ("own", "goal"),
    [
        (replace(OWN, heading_rad=math.nan), Goal(course_rad=0.0)),
        (replace(OWN, wind_mps=(math.inf, 0.0)), Goal(course_rad=0.0)),
        (OWN, Goal(course_rad=math.nan)),
        (OWN, Goal(position_m=(0.0, math.inf, 0.0))),
    ],
)
def test_values_that_are_not_finite_are_refused(own: Ownship, goal: Goal) -> None:
    require_finite(OWN, Goal(course_rad=0.0))
    with pytest.raises(ValueError, match="not finite"):
        require_finite(own, goal)


def test_the_mission_states_a_height_also_where_it_is_that_of_the_aircraft() -> None:
    level = Goal(course_rad=0.0, altitude_m=300.0)
    assert OwnFlight.at(0.0, OWN, level).mission_altitude_m == 300.0
    assert OwnFlight.at(0.0, OWN, Goal(position_m=(500.0, 0.0, -350.0))).mission_altitude_m == 350.0


def test_a_mission_without_a_height_or_with_an_unknown_one_states_none() -> None:
    assert OwnFlight.at(0.0, OWN, Goal(course_rad=0.0)).mission_altitude_m is None
    unknown = Goal(course_rad=0.0, altitude_m=290.0, height_is_known=False)
    assert OwnFlight.at(0.0, OWN, unknown).mission_altitude_m is None
