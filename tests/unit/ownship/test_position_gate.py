"""Positions of our aircraft, glitches, and two aircraft with one address."""

import math

import pytest

from companion.mavlink.facts import OwnPosition, Sender
from companion.ownship.position_gate import Place, PositionGate

M_PER_DEG = 111_195.0
HZ = 10


def position(at_s: float, north_m: float = 0.0, height_m: float = 300.0) -> OwnPosition:
    lat_deg = 47.0 + (22.0 * at_s + north_m) / M_PER_DEG
    return OwnPosition(Sender(1, 1), at_s, lat_deg, 8.0, height_m, height_m, (22.0, 0.0, 0.0), 0.0)


def judged(offsets_m: dict[range, float], seconds: float = 30.0) -> list[Place]:
    gate, places = PositionGate(), []
    for tick in range(round(seconds * HZ)):
        north_m = next((m for ticks, m in offsets_m.items() if tick in ticks), 0.0)
        places.append(gate.judge(position(tick / HZ, north_m), tick / HZ))
    return places


def test_flight_is_continuous() -> None:
    assert set(judged({})) == {Place.HERE}


@pytest.mark.parametrize("jump_m", [20.0, 100.0, -200.0])
def test_corrections_of_the_estimate_are_believed(jump_m: float) -> None:
    assert set(judged({range(100, 300): jump_m})) == {Place.HERE}


@pytest.mark.parametrize("lasts", [1, 10, 25])
@pytest.mark.parametrize("jump_m", [400.0, 3000.0, -500_000.0])
def test_a_glitch_is_not_believed(lasts: int, jump_m: float) -> None:
    places = judged({range(100, 100 + lasts): jump_m})
    assert places[100 : 100 + lasts] == [Place.ELSEWHERE] * lasts
    assert set(places[:100] + places[100 + lasts :]) == {Place.HERE}


def test_a_place_that_lasts_is_believed_after_three_seconds() -> None:
    places = judged({range(100, 300): 3000.0})
    assert places.index(Place.MOVED) == pytest.approx(131, abs=2)
    assert set(places[135:]) == {Place.HERE}


@pytest.mark.parametrize("apart_m", [400.0, 8000.0])
@pytest.mark.parametrize("each", [1, 2, 5])
def test_two_places_in_turn_are_two_vehicles(apart_m: float, each: int) -> None:
    gate = PositionGate()
    places = [
        gate.judge(position(tick / HZ, apart_m if tick // each % 2 else 0.0), tick / HZ) for tick in range(60)
    ]
    assert Place.TWO_PLACES in places
    assert places.index(Place.TWO_PLACES) <= 5 * each + 2


def test_an_altitude_that_jumps_is_a_glitch_too() -> None:
    gate = PositionGate()
    for tick in range(20):
        gate.judge(position(tick / HZ), tick / HZ)
    assert gate.judge(position(2.0, height_m=1300.0), 2.0) is Place.ELSEWHERE
    assert gate.judge(position(2.1), 2.1) is Place.HERE


def test_after_a_long_silence_any_place_is_believed() -> None:
    gate = PositionGate()
    gate.judge(position(0.0), 0.0)
    assert gate.judge(position(30.0, 50_000.0), 30.0) is Place.HERE


def test_a_turning_aircraft_is_followed_with_two_positions_a_second() -> None:
    gate, north_m, east_m = PositionGate(), 0.0, 0.0
    for tick in range(120):
        course_rad = tick * 0.5 * math.radians(20.0)
        velocity_mps = 30.0 * math.cos(course_rad), 30.0 * math.sin(course_rad), 0.0
        north_m, east_m = north_m + 0.5 * velocity_mps[0], east_m + 0.5 * velocity_mps[1]
        place = 47.0 + north_m / M_PER_DEG, 8.0 + east_m / (M_PER_DEG * math.cos(math.radians(47.0)))
        fact = OwnPosition(Sender(1, 1), tick / 2, *place, 300.0, 300.0, velocity_mps, course_rad)
        assert gate.judge(fact, tick / 2) is Place.HERE
