"""The leg that is flown: from the items, the sequence seen, jumps, loiters, and where a mode was entered."""

import pytest

from companion.geodesy import GeoPoint, LocalFrame
from companion.ownship.legs import Leg, Legs
from companion.ownship.mission import Mission
from tests.support.responder import Item
from tests.unit.ownship.test_mission import at, mission

HOME_M = 500.0
FRAME = LocalFrame(47.0, 8.0)
HOME, TAKEOFF, WAYPOINT, UNLIM, TURNS, SPLINE, LAND, JUMP = (
    Item(16, (47.0, 8.0), 0.0),
    22,
    16,
    17,
    18,
    82,
    21,
    177,
)


def jump(to: int, count: int) -> Item:
    return Item(JUMP, frame=2, params=(float(to), float(count), 0.0, 0.0))


def place(lat_deg: float, height_m: float = 100.0, lon_deg: float = 8.0) -> GeoPoint:
    return GeoPoint(lat_deg, lon_deg, HOME_M + height_m)


FLIGHT = mission(HOME, at(TAKEOFF, 47.01), at(WAYPOINT, 47.1), at(WAYPOINT, 47.2, 200.0), at(WAYPOINT, 47.3))


def on(sequence: int, here: GeoPoint, flight: Mission = FLIGHT, legs: Legs | None = None) -> Leg | None:
    legs = legs or Legs()
    legs.first = 1
    return legs.leg(flight, sequence, here, HOME_M)


def test_without_history_the_item_before_is_where_the_leg_begins() -> None:
    leg = on(3, place(47.15, 150.0))
    assert leg is not None
    assert (leg.start, leg.end) == (place(47.1), place(47.2, 200.0))
    assert leg.then == place(47.3)
    beside = leg.beside(place(47.15, 150.0))
    assert beside is not None
    assert beside.altitude_m == pytest.approx(HOME_M + 150.0, abs=0.5)


@pytest.mark.parametrize(
    "here", [place(47.15, 150.0, 8.01), place(47.15, 300.0), place(47.25, 200.0), place(47.05)]
)
def test_a_leg_that_is_not_flown_is_not_the_leg(here: GeoPoint) -> None:
    """760 m aside, 150 m above, beyond its end, before its start: then the straight way."""
    leg = on(3, here)
    assert leg is not None
    assert leg.start is None
    assert leg.end == place(47.2, 200.0)


def test_home_take_off_and_landing_begin_no_leg() -> None:
    assert on(0, place(47.0)) is None
    assert on(1, place(47.005)) is None, "the take-off"
    after_take_off = on(2, place(47.05))
    assert after_take_off is not None
    assert after_take_off.start is None
    landing = mission(HOME, at(WAYPOINT, 47.1), at(LAND, 47.2))
    assert on(2, place(47.15), landing) is None
    alone = mission(HOME, at(WAYPOINT, 47.1))
    assert (leg := on(1, place(47.05, 50.0), alone)) is not None
    assert leg.start is None, "item 0 is home"


def test_a_height_above_terrain_is_unknown() -> None:
    above = mission(HOME, at(WAYPOINT, 47.1), at(WAYPOINT, 47.2, frame=10))
    assert on(2, place(47.15), above) is None
    from_terrain = mission(HOME, at(WAYPOINT, 47.1, frame=10), at(WAYPOINT, 47.2))
    assert (leg := on(2, place(47.15), from_terrain)) is not None
    assert leg.start is None


def test_from_and_to_a_spline_the_leg_is_unknown() -> None:
    curved = mission(HOME, at(WAYPOINT, 47.1), at(SPLINE, 47.2), at(WAYPOINT, 47.3))
    for sequence, here in ((2, place(47.15)), (3, place(47.25))):
        leg = on(sequence, here, curved)
        assert leg is not None
        assert leg.start is None


def test_after_a_jump_the_item_flown_before_counts() -> None:
    looped = mission(HOME, at(WAYPOINT, 47.1), at(WAYPOINT, 47.2), at(WAYPOINT, 47.15), jump(1, 5))
    legs = Legs()
    legs.item_changed(3, place(47.149), flown=True)
    leg = on(1, place(47.12), looped, legs)
    assert leg is not None
    assert leg.start == place(47.15)
    assert (unseen := on(1, place(47.12), looped)) is not None
    assert unseen.start == place(47.15), "found by the jump that leads here"
    assert unseen.then == place(47.2)


@pytest.mark.parametrize(("count", "then"), [(-1, 47.1), (3, None), (0, None)])
def test_what_follows_a_jump_is_known_only_if_it_is_endless(count: int, then: float | None) -> None:
    looped = mission(HOME, at(WAYPOINT, 47.1), at(WAYPOINT, 47.2), jump(1, count), at(WAYPOINT, 47.4))
    leg = on(2, place(47.15), looped)
    assert leg is not None
    assert leg.then == (None if then is None else place(then))


def test_a_loiter_is_circled_and_begins_a_leg() -> None:
    circle = Item(TURNS, (47.1, 8.0), 100.0, frame=3, params=(2.0, 0.0, -90.0, 0.0))
    flight = mission(HOME, circle, at(WAYPOINT, 47.2))
    arriving = on(1, place(47.05), flight)
    assert arriving is not None
    assert arriving.loiter_radius_m == -90.0
    leaving = on(2, place(47.15), flight)
    assert leaving is not None
    assert leaving.start == place(47.1)


def test_where_the_mission_was_entered_the_line_begins() -> None:
    legs = Legs()
    legs.entered(place(47.12, 180.0, 8.02))
    line = legs.line(FLIGHT, 3, place(47.15, 190.0, 8.01), HOME_M)
    assert line is not None
    assert line.start == place(47.12, 180.0, 8.02), "what the autopilot flies"
    leg = on(3, place(47.16, 190.0, 8.01), FLIGHT, legs)
    assert leg is not None
    assert leg.start == place(47.12, 200.0, 8.02), "where it belongs: at the item's height"


def test_a_corner_is_the_start_and_a_selected_items_is_the_aircrafts_place() -> None:
    legs = Legs()
    legs.item_changed(2, place(47.099), flown=True)
    assert (line := legs.line(FLIGHT, 3, place(47.11), HOME_M)) is not None
    assert line.start == place(47.1)
    legs.item_changed(2, place(47.05), flown=True)
    assert (line := legs.line(FLIGHT, 3, place(47.06), HOME_M)) is not None
    assert line.start == place(47.05), "item 2 was never reached"


def test_a_changed_mission_is_a_new_beginning_and_the_same_one_is_not() -> None:
    legs = Legs()
    legs.learn(FLIGHT, place(47.0), flown=True)
    legs.item_changed(2, place(47.1), flown=True)
    legs.learn(Mission(FLIGHT.items), place(47.13), flown=True)
    assert (line := legs.line(FLIGHT, 3, place(47.15), HOME_M)) is not None
    assert line.start == place(47.1)
    other = mission(HOME, at(TAKEOFF, 47.01), at(WAYPOINT, 47.1), at(WAYPOINT, 47.2, 120.0))
    legs.learn(other, place(47.13), flown=True)
    assert (line := legs.line(other, 3, place(47.15), HOME_M)) is not None
    assert line.start == place(47.13)


def test_speed_changes_are_those_executed_last_first() -> None:
    slow, fast = Item(178, params=(0.0, 18.0, -1.0, 0.0)), Item(178, params=(0.0, 26.0, -1.0, 0.0))
    ground = Item(178, params=(1.0, 20.0, -1.0, 0.0))
    flight = mission(HOME, slow, at(WAYPOINT, 47.1), fast, ground, at(WAYPOINT, 47.2), slow)
    assert [item.params[1] for item in flight.speed_changes(5)] == [26.0, 18.0]
    assert [item.params[1] for item in flight.speed_changes(2)] == [18.0]
