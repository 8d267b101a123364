"""Encounter files: our CSV format, and DAIDALUS scenarios (`.daa`), whose second row names the units."""

import csv
import math
from collections.abc import Callable, Iterator
from pathlib import Path as FilePath

import numpy as np

from companion.errors import ConfigError
from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Vec3
from sim.encounters.encounter import Encounter, Path, passing

# One row per aircraft and time; the first aircraft of an encounter is ours, in straight level flight.
COLUMNS = (
    "encounter", "aircraft", "time_s", "north_m", "east_m", "down_m", "north_mps", "east_mps", "down_mps"
)  # fmt: skip
_SHORTEST_S = 1.0
_LENGTH_M = {"m": 1.0, "km": 1000.0, "ft": 0.3048, "nmi": 1852.0, "deg": 1.0}
_SPEED_MPS = {
    "m/s": 1.0,
    "mps": 1.0,
    "knot": 1852.0 / 3600.0,
    "kn": 1852.0 / 3600.0,
    "fpm": 0.3048 / 60.0,
    "kph": 1 / 3.6,
}
_ANGLE_RAD = {"deg": math.radians(1.0), "rad": 1.0}
_TIME_S = {"s": 1.0, "min": 60.0, "ms": 0.001}

# An aircraft's rows: time, position, velocity.
_Rows = list[tuple[float, Vec3, Vec3]]


def read_encounters(path: FilePath) -> list[Encounter]:
    """The encounters of a file, by its suffix; `ConfigError` names the file's line."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: no encounters: not plain text") from error
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1)]
    read = _read_daa if path.suffix.lower() == ".daa" else _read_csv
    return list(read(path, lines))


def write_encounters(path: FilePath, encounters: list[Encounter]) -> None:
    """Write CSV for `read_encounters`; weights and texts are not written."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for encounter in encounters:
            velocity = encounter.own_velocity_mps
            for time_s in (0.0, encounter.duration_s):
                place = [p + v * time_s for p, v in zip(encounter.own_position_m, velocity, strict=True)]
                writer.writerow(
                    [encounter.encounter_id, "own", repr(time_s), *map(repr, (*place, *velocity))]
                )
            for number, intruder in enumerate(encounter.intruders, start=1):
                for time, place_m, mps in zip(*_columns(intruder), strict=True):
                    numbers = map(repr, [time, *place_m, *mps])
                    writer.writerow([encounter.encounter_id, f"intruder{number}", *numbers])


def _columns(path: Path) -> tuple[list[float], list[list[float]], list[list[float]]]:
    return path.time_s.tolist(), path.position_m.tolist(), path.velocity_mps.tolist()


def _read_csv(path: FilePath, lines: list[tuple[int, str]]) -> Iterator[Encounter]:
    if not lines or tuple(lines[0][1].strip().split(",")) != COLUMNS:
        raise ConfigError(f"{path}, line 1: no encounters: the columns are {','.join(COLUMNS)}")
    found: dict[str, dict[str, _Rows]] = {}
    for number, line in lines[1:]:
        cells = line.split(",")
        if not line.strip():
            continue
        if len(cells) != len(COLUMNS):
            raise ConfigError(f"{path}, line {number}: {len(cells)} columns instead of {len(COLUMNS)}")
        values = [_number(path, number, cell) for cell in cells[2:]]
        row = (values[0], (values[1], values[2], values[3]), (values[4], values[5], values[6]))
        found.setdefault(cells[0], {}).setdefault(cells[1], []).append(row)
    if not found:
        raise ConfigError(f"{path}: no encounters: only a header")
    for name, aircraft in found.items():
        yield _encounter(path, name, aircraft)


def _read_daa(path: FilePath, lines: list[tuple[int, str]]) -> Iterator[Encounter]:
    rows = [(n, line) for n, line in lines if line.strip() and not line.lstrip().startswith("#")]
    if len(rows) < 3:
        raise ConfigError(f"{path}: no encounters: a header, units and rows are needed")
    names = _words(rows[0][1])
    units = dict(zip(names, (word.strip("[]") for word in _words(rows[1][1])), strict=False))
    place = {name.lower(): i for i, name in enumerate(names)}
    read = _daa_reader(path, place, {name.lower(): unit for name, unit in units.items()})
    aircraft: dict[str, _Rows] = {}
    for number, line in rows[2:]:
        cells = _words(line)
        if len(cells) < len(names):
            raise ConfigError(f"{path}, line {number}: {len(cells)} columns instead of {len(names)}")
        aircraft.setdefault(cells[place["name"]], []).append(read(number, cells))
    yield _encounter(path, path.stem, aircraft)


def _words(line: str) -> list[str]:
    return [word.strip() for word in line.replace(",", " ").split()]


def _daa_reader(
    path: FilePath, place: dict[str, int], units: dict[str, str]
) -> Callable[[int, list[str]], tuple[float, Vec3, Vec3]]:
    """A function from a row to time, position and velocity; positions by latitude or in a flat frame."""
    geographic = "lat" in place
    position = ("lat", "lon", "alt") if geographic else ("sx", "sy", "sz")
    speeds = ("trk", "gs", "vs") if "trk" in place else ("vx", "vy", "vz")
    missing = [name for name in ("name", "time", *position, *speeds) if name not in place]
    if missing:
        raise ConfigError(f"{path}: no encounters: column {missing[0]} is missing")
    frame: LocalFrame | None = None

    def value(number: int, cells: list[str], name: str, known: dict[str, float]) -> float:
        unit = units.get(name, "")
        if unit not in known:
            raise ConfigError(f"{path}: column {name} in [{unit}]; known are {', '.join(known)}")
        return known[unit] * _number(path, number, cells[place[name]])

    def read(number: int, cells: list[str]) -> tuple[float, Vec3, Vec3]:
        nonlocal frame
        first, second, up = (value(number, cells, name, _LENGTH_M) for name in position)
        if geographic:
            frame = frame or LocalFrame(first, second)
            north, east, _ = frame.to_ned_m(GeoPoint(first, second, 0.0))
        else:
            north, east = second, first
        if speeds[0] == "trk":
            track = value(number, cells, "trk", _ANGLE_RAD)
            ground = value(number, cells, "gs", _SPEED_MPS)
            north_mps, east_mps = ground * math.cos(track), ground * math.sin(track)
        else:
            east_mps, north_mps = (value(number, cells, name, _SPEED_MPS) for name in speeds[:2])
        climb_mps = value(number, cells, speeds[2], _SPEED_MPS)
        time_s = value(number, cells, "time", _TIME_S)
        return time_s, (north, east, -up), (north_mps, east_mps, -climb_mps)

    return read


def _number(path: FilePath, number: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError(f"{path}, line {number}: {cell.strip() or 'nothing'} is not a number")
    return value


def _encounter(path: FilePath, name: str, aircraft: dict[str, _Rows]) -> Encounter:
    """An encounter from rows; ours is the aircraft called ownship, or the first, flown straight."""
    own_name = next((key for key in aircraft if key.lower() == "ownship"), next(iter(aircraft)))
    own = sorted(aircraft[own_name])
    others = [_path(path, name, sorted(rows)) for key, rows in aircraft.items() if key != own_name]
    if not others:
        raise ConfigError(f"{path}: {name}: only one aircraft")
    begins_s, position, velocity = own[0]
    duration_s = min(own[-1][0], *(float(other.time_s[-1]) for other in others)) - begins_s
    if duration_s < _SHORTEST_S:
        raise ConfigError(
            f"{path}: {name}: it lasts {max(duration_s, 0.0):.1f} s, less than a decision period"
        )
    intruders = tuple(Path(o.time_s - begins_s, o.position_m, o.velocity_mps) for o in others)
    course_rad = math.atan2(velocity[1], velocity[0])
    speed_mps = math.hypot(velocity[0], velocity[1])
    level = (velocity[0], velocity[1], 0.0)
    first = passing(position, level, intruders[0], duration_s)
    return Encounter(
        name,
        position,
        course_rad,
        speed_mps,
        intruders,
        duration_s=math.floor(duration_s),
        geometry=first.geometry,
        closing_mps=first.closing_mps,
        nominal_horizontal_m=first.horizontal_m,
        nominal_vertical_m=first.vertical_m,
        source=path.name,
    )


def _path(path: FilePath, name: str, rows: _Rows) -> Path:
    times = np.array([row[0] for row in rows])
    if len(rows) < 2 or not (np.diff(times) > 0.0).all():
        raise ConfigError(f"{path}: {name}: an aircraft needs at least two rows with rising times")
    return Path(times, np.array([row[1] for row in rows]), np.array([row[2] for row in rows]))
