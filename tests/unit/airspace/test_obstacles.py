"""Obstacles: what files say, how lines and areas are filled, and what is looked at."""

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from companion.airspace.obstacles import LatLon, Obstacle, ObstacleMap, ObstacleParams, along, within
from companion.config import load_config, load_obstacles
from companion.engine import Engine, EngineConfig, EngineParams
from companion.errors import ConfigError
from companion.geodesy import GeoPoint, LocalFrame
from companion.mavlink.facts import Heartbeat, OwnPosition, Sender
from companion.model import Layer, TrafficKind

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


def test_points_on_a_line_are_no_further_apart_than_asked_and_include_its_corners() -> None:
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


def test_an_area_is_filled_but_for_its_holes() -> None:
    outer = [place(0, 0), place(1000, 0), place(1000, 1000), place(0, 1000), place(0, 0)]
    hole = [place(400, 400), place(600, 400), place(600, 600), place(400, 600), place(400, 400)]
    points = [north_east_m(at) for at in within([outer, hole], 50.0)]
    assert len(points) == 400 - 16
    assert all(0.0 < north_m < 1000.0 and 0.0 < east_m < 1000.0 for north_m, east_m in points)
    assert not any(400.0 < north_m < 600.0 and 400.0 < east_m < 600.0 for north_m, east_m in points)


# --- tracks ----------------------------------------------------------------------------------------


def test_an_obstacle_is_a_track_that_stands_at_its_top() -> None:
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


def test_without_home_only_heights_above_the_sea_are_known() -> None:
    known = [
        mast("Mast", place(500.0, 0.0), top_amsl_m=620.0),
        mast("Crane", place(0.0, 500.0), height_m=80.0),
    ]
    obstacles = ObstacleMap(known)
    assert [track.callsign for track in obstacles.tracks(0.0, FRAME, None)] == ["Mast"]
    assert [track.callsign for track in obstacles.tracks(0.1, FRAME, 400.0)] == ["Mast", "Crane"]
    assert ObstacleMap([]).tracks(0.0, FRAME, 400.0) == ()


def test_only_the_nearest_within_reach_are_looked_at() -> None:
    known = [mast(str(km), place(1000.0 * km, 0.0), top_amsl_m=500.0) for km in range(50)]
    obstacles = ObstacleMap(known, ObstacleParams(reach_m=30_500.0, max_obstacles=1000))
    assert [track.callsign for track in obstacles.tracks(0.0, FRAME, None)] == [str(km) for km in range(31)]
    elsewhere = LocalFrame(*place(45_000.0, 0.0))
    assert [track.callsign for track in obstacles.tracks(0.0, elsewhere, None)] == [
        str(k) for k in range(15, 50)
    ]
    few = ObstacleMap(known, ObstacleParams(max_obstacles=3))
    assert [track.callsign for track in few.tracks(0.0, elsewhere, None)] == ["44", "45", "46"]


def test_tracks_are_renewed_once_a_second_and_when_home_moves() -> None:
    obstacles = ObstacleMap([mast("Crane", place(0.0, 500.0), height_m=80.0)])
    first = obstacles.tracks(10.0, FRAME, 400.0)
    assert obstacles.tracks(10.9, FRAME, 400.2) is first
    assert obstacles.tracks(11.0, FRAME, 400.0)[0].time_s == 11.0
    assert obstacles.tracks(11.1, FRAME, 402.0)[0].position_m[2] == -482.0
    assert obstacles.tracks(5.0, FRAME, 402.0)[0].time_s == 5.0


def test_an_obstacle_has_one_height() -> None:
    for top_amsl_m, height_m in ((None, None), (500.0, 80.0)):
        with pytest.raises(ValueError, match="either a top above sea level or a height above ground"):
            mast("Mast", (47.0, 8.0), top_amsl_m=top_amsl_m, height_m=height_m)


def test_the_engine_keeps_clear_of_a_mast_on_the_way() -> None:
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


# --- files -----------------------------------------------------------------------------------------


def load(folder: Path, name: str, text: str) -> tuple[Obstacle, ...]:
    (folder / name).write_text(text, encoding="utf-8")
    config = folder / "c.yaml"
    config.write_text(
        f"links: ['udpin:0.0.0.0:14550']\nobstacle_files: [{name}]\nobstacles: {{margin_m: 95}}\n"
    )
    return load_obstacles(load_config(config))


def geojson(*features: Any) -> str:
    return json.dumps({"type": "FeatureCollection", "features": features})


def feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def refusal(folder: Path, name: str, text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        load(folder, name, text)
    message = str(caught.value)
    assert "\n" not in message
    return message.removeprefix(f"{folder}/")


def test_masts_of_a_yaml_file(tmp_path: Path) -> None:
    text = """
obstacles:
  - {name: Radio, lat_deg: 47.1, lon_deg: 8.2, top_amsl_m: 712.5}
  - {name: Crane, lat_deg: 47.1, lon_deg: 8.3, height_m: 60, radius_m: 40}
  - {name: Stack, lat_deg: 47.1, lon_deg: 8.4, height_m: 60, ground_amsl_m: 431}
"""
    assert load(tmp_path, "masts.yaml", text) == (
        Obstacle("Radio", 47.1, 8.2, 5.0, 712.5, None),
        Obstacle("Crane", 47.1, 8.3, 40.0, None, 60.0),
        Obstacle("Stack", 47.1, 8.4, 5.0, 491.0, None),
    )


def test_features_of_a_geojson_file(tmp_path: Path) -> None:
    square = [[8.0, 47.0], [8.02, 47.0], [8.02, 47.01], [8.0, 47.01], [8.0, 47.0]]
    text = geojson(
        feature("Point", [8.2, 47.1, 400.0], name="Radio", top_amsl_m=712.5, owner="somebody"),
        feature("LineString", [[8.0, 47.0], [8.0, 47.01]], name="Line", height_m=40, radius_m=5),
        feature("Polygon", [square], name="Forest", height_m=30, ground_amsl_m=400),
        feature("MultiPoint", [[8.2, 47.1], [8.3, 47.1]], height_m=20),
    )
    obstacles = load(tmp_path, "map.geojson", text)
    assert obstacles[0] == Obstacle("Radio", 47.1, 8.2, 5.0, 712.5, None)
    line = [o for o in obstacles if o.name == "Line"]
    assert len(line) == 13, "1112 m, in pieces of less than 5 + 95 m"
    forest = [o for o in obstacles if o.name == "Forest"]
    assert {o.top_amsl_m for o in forest} == {430.0}
    # Wherever one is over the forest, one is within a cylinder.
    inside = [(47.0 + 0.0007 * i, 8.0 + 0.0009 * j) for i in range(14) for j in range(22)]
    for at in inside:
        assert min(math.dist(north_east_m(at), north_east_m((o.lat_deg, o.lon_deg))) for o in forest) < 100.0
    assert [o.name for o in obstacles[-2:]] == ["features[3]", "features[3]"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("obstacles: []", "m.yaml:1: obstacles: must be a list of at least 1"),
        (
            "obstacles:\n- {name: A, lat_deg: 97, lon_deg: 8, height_m: 9}",
            "m.yaml:2: obstacles[0].lat_deg: must be at most 90 (got 97)",
        ),
        (
            "obstacles:\n- {name: A, lat_deg: 47, lon_deg: 8}",
            "m.yaml:2: obstacles[0]: A: give either top_amsl_m or height_m",
        ),
        (
            "obstacles:\n- {name: A, lat_deg: 47, lon_deg: 8, top_amsl_m: 9, ground_amsl_m: 3}",
            "m.yaml:2: obstacles[0]: A: ground_amsl_m needs height_m",
        ),
        (
            "obstacles:\n- {name: A, lat_deg: 47, lon_deg: 8, hight_m: 9}",
            "m.yaml:2: obstacles[0].hight_m: is unknown, did you mean height_m?",
        ),
    ],
)
def test_a_mistake_in_a_yaml_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    assert refusal(tmp_path, "m.yaml", text) == message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "m.geojson: not valid JSON: Expecting property name enclosed in double quotes: line 1"),
        ("[" * 100_000, "m.geojson: not valid JSON: "),
        ("[]", "m.geojson: must be a GeoJSON FeatureCollection"),
        (geojson("A"), "m.geojson: features[0]: must be a Feature"),
        (
            geojson(feature("Point", [8, 47], name="A")),
            "m.geojson: features[0] (A): give either top_amsl_m or height_m",
        ),
        (
            geojson(feature("Point", [8, 47], name="A", height_m="30 m")),
            "m.geojson: features[0] (A): height_m must be from 0.1 to 2000 (got 30 m)",
        ),
        (
            geojson(
                feature("Point", [8, 47], height_m=30), feature("Point", [47, 118], name="B", height_m=30)
            ),
            "m.geojson: features[1] (B): must be longitude and latitude in degrees: [47, 118]",
        ),
        (
            geojson(feature("Point", [8, None], height_m=30)),
            "m.geojson: features[0]: must be longitude and latitude in degrees: [8, None]",
        ),
        (
            geojson(feature("LineString", [[8, 47]], height_m=30)),
            "m.geojson: features[0]: needs at least 2 positions",
        ),
        (geojson(feature("Polygon", [], height_m=30)), "m.geojson: features[0]: coordinates are missing"),
        (
            geojson(feature("Circle", [8, 47], height_m=30)),
            "m.geojson: features[0]: geometry must be a Point, LineString or Polygon, or several of one",
        ),
        (
            geojson({"type": "Feature", "properties": {"height_m": 3}, "geometry": None}),
            "m.geojson: features[0]: has no geometry",
        ),
        (
            geojson(feature("LineString", [[-180, 0], [0, 0], [180, 0]], name="Equator", height_m=30)),
            "m.geojson: Equator: more than 200000 obstacles in all",
        ),
    ],
    ids=range(13),
)
def test_a_mistake_in_a_geojson_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    assert refusal(tmp_path, "m.geojson", text).startswith(message)


def test_other_files_and_none_are_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path, "m.kml", "<kml/>") == "m.kml: must be a .yaml or a .geojson file"
    (tmp_path / "gone.yaml").write_text("links: ['udpin:0.0.0.0:14550']\nobstacle_files: [nowhere.geojson]\n")
    with pytest.raises(ConfigError, match=r"nowhere\.geojson: cannot be read: No such file"):
        load_obstacles(load_config(tmp_path / "gone.yaml"))
