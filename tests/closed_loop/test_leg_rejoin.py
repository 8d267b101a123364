"""After an avoidance on a mission the aircraft is back on its leg and its height, and stays there."""

import math

import pytest

from companion.control.state_machine import State
from companion.mavlink.dialect import mavlink
from companion.model import Vec3
from sim.scenario import Autopilot
from sim.vehicle import MissionItem
from sim.vehicle.mission import DO_CHANGE_SPEED, NAV_LOITER_TURNS, NAV_LOITER_UNLIM
from tests.support.autopilots import ARDUPILOT, MISSION_MODE, PX4, PX4_1_18, in_turn, ways
from tests.support.leg_loop import LegLoop, jump
from tests.support.thorough import sample

A: Vec3 = (400.0, 0.0, 300.0)
# How long it must stay on its leg and height [s].
STAYS_S = sample(10.0, 30.0)


def on_the_second_leg(loop: LegLoop, after_s: float = 12.0) -> None:
    """Fly past the first waypoint."""
    loop.until_true(lambda: loop.world.vehicle.truth.mission_sequence > loop.first)
    loop.run(after_s)


@in_turn("end", [(9000.0, 0.0, 300.0), (6000.0, 5000.0, 300.0), (9000.0, 0.0, 180.0)])
def test_back_on_the_leg_and_its_slope(autopilot: Autopilot, end: Vec3) -> None:
    loop = LegLoop([A, end], autopilot=autopilot)
    on_the_second_leg(loop)
    loop.avoid()
    assert "Clear of traffic, returning to leg" in loop.flight.texts
    loop.stays_on(A, end, STAYS_S)
    assert loop.mode_name == MISSION_MODE[autopilot]
    assert loop.flight.engagements == 1
    # Without an item that says so.
    assert not [what for _, what in loop.sent if what == f"COMMAND_LONG {DO_CHANGE_SPEED}"]


def test_arduplane_is_given_back_in_the_middle_of_a_climbing_leg() -> None:
    end = (9000.0, 0.0, 420.0)
    loop = LegLoop([A, end])
    on_the_second_leg(loop)
    loop.avoid()
    assert loop.world.vehicle.truth.position_m[0] < 4000.0
    loop.stays_on(A, end, sample(20.0, 60.0))


def test_px4_is_flown_up_its_climbing_leg_until_it_would_not_climb_in_a_loiter() -> None:
    end = (6000.0, 0.0, 360.0)
    loop = LegLoop([A, end], autopilot="px4")
    on_the_second_leg(loop)
    loop.intrude(3500.0)
    loop.until(State.RETURNING)
    loop.run(60.0)
    while loop.world.vehicle.truth.mission_sequence == loop.first + 1:
        loop.stays_on(A, end, 1.0)
        if loop.world.vehicle.truth.position_m[0] > 5850.0:
            break
    assert loop.state is State.MONITOR


@ways(PX4_1_18)
def test_the_leg_after_a_corner_follows(autopilot: Autopilot) -> None:
    """The corner comes soon after the avoidance: too short to join the leg, but the next one is flown."""
    corner, end = (3600.0, 0.0, 300.0), (3600.0, 8000.0, 340.0)
    loop = LegLoop([A, corner, end], autopilot=autopilot)
    on_the_second_leg(loop)
    loop.avoid()
    assert loop.world.vehicle.truth.mission_sequence == loop.first + 1
    loop.until_true(lambda: loop.world.vehicle.truth.mission_sequence == loop.first + 2, 200.0)
    loop.run(25.0)
    loop.stays_on(corner, end, STAYS_S)


@ways(PX4)
def test_the_leg_after_a_jump_begins_where_the_jump_was(autopilot: Autopilot) -> None:
    b, c = (500.0, 1500.0, 300.0), (-2000.0, 1500.0, 300.0)
    loop = LegLoop([A, b, c, jump(2 if autopilot == "ardupilot" else 1, -1)], autopilot=autopilot)
    loop.until_true(lambda: loop.world.vehicle.truth.mission_sequence == loop.first + 2, 300.0)
    loop.until_true(lambda: loop.world.vehicle.truth.mission_sequence == loop.first, 300.0)
    loop.run(20.0)
    before_m = loop.off_m(c, A)
    assert abs(before_m[0]) < 30.0
    loop.avoid(2000.0)
    assert loop.world.vehicle.truth.mission_sequence == loop.first
    loop.stays_on(c, A, 10.0)


@ways(ARDUPILOT)
def test_a_loiter_is_resumed_at_its_height(autopilot: Autopilot) -> None:
    place: Vec3 = (1500.0, 0.0, 300.0)
    loop = LegLoop([A], autopilot=autopilot)
    at, params = loop.item(place), (0.0, 0.0, 90.0, 0.0)
    loop.load([MissionItem(NAV_LOITER_UNLIM, params, at.lat_e7, at.lon_e7, at.altitude_m, 0)], loop.first)
    loop.until_true(lambda: math.dist(loop.world.vehicle.truth.position_m[:2], place[:2]) < 110.0)
    loop.run(12.0)
    loop.intrude(3500.0, speed_mps=50.0)
    loop.until(State.OUTER, State.INNER, limit_s=80.0)
    loop.until(State.MONITOR, limit_s=200.0)
    loop.run(25.0)
    for _ in range(sample(15, 30)):
        loop.run(1.0)
        away_m = math.dist(loop.world.vehicle.truth.position_m[:2], place[:2])
        assert abs(away_m - 90.0) < 30.0
        assert abs(loop.height_m - 300.0) < 10.0
    assert loop.flight.engagements == 1


@ways(PX4_1_18)
def test_the_leg_from_a_loiter(autopilot: Autopilot) -> None:
    loop = LegLoop([A], autopilot=autopilot)
    at, end = loop.item(A), (800.0, 7000.0, 360.0 if autopilot == "ardupilot" else 240.0)
    circle = MissionItem(NAV_LOITER_TURNS, (1.0, 0.0, 90.0, 0.0), at.lat_e7, at.lon_e7, at.altitude_m, 0)
    loop.load([circle, end], loop.first)
    on_the_second_leg(loop, 25.0)
    loop.avoid(3000.0)
    loop.stays_on(A, end, STAYS_S)


@ways(ARDUPILOT)
def test_a_conflict_on_the_way_back_is_avoided(autopilot: Autopilot) -> None:
    end = (12_000.0, 0.0, 300.0)
    loop = LegLoop([A, end], autopilot=autopilot)
    on_the_second_leg(loop)
    loop.intrude(3500.0)
    loop.until(State.RETURNING)
    second = loop.intrude(2500.0, named=(0xBBBBBB, "SECOND"))
    loop.until(State.OUTER, State.INNER, limit_s=10.0)
    nearest_m = math.inf
    while loop.state is not State.MONITOR:
        loop.run(0.5)
        here_m, (there_m, _) = loop.world.vehicle.truth.position_m, second.state_at(loop.now_s)
        apart = math.dist(here_m[:2], there_m[:2]) / 609.6, abs(here_m[2] - there_m[2]) / 76.2
        nearest_m = min(nearest_m, max(apart))
    assert nearest_m > 0.9
    assert loop.flight.engagements == 1, "flown all the time"
    loop.stays_on(A, end, STAYS_S)


@ways(PX4)
def test_resume_now_skips_the_way_back(autopilot: Autopilot) -> None:
    loop = LegLoop([A, (9000.0, 0.0, 300.0)], autopilot=autopilot)
    on_the_second_leg(loop)
    loop.intrude(3500.0)
    loop.until(State.RETURNING)
    loop.send_to_companion(
        mavlink.MAVLink_command_long_message(
            1, 196, mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0, 1, 0, 0, 0, 0, 0, 0
        )
    )
    assert loop.state is State.RELEASING
    loop.until(State.MONITOR, limit_s=5.0)
    assert loop.mode_name == MISSION_MODE[autopilot]


WINDS_MPS = [(0.0, 12.0), (-13.0, 0.0), (13.0, 0.0)]


@in_turn("wind_mps", sample(WINDS_MPS[:1], WINDS_MPS), first=1)
def test_in_a_strong_wind(autopilot: Autopilot, wind_mps: tuple[float, float]) -> None:
    end = (14_000.0, 0.0, 300.0)
    loop = LegLoop([A, end], autopilot=autopilot, wind_mps=wind_mps)
    on_the_second_leg(loop)
    loop.avoid()
    loop.stays_on(A, end, STAYS_S)


@ways(ARDUPILOT)
def test_a_wind_that_blows_away_ends_the_way_in_time(autopilot: Autopilot) -> None:
    loop = LegLoop([A, (9000.0, 0.0, 300.0)], autopilot=autopilot)
    on_the_second_leg(loop)
    loop.intrude(3500.0)
    loop.until(State.RETURNING)
    aircraft = loop.world.vehicle.flight.aircraft
    aircraft.wind_east_mps = 40.0
    loop.until(State.MONITOR, limit_s=190.0)
    assert loop.mode_name == MISSION_MODE[autopilot]


# --- the leg of another mission, another item


@ways(PX4_1_18)
def test_another_item_selected_meanwhile_is_flown_to_at_its_height(autopilot: Autopilot) -> None:
    loop = LegLoop([A, (9000.0, 0.0, 300.0), (4000.0, 6000.0, 260.0)], autopilot=autopilot)
    on_the_second_leg(loop)
    loop.intrude(3500.0)
    loop.until(State.OUTER)
    loop.run(5.0)
    loop.world.vehicle.flight.select_item(loop.first + 2)
    loop.until(State.MONITOR, limit_s=200.0)
    assert "Clear of traffic, returning to leg" not in loop.flight.texts
    assert loop.world.vehicle.truth.mission_sequence == loop.first + 2
    assert abs(loop.height_m - 260.0) < 10.0


@ways(PX4)
def test_a_mission_changed_meanwhile_is_flown_as_it_is_now(autopilot: Autopilot) -> None:
    loop = LegLoop([A, (9000.0, 0.0, 300.0)], autopilot=autopilot)
    on_the_second_leg(loop)
    loop.intrude(3500.0)
    loop.until(State.OUTER)
    loop.load([A, (5000.0, 4000.0, 250.0), (5000.0, 9000.0, 250.0)], loop.first + 1)
    loop.until(State.MONITOR, limit_s=200.0)
    assert "Clear of traffic, returning to leg" not in loop.flight.texts
    assert abs(loop.height_m - 250.0) < 10.0


def test_after_a_pilots_detour_the_straight_way_is_the_leg() -> None:
    """The pilot flew 700 m aside and entered AUTO there: the line from there is flown back to."""
    loop = LegLoop([A, (12_000.0, 0.0, 300.0)])
    on_the_second_leg(loop)
    loop.world.vehicle.set_mode("FBWA")
    loop.run(2.0)
    aircraft = loop.world.vehicle.flight.aircraft
    aircraft.east_m = 700.0
    loop.run(6.0)  # a place so far away counts only after some seconds
    start = (*loop.world.vehicle.truth.position_m[:2], 300.0)
    loop.world.vehicle.set_mode("AUTO")
    loop.run(15.0)
    loop.avoid()
    loop.stays_on(start, (12_000.0, 0.0, 300.0), STAYS_S)


# --- the configuration


@ways(PX4_1_18)
def test_off_gives_back_at_once(autopilot: Autopilot) -> None:
    loop = LegLoop([A, (9000.0, 0.0, 300.0)], autopilot=autopilot, rejoin="off")
    on_the_second_leg(loop)
    loop.avoid()
    assert State.RETURNING not in [state for _, state, _ in loop.states]


def test_direct_returns_to_the_height_only() -> None:
    loop = LegLoop([A, (9000.0, 0.0, 300.0)], rejoin="direct")
    on_the_second_leg(loop)
    loop.avoid()
    assert "Clear of traffic, returning to next item" in loop.flight.texts
    assert abs(loop.height_m - 300.0) < 10.0


# --- the mission's speed (A16)


@in_turn("speed_mps", sample([27.0, 17.0], [27.0, 17.0, 27.0]))
def test_the_missions_speed_is_flown_again(autopilot: Autopilot, speed_mps: float) -> None:
    speed = MissionItem(DO_CHANGE_SPEED, params=(0.0, speed_mps, -1.0, 0.0), frame=2)
    if autopilot == "px4" and speed_mps > 20.0:
        pytest.skip("faster than this aircraft")
    loop = LegLoop([A, speed, (12_000.0, 0.0, 300.0)], autopilot=autopilot)
    on_the_second_leg(loop)
    # PX4 changes its speed slowly.
    loop.until_true(lambda: abs(loop.world.vehicle.truth.airspeed_mps - speed_mps) < 0.5, 50.0)
    loop.run(3.0)
    loop.avoid()
    loop.run(20.0)
    assert loop.world.vehicle.truth.airspeed_mps == pytest.approx(speed_mps, abs=1.0)
