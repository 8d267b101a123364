"""Positions from compact position reports: sure of the place before it is believed, and of the aircraft."""

import math
from collections.abc import Iterable

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import LatLon
from companion.sources.cpr import CprFrame, CprPositions
from sim.receivers.mode_s import compact_position
from tests.support.adsb_receivers import PLACE, moved

RESOLUTION_M = 5.1  # half of the steps of a position in the air, both ways


def frame(place: GeoPoint, time_s: float, is_odd: bool, is_surface: bool = False) -> CprFrame:
    bits = compact_position(place.lat_deg, place.lon_deg, is_odd=is_odd, is_surface=is_surface)
    return CprFrame(is_odd, bits >> 17 & 0x1FFFF, bits & 0x1FFFF, is_surface, time_s)


def flight(place: GeoPoint, seconds: Iterable[float], north_mps: float = 100.0) -> list[CprFrame]:
    """Even and odd frames in turn, twice a second."""
    return [
        frame(moved(place, north_mps * second, 0.0), second, is_odd=round(2 * second) % 2 == 1)
        for second in seconds
    ]


def halves(begin_s: float, end_s: float) -> list[float]:
    return [begin_s + 0.5 * step for step in range(round(2 * (end_s - begin_s)))]


def off_m(found: LatLon, place: GeoPoint) -> float:
    return math.hypot(*LocalFrame(place.lat_deg, place.lon_deg).to_north_east_m(*found))


@pytest.mark.parametrize(
    "place",
    [
        PLACE,
        GeoPoint(0.0, 0.0, 0.0),
        GeoPoint(-33.9, 151.2, 0.0),
        GeoPoint(10.4704, -179.9999, 0.0),
        GeoPoint(-0.00001, 179.99999, 0.0),
        GeoPoint(64.1, -21.9, 0.0),
        GeoPoint(-77.8, 166.7, 0.0),
        GeoPoint(86.9, 12.0, 0.0),
        GeoPoint(-88.5, -90.0, 0.0),
    ],
)
def test_two_pairs_are_a_position_anywhere_on_earth(place: GeoPoint) -> None:
    positions = CprPositions()
    found = [positions.positions(each, None) for each in flight(place, halves(0.0, 3.0), 0.0)]
    assert found[:3] == [[], [], []]
    for each in found[3:]:
        assert len(each) == 1
        assert off_m(each[0], place) < RESOLUTION_M


def test_an_aircraft_is_followed_across_the_zones_of_latitude() -> None:
    """NL steps at 10.4704 degrees: an even and an odd frame of two zones are no pair."""
    start, positions = GeoPoint(10.466, 20.0, 0.0), CprPositions()
    for each in flight(start, halves(0.0, 20.0)):
        for place in positions.positions(each, None):
            assert off_m(place, moved(start, 100.0 * each.time_s, 0.0)) < RESOLUTION_M


@pytest.mark.parametrize("first_s", [9.0, 10.5])
def test_frames_of_a_pair_are_at_most_ten_seconds_apart(first_s: float) -> None:
    positions = CprPositions()
    frames = [frame(PLACE, 0.0, False), *(frame(PLACE, first_s + 0.1 * step, True) for step in range(3))]
    found = [positions.positions(each, None) for each in [*frames, frame(PLACE, first_s + 1.0, False)]]
    assert bool(found[-1]) is (first_s < 10.0)


def test_one_bad_frame_places_the_aircraft_nowhere() -> None:
    """A frame of another aircraft with the same address, or damaged and not noticed."""
    for bad_at in range(7):
        for bad_place in (moved(PLACE, 9_000.0, 0.0), GeoPoint(-40.0, -70.0, 0.0)):
            positions, found = CprPositions(), []
            for number, each in enumerate(flight(PLACE, halves(0.0, 8.0), 0.0)):
                sent = frame(bad_place, each.time_s, each.is_odd) if number == bad_at else each
                found += positions.positions(sent, None)
            assert len(found) >= 10
            assert max(off_m(place, PLACE) for place in found) < RESOLUTION_M


@pytest.mark.parametrize("apart_m", [9_000.0, 150_000.0])
def test_two_aircraft_with_one_address_are_followed_both(apart_m: float) -> None:
    """They fly towards each other. Which of them sent a frame may be uncertain at first."""
    other, positions = moved(PLACE, apart_m, 500.0), CprPositions()
    pairs = zip(flight(PLACE, halves(0.0, 30.0)), flight(other, halves(0.0, 30.0), -100.0), strict=True)
    for mine, others in pairs:
        found = positions.positions(mine, None), positions.positions(others, None)
        moved_m = 100.0 * mine.time_s
        places = moved(PLACE, moved_m, 0.0), moved(other, -moved_m, 0.0)
        if mine.time_s > 20.0:
            for each, place in zip(found, places, strict=True):
                assert min(off_m(one, place) for one in each) < RESOLUTION_M
            assert positions.is_shared(mine.time_s)
    assert len(positions._trails) <= 4


def test_two_aircraft_with_one_address_that_met_are_followed_both() -> None:
    other, positions = moved(PLACE, 4_000.0, 0.0), CprPositions()
    pairs = zip(flight(PLACE, halves(0.0, 60.0)), flight(other, halves(0.0, 60.0), -100.0), strict=True)
    for mine, others in pairs:
        found = positions.positions(mine, None), positions.positions(others, None)
        moved_m = 100.0 * mine.time_s
        if 5.0 < mine.time_s < 15.0 or mine.time_s > 40.0:
            assert off_m(found[0][0], moved(PLACE, moved_m, 0.0)) < RESOLUTION_M
            assert off_m(found[1][0], moved(other, -moved_m, 0.0)) < RESOLUTION_M
        assert max(map(len, found)) <= 2
    assert len(positions._trails) == 2


def test_an_aircraft_that_was_silent_is_acquired_again() -> None:
    positions = CprPositions()
    for each in flight(PLACE, halves(0.0, 5.0)):
        positions.positions(each, None)
    far = moved(PLACE, 400_000.0, 0.0)
    later = [frame(far, 700.0 + 0.5 * step, is_odd=step % 2 == 1) for step in range(4)]
    found = [positions.positions(each, None) for each in later]
    assert found[:3] == [[], [], []]
    assert off_m(found[3][0], far) < RESOLUTION_M


def test_a_position_on_the_ground_needs_a_place_not_far_away() -> None:
    airport = GeoPoint(-37.67, 144.84, 0.0)
    parked = [frame(airport, 5.0 * step, is_odd=step % 2 == 1, is_surface=True) for step in range(4)]
    positions = CprPositions()
    assert [positions.positions(each, None) for each in parked] == [[]] * 4
    positions = CprPositions()
    near = moved(airport, 300_000.0, -200_000.0)
    found = [positions.positions(each, (near.lat_deg, near.lon_deg)) for each in parked]
    assert found[:3] == [[], [], []]
    assert off_m(found[3][0], airport) < 1.3


def test_a_landed_aircraft_is_near_where_it_flew() -> None:
    positions = CprPositions()
    for each in flight(PLACE, halves(0.0, 5.0), 0.0):
        positions.positions(each, None)
    (found,) = positions.positions(frame(PLACE, 6.0, is_odd=False, is_surface=True), None)
    assert off_m(found, PLACE) < 1.3


def test_any_frames_take_no_memory() -> None:
    positions = CprPositions()
    for number in range(2_000):
        lat, lon = number * 7_919 % 131_072, number * 104_729 % 131_072
        positions.positions(CprFrame(number % 2 == 1, lat, lon, False, 0.01 * number), None)
        assert len(positions._trails) <= 4
        assert len(positions._unmatched) <= 4
