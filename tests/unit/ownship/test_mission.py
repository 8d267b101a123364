"""The mission: the places that its items lead to, take-offs and landings."""

import pytest

from companion.geodesy import GeoPoint
from companion.mavlink.facts import MissionItem
from companion.ownship.mission import Mission
from tests.support.responder import MISSION, US, Item, as_fact, item_message

HOME, TAKEOFF, WAYPOINT, LOITER_TO_ALT, LAND = Item(16, (47.0, 8.0), 500.0, frame=0), 22, 16, 31, 21
DO_LAND_START, SPEED, DELAY = Item(189), Item(178), Item(93)


def mission(*items: Item) -> Mission:
    address = (US.system_id, US.component_id)
    facts = [as_fact(item_message(item, at, address, MISSION)) for at, item in enumerate(items)]
    return Mission([fact for fact in facts if isinstance(fact, MissionItem)])


def at(command: int, lat_deg: float = 47.1, height_m: float = 100.0, frame: int = 3) -> Item:
    return Item(command, (lat_deg, 8.0), height_m, frame=frame)


def test_take_off_approach_and_landing_are_recognised() -> None:
    flight = mission(
        HOME, at(TAKEOFF), SPEED, at(WAYPOINT), at(WAYPOINT), DO_LAND_START, at(LOITER_TO_ALT), at(WAYPOINT),
        at(LAND), at(WAYPOINT),
    )  # fmt: skip
    assert [n for n in range(12) if flight.taking_off_or_landing(n)] == [1, 5, 6, 7, 8]


def test_approach_and_landing_are_optional() -> None:
    assert [n for n in range(4) if mission(HOME, at(WAYPOINT), at(LAND)).taking_off_or_landing(n)] == [2]
    assert not any(mission(HOME, at(WAYPOINT)).taking_off_or_landing(n) for n in range(4))
    assert not mission().taking_off_or_landing(0)


@pytest.mark.parametrize(
    ("frame", "altitude_m"), [(0, 100.0), (5, 100.0), (3, 600.0), (6, 600.0), (10, None), (11, None)]
)
def test_the_frame_says_what_a_height_is_measured_from(frame: int, altitude_m: float | None) -> None:
    """A height above terrain is unknown, because the terrain there is unknown."""
    place = mission(HOME, at(WAYPOINT, frame=frame)).destination(1, 500.0)
    assert (None if place is None else place.altitude_m) == altitude_m


def test_items_that_are_not_flown_to_lead_to_the_next_waypoint() -> None:
    flight = mission(HOME, SPEED, DELAY, at(WAYPOINT, 47.3))
    assert flight.destination(1, 500.0) == GeoPoint(47.3, 8.0, 600.0)


def test_without_place_height_or_home_the_destination_is_unknown() -> None:
    flight = mission(HOME, Item(TAKEOFF, height_m=50.0), Item(WAYPOINT, (47.1, 8.0), 10.0, frame=2))
    assert flight.destination(1, 500.0) is None, "an item without a place"
    assert flight.destination(2, 500.0) is None, "a frame without places"
    assert flight.destination(3, 500.0) is None, "beyond the end"
    assert mission(HOME, at(WAYPOINT)).destination(1, None) is None
    wild = mission(HOME, Item(WAYPOINT, (47.1, 8.0), float("nan")))
    assert wild.destination(1, 500.0) is None
