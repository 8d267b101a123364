"""Obstacle files: YAML and GeoJSON, and the messages for mistakes."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from companion.airspace.obstacles import Obstacle
from companion.config import load_config, load_obstacles
from companion.errors import ConfigError
from companion.geodesy import GeoPoint, LocalFrame
from companion.model import LatLon

FRAME = LocalFrame(47.0, 8.0)


def north_east_m(at: LatLon) -> tuple[float, float]:
    return FRAME.to_ned_m(GeoPoint(*at, 0.0))[:2]


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


def test_obstacles_of_a_yaml_file(tmp_path: Path) -> None:
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


def test_obstacles_of_a_geojson_file(tmp_path: Path) -> None:
    square = [[8.0, 47.0], [8.02, 47.0], [8.02, 47.01], [8.0, 47.01], [8.0, 47.0]]
    text = geojson(
        feature("Point", [8.2, 47.1, 400.0], name="Radio", top_amsl_m=712.5, owner="unknown"),
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
    # Every place above the forest is within a cylinder.
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


def test_other_and_missing_files_are_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path, "m.kml", "<kml/>") == "m.kml: must be a .yaml or a .geojson file"
    (tmp_path / "gone.yaml").write_text("links: ['udpin:0.0.0.0:14550']\nobstacle_files: [nowhere.geojson]\n")
    with pytest.raises(ConfigError, match=r"nowhere\.geojson: cannot be read: No such file"):
        load_obstacles(load_config(tmp_path / "gone.yaml"))
