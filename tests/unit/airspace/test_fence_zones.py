"""Zones: from items of the autopilot and from configuration, on the globe and in the local frame."""

import math
from typing import Any

import pytest

from companion.airspace.fence_items import zones_of
from companion.airspace.fence_zones import FenceZone
from companion.geodesy import LocalFrame
from companion.mavlink.facts import MissionItem
from tests.support.responder import FENCE, US, Item, as_fact, item_message

IN, OUT, CIRCLE_IN, CIRCLE_OUT, RETURN = 5001, 5002, 5003, 5004, 5000
TRIANGLE = ((47.0, 8.0), (47.0, 8.1), (47.1, 8.0))


def corners(command: int, places: tuple[tuple[float, float], ...], count: float | None = None) -> list[Item]:
    count = len(places) if count is None else count
    return [Item(command, place, params=(count, 0.0, 0.0, 0.0)) for place in places]


def circle(command: int, radius_m: float, place: tuple[float, float] = (47.0, 8.0)) -> Item:
    return Item(command, place, params=(radius_m, 0.0, 0.0, 0.0))


def zones(items: list[Item]) -> tuple[tuple[FenceZone, ...], int]:
    address = (US.system_id, US.component_id)
    facts = [as_fact(item_message(item, at, address, FENCE)) for at, item in enumerate(items)]
    return zones_of([fact for fact in facts if isinstance(fact, MissionItem)])


def test_polygons_and_circles_that_follow_each_other() -> None:
    square = (*TRIANGLE, (47.2, 8.2))
    found, useless = zones(
        [
            *corners(IN, TRIANGLE),
            *corners(IN, square),
            *corners(OUT, TRIANGLE),
            Item(RETURN, (47.0, 8.0)),
            circle(CIRCLE_IN, 900.0),
            circle(CIRCLE_OUT, 100.0),
        ]
    )
    assert useless == 0
    assert [(zone.inclusion, zone.vertices_deg or zone.radius_m) for zone in found] == [
        (True, TRIANGLE),
        (True, square),
        (False, TRIANGLE),
        (True, 900.0),
        (False, 100.0),
    ]


@pytest.mark.parametrize(
    ("items", "useless"),
    [
        (corners(IN, TRIANGLE[:2]), 2),
        (corners(IN, TRIANGLE, count=5), 3),
        (corners(IN, TRIANGLE, count=0), 3),
        (corners(IN, TRIANGLE, count=float("nan")), 3),
        (corners(IN, (*TRIANGLE[:2], (0.0, 0.0))), 3),
        ([*corners(IN, TRIANGLE[:2], count=3), *corners(OUT, TRIANGLE[:1], count=3)], 3),
        ([circle(CIRCLE_OUT, 0.0)], 1),
        ([circle(CIRCLE_OUT, -10.0)], 1),
        ([circle(CIRCLE_IN, float("nan"))], 1),
        ([circle(CIRCLE_IN, 50.0, (95.0, 8.0))], 1),
    ],
)
def test_items_that_make_no_zone_are_counted_and_the_rest_is_kept(items: list[Item], useless: int) -> None:
    whole = circle(CIRCLE_OUT, 70.0)
    found, counted = zones([*items, whole])
    assert [zone.radius_m for zone in found] == [70.0]
    assert counted == useless


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "either"),
        ({"vertices_deg": TRIANGLE, "centre_deg": (47.0, 8.0), "radius_m": 5.0}, "either"),
        ({"centre_deg": (47.0, 8.0)}, "either"),
        ({"vertices_deg": TRIANGLE, "radius_m": 5.0}, "either"),
        ({"vertices_deg": TRIANGLE[:2]}, "at least three"),
        ({"centre_deg": (47.0, 8.0), "radius_m": 0.0}, "radius_m"),
        ({"centre_deg": (147.0, 8.0), "radius_m": 1.0}, "place"),
        ({"vertices_deg": (*TRIANGLE, (math.nan, 8.0))}, "place"),
        ({"vertices_deg": TRIANGLE, "min_height_m": 5.0, "max_height_m": 5.0}, "min_height_m"),
    ],
)
def test_what_is_no_zone(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        FenceZone(inclusion=True, **fields)


def test_in_the_local_frame_heights_are_above_the_sea() -> None:
    frame = LocalFrame(47.0, 8.0)
    zone = FenceZone(False, centre_deg=(47.01, 8.0), radius_m=250.0, max_height_m=120.0).in_frame(
        frame, 500.0
    )
    assert zone.centre_m == pytest.approx((1111.7, 0.0), abs=1.0)
    assert (zone.inclusion, zone.radius_m, zone.vertices_m) == (False, 250.0, ())
    assert (zone.min_altitude_m, zone.max_altitude_m) == (None, 620.0)
    polygon = FenceZone(True, vertices_deg=TRIANGLE, min_height_m=30.0).in_frame(frame, 500.0)
    assert polygon.vertices_m[0] == (0.0, 0.0)
    assert polygon.vertices_m[2] == pytest.approx((11_117.0, 0.0), abs=5.0)
    assert (polygon.min_altitude_m, polygon.max_altitude_m) == (530.0, None)
