"""Zones from the items of an autopilot's fence mission."""

import pytest

from companion.airspace.fences import FenceZone, zones_of
from companion.mavlink.facts import MissionItem
from tests.support.responder import FENCE, US, Item, as_fact, item_message

IN, OUT, CIRCLE_IN, CIRCLE_OUT, RETURN = 5001, 5002, 5003, 5004, 5000
TRIANGLE = ((47.0, 8.0), (47.0, 8.1), (47.1, 8.0))


def polygon(command: int, places: tuple[tuple[float, float], ...], count: float | None = None) -> list[Item]:
    count = len(places) if count is None else count
    return [Item(command, place, params=(count, 0.0, 0.0, 0.0)) for place in places]


def circle(command: int, radius_m: float, place: tuple[float, float] = (47.0, 8.0)) -> Item:
    return Item(command, place, params=(radius_m, 0.0, 0.0, 0.0))


def zones(items: list[Item]) -> tuple[tuple[FenceZone, ...], int]:
    address = (US.system_id, US.component_id)
    facts = [as_fact(item_message(item, at, address, FENCE)) for at, item in enumerate(items)]
    return zones_of([fact for fact in facts if isinstance(fact, MissionItem)])


def test_consecutive_polygons_and_circles_are_separate_zones() -> None:
    square = (*TRIANGLE, (47.2, 8.2))
    found, unusable = zones(
        [
            *polygon(IN, TRIANGLE),
            *polygon(IN, square),
            *polygon(OUT, TRIANGLE),
            Item(RETURN, (47.0, 8.0)),
            circle(CIRCLE_IN, 900.0),
            circle(CIRCLE_OUT, 100.0),
        ]
    )
    assert unusable == 0
    assert [(zone.inclusion, zone.vertices_deg or zone.radius_m) for zone in found] == [
        (True, TRIANGLE),
        (True, square),
        (False, TRIANGLE),
        (True, 900.0),
        (False, 100.0),
    ]


@pytest.mark.parametrize(
    ("items", "unusable"),
    [
        (polygon(IN, TRIANGLE[:2]), 2),
        (polygon(IN, TRIANGLE, count=5), 3),
        (polygon(IN, TRIANGLE, count=0), 3),
        (polygon(IN, TRIANGLE, count=float("nan")), 3),
        (polygon(IN, (*TRIANGLE[:2], (0.0, 0.0))), 3),
        ([*polygon(IN, TRIANGLE[:2], count=3), *polygon(OUT, TRIANGLE[:1], count=3)], 3),
        ([circle(CIRCLE_OUT, 0.0)], 1),
        ([circle(CIRCLE_OUT, -10.0)], 1),
        ([circle(CIRCLE_IN, float("nan"))], 1),
        ([circle(CIRCLE_IN, 50.0, (95.0, 8.0))], 1),
    ],
)
def test_unusable_items_are_counted_and_the_other_zones_are_kept(items: list[Item], unusable: int) -> None:
    found, counted = zones([*items, circle(CIRCLE_OUT, 70.0)])
    assert [zone.radius_m for zone in found] == [70.0]
    assert counted == unusable
