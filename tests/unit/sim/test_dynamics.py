"""The point mass against physics and against measurements on ArduPlane."""

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.geodesy import wrap_pi
from companion.model import Vec2
from companion.units import STANDARD_GRAVITY_MPS2
from sim.airframe import ARDUPLANE
from sim.compiled.airframe_step import line_bank_rad
from sim.dynamics import Airframe, FixedWing, heading_for_course_rad
from sim.vehicle.flight import true_per_indicated

STEP_S = 0.05
BANK_OF_5_MPS2 = math.atan(5.0 / STANDARD_GRAVITY_MPS2)


def fly(aircraft: FixedWing, seconds: float) -> None:
    for _ in range(round(seconds / STEP_S)):
        aircraft.step(STEP_S)


@settings(derandomize=True, deadline=None)
@given(
    bank_deg=st.floats(-44.0, 44.0),
    airspeed_mps=st.floats(12.0, 30.0),
)
def test_a_steady_turn_is_a_share_of_g_tan_bank_over_v(bank_deg: float, airspeed_mps: float) -> None:
    aircraft = FixedWing(airspeed_mps=airspeed_mps)
    aircraft.hold_bank(math.radians(bank_deg))
    fly(aircraft, 5.0)
    before_rad = aircraft.heading_rad
    fly(aircraft, 1.0)
    turned_rad = wrap_pi(aircraft.heading_rad - before_rad)
    assert turned_rad == pytest.approx(
        Airframe().turn_share * STANDARD_GRAVITY_MPS2 * math.tan(math.radians(bank_deg)) / airspeed_mps,
        abs=2e-4,
    )


@settings(derandomize=True, deadline=None)
@given(
    bank_deg=st.floats(-180.0, 180.0),
    climb_mps=st.floats(-50.0, 50.0),
    airspeed_mps=st.floats(0.0, 99.0),
    seconds=st.floats(0.05, 8.0),
)
def test_limits_hold_for_any_command(
    bank_deg: float, climb_mps: float, airspeed_mps: float, seconds: float
) -> None:
    frame = Airframe()
    aircraft = FixedWing()
    aircraft.hold_bank(math.radians(bank_deg))
    aircraft.hold_climb(climb_mps)
    aircraft.hold_airspeed(airspeed_mps)
    before_mps = aircraft.airspeed_mps
    fly(aircraft, seconds)
    assert abs(aircraft.bank_rad) <= frame.bank_limit_rad + 1e-9
    assert -frame.sink_limit_mps - 1e-9 <= aircraft.climb_mps <= frame.climb_limit_mps + 1e-9
    assert frame.airspeed_min_mps - 1e-9 <= aircraft.airspeed_mps <= frame.airspeed_max_mps + 1e-9
    assert abs(aircraft.airspeed_mps - before_mps) <= frame.acceleration_limit_mps2 * (seconds + STEP_S)


@settings(derandomize=True, deadline=None)
@given(
    course_deg=st.floats(0.0, 359.9),
    start_deg=st.floats(0.0, 359.9),
    north_mps=st.floats(-8.0, 8.0),
    east_mps=st.floats(-8.0, 8.0),
)
def test_course_is_over_ground_in_any_wind(
    course_deg: float, start_deg: float, north_mps: float, east_mps: float
) -> None:
    aircraft = FixedWing(course_rad=math.radians(start_deg), wind_mps=(north_mps, east_mps))
    aircraft.hold_course(math.radians(course_deg))
    fly(aircraft, 60.0)
    before_m = aircraft.position_m
    fly(aircraft, 10.0)
    after_m = aircraft.position_m
    made_good_rad = math.atan2(after_m[1] - before_m[1], after_m[0] - before_m[0])
    assert wrap_pi(made_good_rad - math.radians(course_deg)) == pytest.approx(0.0, abs=1e-3)
    assert wrap_pi(aircraft.course_rad - math.radians(course_deg)) == pytest.approx(0.0, abs=1e-3)


def test_ground_velocity_is_air_velocity_plus_wind() -> None:
    aircraft = FixedWing(course_rad=0.0, airspeed_mps=22.0, wind_mps=(2.0, 0.0))
    assert aircraft.velocity_mps == pytest.approx((24.0, 0.0, 0.0))
    fly(aircraft, 10.0)
    assert aircraft.position_m == pytest.approx((240.0, 0.0, 0.0), abs=1e-6)


def test_crabs_into_the_wind() -> None:
    heading_rad = heading_for_course_rad(0.0, 22.0, (0.0, 5.0))
    assert math.degrees(heading_rad) == pytest.approx(360.0 - math.degrees(math.asin(5.0 / 22.0)))


# ArduPlane 4.8-dev as recorded, roll limit 65 degrees: degrees left to turn at seconds after the command, of
# six turns by 45 degrees, and of the only one by 120 degrees that was flown to its end.
RECORDED_45 = {2.0: (23.9, 28.6), 4.0: (13.3, 16.9), 8.0: (4.3, 5.8), 12.0: (1.4, 2.0)}
RECORDED_120 = {2.0: 51.3, 4.0: 35.7, 6.0: 19.5, 8.0: 10.8, 12.0: 3.6}


def left_to_turn_deg(turn_deg: float, times_s: Iterable[float]) -> list[float]:
    """Degrees left of a turn that the recorded aircraft was commanded at 22 m/s, 884 m above the sea."""
    aircraft = FixedWing(airframe=replace(ARDUPLANE, bank_limit_rad=math.radians(65.0)))
    aircraft.true_per_indicated = true_per_indicated(884.0)
    aircraft.hold_course(math.radians(turn_deg))
    left_deg, flown_s = [], 0.0
    for time_s in times_s:
        fly(aircraft, time_s - flown_s)
        left_deg.append(turn_deg - math.degrees(aircraft.course_rad))
        flown_s = time_s
    return left_deg


def test_turns_by_45_degrees_as_arduplane_48_was_recorded() -> None:
    for left_deg, (least, most) in zip(
        left_to_turn_deg(45.0, RECORDED_45), RECORDED_45.values(), strict=True
    ):
        assert least <= left_deg <= most
    # Within 4 degrees of the course it was after 8.4 to 9.4 s.
    before_deg, after_deg = left_to_turn_deg(45.0, (8.4, 9.4))
    assert after_deg < 4.0 < before_deg + 0.2


def test_a_turn_by_120_degrees_as_arduplane_48_was_recorded() -> None:
    left_deg = left_to_turn_deg(120.0, RECORDED_120)
    assert left_deg == pytest.approx(list(RECORDED_120.values()), abs=8.5)
    assert left_deg[-1] == pytest.approx(3.6, abs=1.0)


def test_the_turn_rate_is_the_one_measured_on_arduplane_47() -> None:
    """About 9 degrees a second with p3 = 5; a coordinated turn would have 13.

    The end of a turn is that of 4.8: 4.7 came from course 91 to 14 in 9.5 s when commanded to fly 10.
    """
    aircraft = FixedWing(course_rad=math.radians(91.0))
    aircraft.hold_course(math.radians(10.0), BANK_OF_5_MPS2)
    fastest_rps = 0.0
    for _ in range(200):
        aircraft.step(STEP_S)
        fastest_rps = max(fastest_rps, abs(aircraft.turn_rate_rps))
    assert math.degrees(fastest_rps) == pytest.approx(9.0, abs=0.5)
    fly(aircraft, 25.0)
    assert math.degrees(aircraft.course_rad) == pytest.approx(10.0, abs=0.1)


def test_turns_the_short_way() -> None:
    aircraft = FixedWing(course_rad=math.radians(350.0))
    aircraft.hold_course(math.radians(20.0))
    aircraft.step(STEP_S)
    assert aircraft.bank_rad > 0.0


def test_climbs_at_the_measured_rate_without_overshoot() -> None:
    aircraft = FixedWing()
    aircraft.hold_altitude(60.0)
    highest_m, fastest_mps = 0.0, 0.0
    for _ in range(800):
        aircraft.step(STEP_S)
        highest_m = max(highest_m, aircraft.altitude_m)
        fastest_mps = max(fastest_mps, aircraft.climb_mps)
    assert fastest_mps == pytest.approx(4.8, abs=0.05)
    assert aircraft.altitude_m == pytest.approx(60.0, abs=0.05)
    assert highest_m < 60.2


def test_the_step_length_hardly_matters() -> None:
    coarse, fine = FixedWing(), FixedWing()
    for aircraft, step_s in ((coarse, 0.05), (fine, 0.005)):
        aircraft.hold_course(math.radians(120.0))
        aircraft.hold_altitude(30.0)
        for _ in range(round(20.0 / step_s)):
            aircraft.step(step_s)
    assert math.dist(coarse.position_m, fine.position_m) < 2.0


def test_the_same_inputs_give_the_same_bits() -> None:
    places = []
    for _ in range(2):
        aircraft = FixedWing(wind_mps=(1.0, -3.0))
        aircraft.hold_course(2.0)
        fly(aircraft, 30.0)
        places.append((aircraft.position_m, aircraft.velocity_mps))
    assert places[0] == places[1]


def test_the_displacement_in_a_turn_is_halfway_between_the_headings() -> None:
    aircraft = FixedWing()
    aircraft.hold_bank(math.radians(30.0))
    fly(aircraft, 5.0)
    before_rad, before_m = aircraft.heading_rad, aircraft.position_m
    aircraft.step(STEP_S)
    north_m, east_m = aircraft.north_m - before_m[0], aircraft.east_m - before_m[1]
    halfway_rad = before_rad + 0.5 * wrap_pi(aircraft.heading_rad - before_rad)
    assert wrap_pi(math.atan2(east_m, north_m) - halfway_rad) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("line_m", [None, ((0.0, 0.0), (900.0, 300.0))])
def test_several_steps_at_once_are_the_same_steps(line_m: tuple[Vec2, Vec2] | None) -> None:
    together, singly = FixedWing(wind_mps=(1.0, -3.0)), FixedWing(wind_mps=(1.0, -3.0))
    places_m = []
    for aircraft in (together, singly):
        aircraft.hold_course(0.4)
        aircraft.hold_altitude(25.0)
        aircraft.hold_airspeed(26.0)
    for _ in range(40):
        if line_m is not None:
            here_m = singly.north_m, singly.east_m
            singly.hold_bank(line_bank_rad(here_m, singly.ground_velocity_mps, *line_m))
        singly.step(STEP_S)
        places_m.append(singly.position_m)
    flown_m = np.concatenate([together.fly(15, STEP_S, line_m), together.fly(25, STEP_S, line_m)])
    assert flown_m.tolist() == [list(place_m) for place_m in places_m]
