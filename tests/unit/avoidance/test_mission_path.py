"""The mission flown ahead: along a leg and its slope, back to it, past the next waypoint, around a circle."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.avoidance import Avoider
from companion.avoidance.leg import STEEPEST_RAD, beside_leg
from companion.avoidance.mission_path import OwnFlight, mission_path, with_path
from companion.avoidance.params import AvoidanceParams
from companion.avoidance.trajectory import TIMES_S, Array, Envelope
from companion.model import Goal, Layer, Ownship, Track, Vec3

ENVELOPE = Envelope()
END: Vec3 = (4000.0, 0.0, -300.0)
AT_ONCE = AvoidanceParams(reserve_s=60.0)  # no conflict waits
LEG = Goal(position_m=END, airspeed_mps=22.0, leg_from_m=(-1000.0, 0.0, -300.0))


def own(
    north_m: float = 0.0, east_m: float = 0.0, height_m: float = 300.0, course_rad: float = 0.0
) -> Ownship:
    velocity = 22.0 * math.cos(course_rad), 22.0 * math.sin(course_rad), 0.0
    return Ownship(0.0, (north_m, east_m, -height_m), velocity, 22.0, course_rad)


def ahead(goal: Goal, at: Ownship) -> tuple[OwnFlight, Array, Array]:
    """The flight, and its path: north and east (T, 2), and heights (T,)."""
    flight = OwnFlight.at(0.0, at, goal)
    paths = mission_path(flight, ENVELOPE)
    return flight, paths.ground_m[0], paths.altitude_m[0]


def test_on_a_level_leg_the_path_is_the_straight_way() -> None:
    flight, ground_m, altitude_m = ahead(LEG, own())
    straight, straight_m, straight_altitude_m = ahead(replace(LEG, leg_from_m=None), own())
    assert not flight.bends
    assert np.array_equal(ground_m, straight_m)
    assert np.array_equal(altitude_m, straight_altitude_m)
    assert flight.onward_mps == straight.onward_mps


def test_from_beside_the_leg_the_path_joins_it() -> None:
    flight, ground_m, _ = ahead(LEG, own(east_m=600.0))
    assert flight.bends
    assert flight.mission.course_rad == pytest.approx(-STEEPEST_RAD)
    assert np.abs(ground_m[TIMES_S > 60.0, 1]).max() < 1.0
    assert ground_m[-1, 0] > 1500.0


def test_a_slope_is_flown_at_its_height() -> None:
    goal = replace(LEG, position_m=(4000.0, 0.0, -400.0))
    _, ground_m, altitude_m = ahead(goal, own(height_m=320.0))
    assert altitude_m == pytest.approx(320.0 + ground_m[:, 0] / 50.0, abs=0.5)
    _, ground_m, altitude_m = ahead(goal, own(height_m=410.0))
    assert altitude_m[0] == pytest.approx(410.0)
    assert altitude_m[-1] == pytest.approx(320.0 + ground_m[-1, 0] / 50.0, abs=0.5)


def test_past_the_waypoint_the_path_follows_the_next_leg() -> None:
    goal = replace(LEG, position_m=(880.0, 0.0, -300.0), then_m=(880.0, 3000.0, -400.0))
    flight, ground_m, altitude_m = ahead(goal, own())
    assert flight.bends
    assert ground_m[-1] == pytest.approx([880.0, 50.0 * 22.0], abs=60.0)
    assert altitude_m[-1] == pytest.approx(300.0 + 100.0 * 1100.0 / 3000.0, abs=5.0)
    straight_on = replace(goal, then_m=(4000.0, 0.0, -300.0))
    assert not OwnFlight.at(0.0, own(), straight_on).bends
    assert not OwnFlight.at(0.0, own(), replace(goal, position_m=END)).bends, "after the horizon"


def test_a_missed_waypoint_near_by_is_turned_back_to() -> None:
    goal = replace(LEG, position_m=(0.0, 0.0, -300.0), then_m=(3000.0, 0.0, -300.0))
    flight = with_path(OwnFlight.at(0.0, own(200.0, 150.0), goal), ENVELOPE)
    assert flight.ahead is not None
    ground_m = flight.ahead.ground_m[0]
    assert ground_m[:, 0].min() < 150.0
    assert ground_m[-1, 0] > 600.0


@pytest.mark.parametrize("radius_m", [90.0, -90.0])
def test_a_loiter_is_circled(radius_m: float) -> None:
    goal = Goal(position_m=(0.0, 0.0, -300.0), airspeed_mps=22.0, loiter_radius_m=radius_m)
    flight = with_path(OwnFlight.at(0.0, own(0.0, -90.0), goal), ENVELOPE)
    assert flight.circles
    assert flight.ahead is not None
    ground_m = flight.ahead.ground_m[0]
    assert np.hypot(*ground_m.T) == pytest.approx(90.0, abs=1.0)
    assert math.hypot(*flight.onward_mps) < 8.0
    turned = np.unwrap(np.arctan2(ground_m[:8, 1], ground_m[:8, 0]))
    assert math.copysign(1.0, turned[-1] - turned[0]) == math.copysign(1.0, radius_m)
    _, ground_m, _ = ahead(goal, own(-900.0, 0.0))
    assert np.hypot(*ground_m[TIMES_S > 45.0].T).max() < 130.0


def test_circling_beside_traffic_is_no_conflict_on_every_side() -> None:
    """An aircraft that passes 1500 m from the circle is never a conflict, wherever we are on the circle."""
    goal = Goal(position_m=(0.0, 0.0, -300.0), airspeed_mps=22.0, loiter_radius_m=90.0)
    for bearing_rad in np.arange(0.0, math.tau, 0.3):
        here = own(
            90.0 * math.cos(bearing_rad), 90.0 * math.sin(bearing_rad), 300.0, bearing_rad + math.pi / 2
        )
        passer = Track("P", 0.0, (2500.0, 1500.0, -300.0), (-50.0, 0.0, 0.0))
        assert Avoider(AT_ONCE).decide(0.0, here, [passer], goal).layer is Layer.CLEAR
        through = replace(passer, position_m=(2500.0, 0.0, -300.0))
        assert Avoider(AT_ONCE).decide(0.0, here, [through], goal).layer is not Layer.CLEAR


def test_traffic_on_the_leg_is_a_conflict_of_the_way_back() -> None:
    """Straight to the waypoint we would pass clear of it; on the way back to the leg we would not."""
    waits = Track("W", 0.0, (1800.0, -200.0, -300.0), (0.0, 0.0, 0.0))
    here = own(0.0, 900.0, 300.0, -0.2)
    far = replace(LEG, position_m=(20_000.0, 0.0, -300.0))
    direct = Avoider(AT_ONCE).decide(0.0, here, [waits], replace(far, leg_from_m=None))
    assert direct.layer is Layer.CLEAR
    assert Avoider(AT_ONCE).decide(0.0, here, [waits], far).layer is not Layer.CLEAR


@given(
    aside_m=st.floats(-3000.0, 3000.0), along_m=st.floats(-500.0, 9000.0), speed_mps=st.floats(10.0, 60.0),
    course_rad=st.floats(-math.pi, math.pi), rise_m=st.floats(-300.0, 300.0),
)  # fmt: skip
def test_the_way_onto_a_leg_is_gentle_and_toward_it(
    aside_m: float, along_m: float, speed_mps: float, course_rad: float, rise_m: float
) -> None:
    along_n, along_e = math.cos(course_rad), math.sin(course_rad)
    start_m, end_m = (0.0, 0.0, -300.0), (10_000.0 * along_n, 10_000.0 * along_e, -300.0 - rise_m)
    here_m = (along_m * along_n - aside_m * along_e, along_m * along_e + aside_m * along_n, -500.0)
    beside = beside_leg(start_m, end_m, here_m)
    assert beside is not None
    assert beside.aside_m == pytest.approx(aside_m, abs=1e-6)
    assert beside.to_go_m == pytest.approx(10_000.0 - along_m, abs=1e-6)
    assert min(300.0, 300.0 + rise_m) - 1e-6 <= beside.altitude_m <= max(300.0, 300.0 + rise_m) + 1e-6
    turn_rad = math.remainder(beside.join_rad(speed_mps) - beside.course_rad, math.tau)
    assert abs(turn_rad) <= STEEPEST_RAD + 1e-9
    assert turn_rad * aside_m <= 1e-9
    if beside.is_too_short(speed_mps):
        assert beside.to_go_m <= 0.0 or abs(aside_m) > 30.0


def test_a_leg_without_length_is_none() -> None:
    assert beside_leg(END, END, (0.0, 0.0, 0.0)) is None
    flight, ground_m, _ = ahead(replace(LEG, leg_from_m=END), own())
    assert flight.beside is None
    assert np.isfinite(ground_m).all()


def test_a_leg_that_is_not_finite_is_refused() -> None:
    for goal in (
        replace(LEG, leg_from_m=(math.nan, 0.0, 0.0)),
        replace(LEG, then_m=(0.0, math.inf, 0.0)),
        replace(LEG, loiter_radius_m=math.nan),
    ):
        with pytest.raises(ValueError, match="finite"):
            Avoider(AvoidanceParams()).decide(0.0, own(), [], goal)


@pytest.mark.parametrize("end_m", [425.0, 175.0])
def test_a_line_that_is_too_steep_is_left_behind(end_m: float) -> None:
    """As where the mission is entered beside its height, a little before a waypoint."""
    goal = Goal(position_m=(150.0, 0.0, -end_m), airspeed_mps=22.0, leg_from_m=(0.0, 0.0, -300.0))
    goal = replace(goal, then_m=(3000.0, 0.0, -end_m))
    flight = with_path(OwnFlight.at(0.0, own(north_m=10.0), goal), ENVELOPE, 90.0)
    altitude_m = mission_path(flight, ENVELOPE).altitude_m[0]
    rates_mps = np.diff(altitude_m) / np.diff(TIMES_S)
    assert rates_mps.max() <= ENVELOPE.max_climb_mps + 1e-6
    assert rates_mps.min() >= -ENVELOPE.max_sink_mps - 1e-6
