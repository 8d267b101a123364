"""Obstacle files: from YAML or GeoJSON to the obstacles that the engine avoids.

YAML suits a few masts, written by hand. GeoJSON (RFC 7946) comes from surveys and maps; its features have the
properties of a `Mast`; other properties are ignored. Errors have file and feature.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge, Gt, Le, MinLen

from companion.airspace.obstacles import Obstacle, along, within
from companion.config.document import load_document, quoted
from companion.config.loader import read_checked
from companion.config.schema import Config
from companion.errors import ConfigError
from companion.model import LatLon

_MAX_GEOJSON_BYTES = 64 << 20
# More would delay the start by seconds; lines with this many points are finer than needed.
_MAX_OBSTACLES = 200_000
_POINT_RADIUS_M = 5.0


@dataclass(frozen=True, slots=True)
class Mast:
    """One obstacle of a YAML file, with its top above mean sea level, or its height above ground."""

    name: str
    lat_deg: Annotated[float, Ge(-90), Le(90)]
    lon_deg: Annotated[float, Ge(-180), Le(180)]
    radius_m: Annotated[float, Ge(0), Le(10_000)] = _POINT_RADIUS_M
    top_amsl_m: Annotated[float, Ge(-500), Le(10_000)] | None = None
    height_m: Annotated[float, Gt(0), Le(2_000)] | None = None
    # The altitude of the ground that `height_m` is above; assumed to be that of home if not given.
    ground_amsl_m: Annotated[float, Ge(-500), Le(9_000)] | None = None

    def __post_init__(self) -> None:
        if (self.top_amsl_m is None) is (self.height_m is None):
            raise ValueError(f"{self.name}: give either top_amsl_m or height_m")
        if self.ground_amsl_m is not None and self.height_m is None:
            raise ValueError(f"{self.name}: ground_amsl_m needs height_m")

    def at(self, lat_deg: float, lon_deg: float) -> Obstacle:
        """The obstacle at this position."""
        top_m, height_m = self.top_amsl_m, self.height_m
        if height_m is not None and self.ground_amsl_m is not None:
            top_m, height_m = self.ground_amsl_m + height_m, None
        return Obstacle(self.name, lat_deg, lon_deg, self.radius_m, top_m, height_m)


@dataclass(frozen=True, slots=True)
class MastFile:
    """A YAML file of obstacles."""

    obstacles: Annotated[tuple[Mast, ...], MinLen(1)]


def load_obstacles(config: Config) -> tuple[Obstacle, ...]:
    """All obstacles of the files named in a configuration; `ConfigError` with file and feature."""
    obstacles: list[Obstacle] = []
    for path in config.obstacle_files:
        for obstacle in _read(path, config.obstacles.margin_m):
            if len(obstacles) >= _MAX_OBSTACLES:
                raise ConfigError(
                    f"{path}: {quoted(obstacle.name)}: more than {_MAX_OBSTACLES} obstacles in all; "
                    "lines and areas count by their points; a larger obstacles.margin_m needs fewer of them"
                )
            obstacles.append(obstacle)
    return tuple(obstacles)


def _read(path: Path, margin_m: float) -> Iterable[Obstacle]:
    if path.suffix in (".yaml", ".yml"):
        masts = read_checked(load_document(path), str(path), MastFile).obstacles
        return (mast.at(mast.lat_deg, mast.lon_deg) for mast in masts)
    if path.suffix in (".geojson", ".json"):
        return _GeoJson(path, margin_m).obstacles()
    raise ConfigError(f"{path}: must be a .yaml or a .geojson file")


class _GeoJson:
    """Reads one file; `_where` is the feature that an error is about."""

    def __init__(self, path: Path, margin_m: float) -> None:
        self._path = path
        self._margin_m = margin_m
        self._where = ""

    def obstacles(self) -> Iterator[Obstacle]:
        """The cylinders that cover each feature."""
        document = self._load()
        features = document.get("features") if isinstance(document, dict) else None
        if not isinstance(features, list) or document.get("type") != "FeatureCollection":
            raise self._error("must be a GeoJSON FeatureCollection")
        for index, feature in enumerate(features):
            self._where = f"features[{index}]"
            if not isinstance(feature, dict) or feature.get("type") != "Feature":
                raise self._error("must be a Feature")
            yield from self._feature(feature)

    def _feature(self, feature: dict[str, Any]) -> Iterator[Obstacle]:
        properties = feature.get("properties") or {}
        if not isinstance(properties, dict):
            raise self._error("properties must be an object")
        name = quoted(str(properties.get("name", feature.get("id", self._where))))
        self._where += f" ({name})" if name != self._where else ""
        mast = self._mast(name, properties)
        spacing_m = mast.radius_m + self._margin_m
        for position in self._positions(feature.get("geometry"), spacing_m):
            yield mast.at(*position)

    def _mast(self, name: str, properties: dict[str, Any]) -> Mast:
        limits = {"radius_m": (0, 10_000), "top_amsl_m": (-500, 10_000), "height_m": (0.1, 2_000)}
        limits["ground_amsl_m"] = (-500, 9_000)
        given = {key: properties[key] for key in limits if properties.get(key) is not None}
        for key, value in given.items():
            low, high = limits[key]
            if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
                raise self._error(f"{key} must be from {low:g} to {high:g} (got {quoted(str(value))})")
        try:
            return Mast(name, 0.0, 0.0, **given)
        except ValueError as error:
            raise self._error(str(error).removeprefix(f"{name}: ")) from error

    def _positions(self, geometry: Any, spacing_m: float) -> Iterator[LatLon]:
        """Points at most `spacing_m` apart, so that the cylinders around them leave no gap."""
        kind = geometry.get("type") if isinstance(geometry, dict) else None
        parts = [geometry.get("coordinates")] if isinstance(geometry, dict) else []
        if kind in ("MultiPoint", "MultiLineString", "MultiPolygon"):
            kind, parts = kind.removeprefix("Multi"), self._list(parts[0])
        for part in parts:
            match kind:
                case "Point":
                    yield self._position(part)
                case "LineString":
                    yield from along(self._line(part, 2), spacing_m)
                case "Polygon":
                    rings = [self._line(ring, 4) for ring in self._list(part)]
                    for ring in rings:
                        yield from along(ring, spacing_m)
                    yield from within(rings, spacing_m)
                case _:
                    raise self._error("geometry must be a Point, LineString or Polygon, or several of one")
        if not parts:
            raise self._error("has no geometry")

    def _line(self, coordinates: Any, shortest: int) -> Sequence[LatLon]:
        line = [self._position(position) for position in self._list(coordinates)]
        if len(line) < shortest:
            raise self._error(f"needs at least {shortest} positions")
        return line

    def _position(self, position: Any) -> LatLon:
        """Latitude and longitude from a GeoJSON position, which has longitude first."""
        numbers = self._list(position)[:2]
        if len(numbers) == 2 and all(type(number) in (int, float) for number in numbers):
            lon_deg, lat_deg = numbers
            if abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0:
                return float(lat_deg), float(lon_deg)
        raise self._error(f"must be longitude and latitude in degrees: {quoted(str(position))}")

    def _list(self, value: Any) -> list[Any]:
        if not isinstance(value, list) or not value:
            raise self._error("coordinates are missing")
        return value

    def _load(self) -> Any:
        try:
            if self._path.stat().st_size > _MAX_GEOJSON_BYTES:
                raise self._error(f"is larger than {_MAX_GEOJSON_BYTES >> 20} MiB")
            return json.loads(self._path.read_bytes())
        except OSError as error:
            raise self._error(f"cannot be read: {error.strerror}") from error
        except (ValueError, RecursionError) as error:
            raise self._error(f"not valid JSON: {quoted(str(error))}") from error

    def _error(self, message: str) -> ConfigError:
        where = f"{self._path}: {self._where}" if self._where else str(self._path)
        return ConfigError(f"{where}: {message}")
