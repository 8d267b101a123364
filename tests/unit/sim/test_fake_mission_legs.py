"""How the fake autopilots fly missions: sloped lines, lines that begin at a mode change, loiters, jumps."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Heartbeat, OwnPosition
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import frame_to_fact
from sim.vehicle import MissionItem, Mode, Px4Mode, takeoff_item
from sim.vehicle.mission import DO_CHANGE_SPEED, DO_JUMP, NAV_LOITER_TIME, NAV_LOITER_TURNS
from sim.vehicle.navigation import Leg
from tests.support import arduplane_bench as plane
from tests.support import px4_bench as px4

FLIGHTS = Path(__file__).parents[4] / "shared" / "data" / "flights"


def at(item: MissionItem, command: int, *params: float) -> MissionItem:
    padded = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return replace(item, command=command, params=(padded[0], padded[1], padded[2], padded[3]))


def jump(to: int, count: int) -> MissionItem:
    return MissionItem(DO_JUMP, params=(float(to), float(count), 0.0, 0.0), frame=2)


# --- between waypoints


def test_arduplane_flies_the_slope_between_two_waypoints() -> None:
    mission = [takeoff_item(60.0), plane.waypoint(500.0, 0.0), plane.waypoint(3500.0, 0.0, 400.0)]
    bench = plane.airborne(mission=mission)
    for _ in range(145):
        bench.fly(1.0)
        north_m = bench.vehicle.truth.position_m[0]
        if 900.0 < north_m < 3400.0:
            assert plane.height_m(bench) == pytest.approx(300.0 + (north_m - 500.0) / 30.0, abs=7.0)
    assert plane.height_m(bench) > 380.0


def test_px4_flies_the_slope_between_two_waypoints() -> None:
    mission = [takeoff_item(40.0), px4.waypoint(300.0, 0.0), px4.waypoint(2300.0, 0.0, 40.0)]
    bench = px4.airborne(mission=mission)
    for _ in range(140):
        bench.fly(1.0)
        north_m = bench.vehicle.truth.position_m[0]
        if 600.0 < north_m < 2200.0:
            assert bench.height_m() == pytest.approx(100.0 - (north_m - 300.0) * 0.03, abs=7.0)
    assert bench.height_m() < 55.0


# --- a mode change begins a new line


def test_arduplane_given_back_beside_and_above_its_leg_stays_there() -> None:
    """As measured: xtrack against the new line, the height interpolated along it."""
    far = [takeoff_item(60.0), plane.waypoint(58_000.0, 0.0)]
    bench = plane.airborne(mission=far)
    bench.guided()
    aircraft = bench.vehicle.flight.aircraft
    aircraft.east_m, aircraft.altitude_m = 589.0, aircraft.altitude_m + 98.0
    assert bench.by_long(plane.SET_MODE, 1, Mode.AUTO) == 0
    bench.fly(90.0)
    _, east_m, _ = bench.vehicle.truth.position_m
    assert east_m == pytest.approx(570.0, abs=15.0)
    assert plane.height_m(bench) == pytest.approx(300.0 + 98.0 * 0.966, abs=3.0)


def test_px4_given_back_above_its_leg_stays_there() -> None:
    bench = px4.airborne(mission=[takeoff_item(40.0), px4.waypoint(58_000.0, 0.0)], height_m=197.0)
    bench.fly(60.0)
    assert bench.height_m() == pytest.approx(100.0 + 97.0 * 0.985, abs=3.0)


@pytest.mark.parametrize(("below_m", "circles"), [(8.0, False), (17.5, True)])
def test_px4_first_climbs_where_the_item_is_above(below_m: float, circles: bool) -> None:
    """17.5 m as in a recording: at the item's height 10 s later, with a change of course."""
    bench = px4.airborne(mission=[takeoff_item(40.0), px4.waypoint(30_000.0, 0.0)], height_m=100.0 - below_m)
    courses = set()
    for _ in range(8):
        bench.fly(1.0)
        courses.add(round(bench.course_deg() / 10.0) % 36)
    assert (len(courses) > 3) is circles


def test_a_small_difference_of_height_is_flown_at_once_by_arduplane() -> None:
    mission = [takeoff_item(60.0), plane.waypoint(58_000.0, 0.0, 310.0)]
    bench = plane.airborne(mission=mission)
    bench.fly(15.0)
    assert plane.height_m(bench) == pytest.approx(310.0, abs=1.5)


# --- loiters and jumps


@pytest.mark.parametrize(("command", "param"), [(NAV_LOITER_TURNS, 2.0), (NAV_LOITER_TIME, 60.0)])
def test_a_loiter_ends_and_the_leg_begins_at_its_centre(command: int, param: float) -> None:
    circle = at(plane.waypoint(600.0, 0.0), command, param, 0.0, 90.0)
    bench = plane.airborne(mission=[takeoff_item(60.0), circle, plane.waypoint(600.0, 4000.0)])
    bench.fly(40.0)
    assert bench.vehicle.truth.mission_sequence == 2
    assert math.dist(bench.vehicle.truth.position_m[:2], (600.0, 0.0)) < 140.0
    bench.fly(80.0)
    assert bench.vehicle.truth.mission_sequence == 3
    bench.fly(60.0)
    assert bench.vehicle.truth.position_m[0] == pytest.approx(600.0, abs=10.0)


def test_a_jump_is_executed_as_often_as_it_says() -> None:
    corners = [plane.waypoint(800.0, 0.0), plane.waypoint(800.0, 800.0), plane.waypoint(0.0, 800.0)]
    bench = plane.airborne(mission=[takeoff_item(60.0), *corners, jump(2, 1), plane.waypoint(0.0, 5000.0)])
    seen = [2]
    for _ in range(300):
        bench.fly(1.0)
        if bench.vehicle.truth.mission_sequence != seen[-1]:
            seen.append(bench.vehicle.truth.mission_sequence)
    assert seen == [2, 3, 4, 2, 3, 4, 6]


# --- the mission's speed


def test_arduplane_forgets_the_missions_speed_at_a_mode_change_and_px4_does_not() -> None:
    faster = MissionItem(DO_CHANGE_SPEED, params=(0.0, 18.0, -1.0, 0.0), frame=2)
    mission = [takeoff_item(40.0), px4.waypoint(300.0, 0.0), faster, px4.waypoint(20_000.0, 0.0)]
    bench = px4.airborne(mission=mission)
    bench.fly(100.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(18.0, abs=0.5)
    bench.vehicle.set_mode(Px4Mode.HOLD)
    bench.fly(20.0)
    bench.vehicle.set_mode(Px4Mode.MISSION)
    bench.fly(60.0)
    assert bench.vehicle.truth.airspeed_mps == pytest.approx(18.0, abs=0.5)

    faster = replace(faster, params=(0.0, 28.0, -1.0, 0.0))
    ours = plane.airborne(
        mission=[takeoff_item(60.0), plane.waypoint(400.0, 0.0), faster, plane.waypoint(20_000.0, 0.0)]
    )
    ours.fly(50.0)
    assert ours.vehicle.truth.airspeed_mps == pytest.approx(28.0, abs=0.5)
    ours.guided()
    assert ours.by_long(plane.SET_MODE, 1, Mode.AUTO) == 0
    ours.fly(20.0)
    cruise_mps = ours.vehicle.truth.airspeed_mps
    assert cruise_mps < 26.0
    assert ours.by_long(mavlink.MAV_CMD_DO_CHANGE_SPEED, 0, 28.0, -1) == 0
    ours.fly(20.0)
    assert ours.vehicle.truth.airspeed_mps == pytest.approx(28.0, abs=0.5)


# --- against recordings of the real autopilots


def stretches(log: Path, mission_mode: int) -> Iterator[list[OwnPosition]]:
    """The positions of each stretch in the mission's mode, beginning with the mode change."""
    flown: list[OwnPosition] = []
    mode, newest = None, None
    for _, frame in read_tlog(log):
        fact = frame_to_fact(frame, 0.0)
        if isinstance(fact, Heartbeat) and fact.sender.component_id == 1 and fact.custom_mode != mode:
            if flown:
                yield flown
            mode, flown = fact.custom_mode, []
            if mode == mission_mode and newest is not None:
                flown = [newest]
        elif isinstance(fact, OwnPosition) and fact.sender.component_id == 1:
            newest = fact
            if flown:
                flown.append(fact)
    if flown:
        yield flown


@pytest.mark.parametrize(
    ("name", "mission_mode", "height_m"),
    [
        ("arduplane_48_flown_by_companion_basic", Mode.AUTO, 300.0),
        ("arduplane_48_flown_by_companion_hard", Mode.AUTO, 300.0),
        ("px4_118_flown_by_companion", Px4Mode.MISSION, 200.0),
    ],
)
def test_recordings_fly_the_same_lines(name: str, mission_mode: int, height_m: float) -> None:
    """After each giving back, the recorded height is that of the fake's line to the waypoint far away."""
    log = FLIGHTS / f"{name}.tlog"
    if not log.is_file():
        pytest.skip("the recordings are not here")
    compared = 0
    for flown in list(stretches(log, mission_mode))[1:]:
        first = flown[0]
        settled = [one for one in flown if 15.0 <= one.boot_time_s - first.boot_time_s <= 90.0]
        if not settled:
            continue
        begun_m = settled[0].height_above_home_m
        if begun_m < height_m - 5.0 and mission_mode is Px4Mode.MISSION:
            continue  # the climb in a loiter
        frame = LocalFrame(first.lat_deg, first.lon_deg)
        end_m = (50_000.0, 0.0)  # between 58 km and 40 km, from the first to the last
        leg = Leg((0.0, 0.0), end_m, end_m, height_m, begun_m)
        for position in settled[:: max(len(settled) // 20, 1)]:
            here = frame.to_ned_m(GeoPoint(position.lat_deg, position.lon_deg, 0.0))
            assert position.height_above_home_m == pytest.approx(leg.altitude_m(here[:2]), abs=3.0)
            compared += 1
    assert compared > 40
