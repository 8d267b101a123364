"""Zones on the globe: what is refused, and their form in the local frame."""

import math
from typing import Any

import pytest

from companion.airspace.fences import FenceZone
from companion.geodesy import LocalFrame

TRIANGLE = ((47.0, 8.0), (47.0, 8.1), (47.1, 8.0))


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
def test_an_invalid_zone_is_refused(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        FenceZone(inclusion=True, **fields)


def test_heights_in_the_local_frame_are_above_the_sea() -> None:
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
