"""Obstacles: how lines and areas are filled, and which obstacles become tracks."""

import math
from itertools import pairwise

import pytest

from companion.airspace.obstacles import Obstacle, ObstacleMap, ObstacleParams, along, within
from companion.engine import Engine, EngineConfig, EngineParams
from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import Heartbeat, OwnPosition, Sender
from companion.model import LatLon, Layer, TrafficKind

FRAME = LocalFrame(47.0, 8.0)


def place(north_m: float, east_m: float) -> LatLon:
    point = FRAME.to_geo(north_m, east_m, 0.0)
    return point.lat_deg, point.lon_deg


def north_east_m(at: LatLon) -> tuple[float, float]:
    return FRAME.to_ned_m(GeoPoint(*at, 0.0))[:2]


def mast(
    name: str, at: LatLon, *, top_amsl_m: float | None = None, height_m: float | None = None
) -> Obstacle:
    return Obstacle(name, *at, 20.0, top_amsl_m, height_m)


# --- lines and areas -------------------------------------------------------------------------------


def test_points_along_a_line_keep_the_spacing_and_include_its_corners() -> None:
    corners = [place(0.0, 0.0), place(3000.0, 1000.0), place(3000.0, -2050.0)]
    points = list(along(corners, 100.0))
    assert set(corners) <= {(round(lat, 12), round(lon, 12)) for lat, lon in points} | set(points)
    steps_m = [math.dist(north_east_m(a), north_east_m(b)) for a, b in pairwise(points)]
    assert min(steps_m) > 90.0
    assert max(steps_m) < 100.5
    for north_m, east_m in map(north_east_m, points):
        assert min(abs(north_m - 3.0 * east_m) / math.sqrt(10.0), abs(north_m - 3000.0)) < 1.0


def test_a_line_crosses_the_date_line_the_short_way() -> None:
    points = list(along([(10.0, 179.99), (10.0, -179.99)], 100.0))
    assert len(points) == 23
    assert all(abs(lon_deg) > 179.98 for _, lon_deg in points)


def test_an_area_is_filled_except_for_its_holes() -> None:
    outer = [place(0, 0), place(1000, 0), place(1000, 1000), place(0, 1000), place(0, 0)]
    hole = [place(400, 400), place(600, 400), place(600, 600), place(400, 600), place(400, 400)]
    points = [north_east_m(at) for at in within([outer, hole], 50.0)]
    assert len(points) == 400 - 16
    assert all(0.0 < north_m < 1000.0 and 0.0 < east_m < 1000.0 for north_m, east_m in points)
    assert not any(400.0 < north_m < 600.0 and 400.0 < east_m < 600.0 for north_m, east_m in points)


# --- tracks ----------------------------------------------------------------------------------------


def test_an_obstacle_is_a_track_at_its_top() -> None:
    known = [
        mast("Mast", place(500.0, 0.0), top_amsl_m=620.0),
        mast("Crane", place(0.0, 500.0), height_m=80.0),
    ]
    tracks = ObstacleMap(known, ObstacleParams(margin_m=100.0)).tracks(5.0, FRAME, 410.3)
    first, second = tracks
    assert first.position_m == pytest.approx((500.0, 0.0, -620.0), abs=1e-3)
    assert (first.velocity_mps, first.kind, first.callsign) == ((0.0, 0.0, 0.0), TrafficKind.OBSTACLE, "Mast")
    assert (first.protected_horizontal_m, first.vertical_uncertainty_m) == (120.0, 0.0)
    assert (second.position_m[2], second.vertical_uncertainty_m) == (-490.0, 30.0), "the ground may differ"
    assert len({track.track_id for track in tracks}) == 2


def test_without_home_only_obstacles_with_a_top_above_sea_level_are_tracks() -> None:
    known = [
        mast("Mast", place(500.0, 0.0), top_amsl_m=620.0),
        mast("Crane", place(0.0, 500.0), height_m=80.0),
    ]
    obstacles = ObstacleMap(known)
    assert [track.callsign for track in obstacles.tracks(0.0, FRAME, None)] == ["Mast"]
    assert [track.callsign for track in obstacles.tracks(0.1, FRAME, 400.0)] == ["Mast", "Crane"]
    assert ObstacleMap([]).tracks(0.0, FRAME, 400.0) == ()


def test_only_the_nearest_within_reach_are_tracks() -> None:
    known = [mast(str(km), place(1000.0 * km, 0.0), top_amsl_m=500.0) for km in range(50)]
    obstacles = ObstacleMap(known, ObstacleParams(reach_m=30_500.0, max_obstacles=1000))
    assert [track.callsign for track in obstacles.tracks(0.0, FRAME, None)] == [str(km) for km in range(31)]
    elsewhere = LocalFrame(*place(45_000.0, 0.0))
    assert [track.callsign for track in obstacles.tracks(0.0, elsewhere, None)] == [
        str(k) for k in range(15, 50)
    ]
    few = ObstacleMap(known, ObstacleParams(max_obstacles=3))
    assert [track.callsign for track in few.tracks(0.0, elsewhere, None)] == ["44", "45", "46"]


def test_tracks_are_updated_once_a_second_and_when_home_moves() -> None:
    obstacles = ObstacleMap([mast("Crane", place(0.0, 500.0), height_m=80.0)])
    first = obstacles.tracks(10.0, FRAME, 400.0)
    assert obstacles.tracks(10.9, FRAME, 400.2) is first
    assert obstacles.tracks(11.0, FRAME, 400.0)[0].time_s == 11.0
    assert obstacles.tracks(11.1, FRAME, 402.0)[0].position_m[2] == -482.0
    assert obstacles.tracks(5.0, FRAME, 402.0)[0].time_s == 5.0


def test_an_obstacle_has_exactly_one_height() -> None:
    for top_amsl_m, height_m in ((None, None), (500.0, 80.0)):
        with pytest.raises(ValueError, match="either a top above sea level or a height above ground"):
            mast("Mast", (47.0, 8.0), top_amsl_m=top_amsl_m, height_m=height_m)


def test_the_engine_avoids_a_mast_on_its_way() -> None:
    autopilot, t0 = Sender(1, 1), 1_700_000_000.0
    known = (mast("Mast", place(700.0, 0.0), top_amsl_m=900.0),)
    engine = Engine(EngineConfig(engine=EngineParams(autopilot_system_id=1), known_obstacles=known))
    for tick in range(20):
        now_s = t0 + tick / 10.0
        lat_deg, lon_deg = place(22.0 * (now_s - t0), 0.0)
        engine.receive(Heartbeat(autopilot, 1, 3, True, 10, 4), now_s)
        own = OwnPosition(autopilot, tick / 10.0, lat_deg, lon_deg, 880.0, 200.0, (22.0, 0.0, 0.0), 0.0)
        engine.receive(own, now_s)
        engine.tick(now_s)
    assert engine.decision.layer is not Layer.CLEAR
    assert engine.decision.threats[0].track_id == "OBS-00000"
