"""A flight as its decisions tell it: own path, who was around, what was decided; columns over time."""

import json
import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.control.state_machine import State
from companion.geodesy import LocalFrame
from companion.model import Layer
from companion.replay import LogClock

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LAYERS = tuple(Layer)
# A flight may be without a position for an hour; a stamp that is further off is damage.
_LONGEST_GAP_US = 6 * 3600 * 1_000_000
# No number in a record is larger but for damage; what is drawn has to fit into a figure.
_LARGEST = 1e7
# Guidance that changes by less than this is the same as before.
_COURSE_DEG, _SPEED_MPS, _HEIGHT_M = 10.0, 1.0, 15.0
# An autopilot without a fix says 0, 0, where nobody flies.
_NOWHERE_DEG = 1e-3
_WATCHING = frozenset({State.STANDBY, State.MONITOR})


@dataclass(frozen=True, slots=True)
class Change:
    """The first moment of something else: another state, mode or layer, or guidance that differs."""

    time_s: float
    mode: str | None
    state: str
    layer: Layer
    guidance: tuple[float, float, float] | None  # course [deg], airspeed [m/s], height above sea [m]
    because: str

    @property
    def doing(self) -> str:
        """The state; ready or not to take over, which may change every second, is all watching."""
        return "watching" if self.state in _WATCHING else self.state

    def differs(self, other: "Change") -> bool:
        """Whether it is worth telling after the other."""
        if (self.mode, self.doing, self.layer) != (other.mode, other.doing, other.layer):
            return True
        if self.guidance is None or other.guidance is None:
            return self.guidance is not other.guidance
        (course, speed, height), (course_before, speed_before, height_before) = self.guidance, other.guidance
        return (
            abs((course - course_before + 180.0) % 360.0 - 180.0) > _COURSE_DEG
            or abs(speed - speed_before) > _SPEED_MPS
            or abs(height - height_before) > _HEIGHT_M
        )


@dataclass(frozen=True, slots=True)
class Told:
    """Words, and by whom: the companion or the autopilot."""

    time_s: float
    severity: int
    text: str
    by: str = "companion"


class Trail:
    """One track: where it was relative to us, and at which of the flight's moments."""

    def __init__(self, track_id: str) -> None:
        self.track_id = track_id
        self.callsign: str | None = None
        self.icao: str | None = None
        self.kind = "aircraft"
        self._at = array("q")
        self._north, self._east, self._altitude = array("d"), array("d"), array("d")
        self._threat_at = array("q")

    @property
    def name(self) -> str:
        """As people call it."""
        return f"{self.callsign} ({self.track_id})" if self.callsign else self.track_id

    @property
    def at(self) -> NDArray[np.int64]:
        """The moments at which it was tracked, as indices into the flight's columns."""
        return np.array(self._at, dtype=np.int64)

    @property
    def threat_at(self) -> NDArray[np.int64]:
        """Those at which it was part of a conflict."""
        return np.array(self._threat_at, dtype=np.int64)

    @property
    def relative_m(self) -> tuple[Floats, Floats]:
        """North and east of us [m]."""
        return np.array(self._north), np.array(self._east)

    @property
    def altitude_m(self) -> Floats:
        """Above mean sea level."""
        return np.array(self._altitude)

    def append(self, at: int, place: tuple[float, float, float]) -> None:
        """North and east of us, and height."""
        if self._at and self._at[-1] == at:
            return
        self._at.append(at)
        self._north.append(place[0])
        self._east.append(place[1])
        self._altitude.append(place[2])

    def threatens(self, at: int) -> None:
        """It is part of a conflict at that moment."""
        self._threat_at.append(at)


_COLUMNS = (
    "time_s", "north_m", "east_m", "altitude_m", "course_deg", "ground_speed_mps", "airspeed_mps",
    "layer", "flying", "commanded_course_deg", "commanded_airspeed_mps", "commanded_altitude_m",
)  # fmt: skip


@dataclass
class Flight:
    """All that is known of a flight. `notes` say what is wrong with the log, or must be known about it."""

    name: str
    notes: list[str] = field(default_factory=list)
    replayed: bool = False
    start_us: int | None = None
    frame: LocalFrame | None = None
    changes: list[Change] = field(default_factory=list)
    told: list[Told] = field(default_factory=list)
    trails: dict[str, Trail] = field(default_factory=dict)
    mission: list[tuple[float, float]] = field(default_factory=list)  # latitude and longitude [deg]
    unusable: int = 0
    without_fix: int = 0

    def __post_init__(self) -> None:
        self._columns: dict[str, array[float]] = {name: array("d") for name in _COLUMNS}
        self._cache: dict[str, Floats] = {}
        self._clock = LogClock(_LONGEST_GAP_US)

    def __len__(self) -> int:
        return len(self._columns["time_s"])

    @property
    def jumps(self) -> int:
        """How often the time of the records stepped so far that it was not believed."""
        return self._clock.jumps

    def column(self, name: str) -> Floats:
        """One of the columns; what was not commanded is NaN, `layer` an index into `LAYERS`."""
        if len(self._cache.get(name, ())) != len(self):
            self._cache[name] = np.array(self._columns[name])
        return self._cache[name]

    @property
    def time_s(self) -> Floats:
        """Seconds since the first record."""
        return self.column("time_s")

    @property
    def flying(self) -> Bools:
        """When the companion flew."""
        return self.column("flying") > 0.0

    @property
    def legs_m(self) -> Floats:
        """The mission, a north and east [m] in each row; empty when it is not known."""
        if self.frame is None or not self.mission:
            return np.empty((0, 2))
        return np.array([self.frame.to_north_east_m(*place) for place in self.mission])

    def seconds_at(self, time_us: int) -> float:
        """A stamp as seconds since the first record."""
        if self.start_us is None:
            self.start_us = time_us
        return (self._clock.at(time_us) - self.start_us) / 1e6

    def take(self, line: bytes | str) -> None:
        """Add a decision; one that makes no sense is counted and left out."""
        try:
            self._take(json.loads(line, parse_constant=_refuse))
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
            self.unusable += 1

    def _take(self, record: Mapping[str, Any]) -> None:
        own = record["own"]
        lat, lon = _number(own, "lat_deg"), _number(own, "lon_deg")
        if abs(lat) > 90.0 or abs(lon) > 180.0:
            raise ValueError("no place on earth")
        if math.hypot(lat, lon) < _NOWHERE_DEG:
            self.without_fix += 1
            return
        columns = {
            name: _number(own, name)
            for name in ("altitude_m", "course_deg", "ground_speed_mps", "airspeed_mps")
        }
        layer, guidance = Layer(record["layer"]), record["guidance"]
        asked = None
        if guidance is not None:
            asked = tuple(_number(guidance, name) for name in ("course_deg", "airspeed_mps", "altitude_m"))
        course, speed, height = asked or (math.nan, math.nan, math.nan)
        seen = [(str(one["track"]), one, _place(one)) for one in record["traffic"]]
        threats = {str(one["track"]) for one in record["threats"]}
        time_us = record["time_us"]
        if not isinstance(time_us, int) or isinstance(time_us, bool):
            raise TypeError("time_us")
        state, mode, because = str(record["state"]), record["mode"], str(record["because"])

        if self.frame is None:
            self.frame = LocalFrame(lat, lon)
        north_m, east_m = self.frame.to_north_east_m(lat, lon)
        time_s, at = self.seconds_at(time_us), len(self)
        columns |= {
            "time_s": time_s,
            "north_m": north_m,
            "east_m": east_m,
            "layer": float(LAYERS.index(layer)),
            "flying": float(record["flying"] is True),
            "commanded_course_deg": course,
            "commanded_airspeed_mps": speed,
            "commanded_altitude_m": height,
        }
        for name, value in columns.items():
            self._columns[name].append(value)
        for track_id, one, place in seen:
            self._trail(track_id, one).append(at, place)
        for track_id in threats & self.trails.keys():
            self.trails[track_id].threatens(at)
        mode = None if mode is None else str(mode)
        commanded = None if asked is None else (course, speed, height)
        change = Change(time_s, mode, state, layer, commanded, because)
        if not self.changes or change.differs(self.changes[-1]):
            self.changes.append(change)

    def _trail(self, track_id: str, one: Mapping[str, Any]) -> Trail:
        trail = self.trails.get(track_id)
        if trail is None:
            trail = self.trails[track_id] = Trail(track_id)
        callsign, icao = one.get("callsign"), one.get("icao")
        trail.callsign = str(callsign).strip() if callsign else trail.callsign
        trail.icao = str(icao) if icao else trail.icao
        trail.kind = str(one.get("kind", trail.kind))
        return trail


def _place(one: Mapping[str, Any]) -> tuple[float, float, float]:
    return _number(one, "north_m"), _number(one, "east_m"), _number(one, "altitude_m")


def _number(record: Mapping[str, Any], key: str) -> float:
    value = record[key]
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < _LARGEST:
        raise ValueError(key)
    return float(value)


def _refuse(constant: str) -> float:
    raise ValueError(constant)
