"""A flight from its decision records: own path, traffic and decisions, as columns over time."""

import json
import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.control.state_machine import State
from companion.geodesy import LocalFrame
from companion.mavlink.log_clock import LogClock
from companion.model import Layer
from companion.output.sighting import Evidence, Sighting

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LAYERS = tuple(Layer)
# A flight may have no position for hours; a time stamp further away is damaged.
_LONGEST_GAP_US = 6 * 3600 * 1_000_000
# A larger number in a record is damage, and would not fit into a figure.
_LARGEST = 1e7
_MOST_CONCERNS, _MOST_SOURCES, _LONGEST_WORD = 1000, 16, 200
# Smaller changes of guidance are not listed.
_COURSE_DEG, _SPEED_MPS, _HEIGHT_M = 10.0, 1.0, 15.0
# Without a fix, autopilots send a position at 0, 0.
_NO_FIX_DEG = 1e-3
_WATCHING = frozenset({State.STANDBY, State.WAITING, State.MONITOR})


@dataclass(frozen=True, slots=True)
class Change:
    """The start of a different state, mode, layer or guidance."""

    time_s: float
    mode: str | None
    state: str
    layer: Layer
    guidance: tuple[float, float, float] | None  # course [deg], airspeed [m/s], altitude [m]
    because: str

    @property
    def doing(self) -> str:
        """The state; "watching" for both standby and monitor, which may alternate every second."""
        return "watching" if self.state in _WATCHING else self.state

    def differs(self, other: "Change") -> bool:
        """Whether it differs enough from the change before to be listed."""
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
class OperatorText:
    """A text to the operator, from the companion or the autopilot."""

    time_s: float
    severity: int
    text: str
    source: str = "companion"


class Concern(NamedTuple):
    """An aircraft that was not avoided, or was odd: from when to when, and how near."""

    kind: str
    name: str
    avoided: bool
    nearest_m: float | None
    first_s: float = 0.0
    last_s: float = 0.0


class TrackHistory:
    """One track over the flight: its positions relative to us, by rows of the flight's columns."""

    def __init__(self, track_id: str) -> None:
        self.track_id = track_id
        self.callsign: str | None = None
        self.icao: str | None = None
        self.kind = "aircraft"
        self.sighting = Sighting()
        self._at = array("q")
        self._north, self._east, self._altitude = array("d"), array("d"), array("d")
        self._threat_at = array("q")

    @property
    def name(self) -> str:
        """Callsign, ICAO address or track id, as everywhere else."""
        return self.callsign or self.icao or self.track_id

    @property
    def at(self) -> NDArray[np.int64]:
        """The rows at which it was tracked, as indices into the flight's columns."""
        return np.array(self._at, dtype=np.int64)

    @property
    def threat_at(self) -> NDArray[np.int64]:
        """The rows at which it was part of a conflict."""
        return np.array(self._threat_at, dtype=np.int64)

    @property
    def relative_m(self) -> tuple[Floats, Floats]:
        """Position relative to us, north and east [m]."""
        return np.array(self._north), np.array(self._east)

    @property
    def altitude_m(self) -> Floats:
        """Altitude above mean sea level [m]."""
        return np.array(self._altitude)

    def append(self, at: int, position_m: tuple[float, float, float]) -> None:
        """Add its position at a row: north and east of us, and altitude [m]."""
        if self._at and self._at[-1] == at:
            return
        self._at.append(at)
        self._north.append(position_m[0])
        self._east.append(position_m[1])
        self._altitude.append(position_m[2])

    def add_threat(self, at: int) -> None:
        """Mark it as part of a conflict at a row."""
        self._threat_at.append(at)


_COLUMNS = (
    "time_s", "north_m", "east_m", "altitude_m", "course_deg", "ground_speed_mps", "airspeed_mps",
    "layer", "flying", "commanded_course_deg", "commanded_airspeed_mps", "commanded_altitude_m",
)  # fmt: skip


@dataclass
class Flight:
    """Everything read about a flight. `notes` are problems of the log and remarks about it."""

    name: str
    notes: list[str] = field(default_factory=list)
    replayed: bool = False
    start_us: int | None = None
    frame: LocalFrame | None = None
    home_m: float | None = None  # altitude of home, as recorded first
    changes: list[Change] = field(default_factory=list)
    texts: list[OperatorText] = field(default_factory=list)
    tracks: dict[str, TrackHistory] = field(default_factory=dict)
    concerns: dict[tuple[str, str], Concern] = field(default_factory=dict)  # by kind and name
    mission: list[tuple[float, float]] = field(default_factory=list)  # latitude and longitude [deg]
    forwarded: int = 0  # reports of traffic that were sent on
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
        """The number of steps in the time of the records that were too large, and ignored."""
        return self._clock.jumps

    def column(self, name: str) -> Floats:
        """A column by name; NaN where nothing was commanded; `layer` is an index into `LAYERS`."""
        if len(self._cache.get(name, ())) != len(self):
            self._cache[name] = np.array(self._columns[name])
        return self._cache[name]

    @property
    def height_name(self) -> str:
        """The reference of `height_m`."""
        return "above sea" if self.home_m is None else "above home"

    def height_m(self, altitude_m: float) -> float:
        """A height above home; above the sea if home is unknown."""
        return altitude_m - (self.home_m or 0.0)

    def heights_m(self, column: str) -> Floats:
        """A column of altitudes as heights above home; above the sea if home is unknown."""
        return self.column(column) - (self.home_m or 0.0)

    @property
    def time_s(self) -> Floats:
        """Seconds since the first record."""
        return self.column("time_s")

    @property
    def flying(self) -> Bools:
        """The rows at which the companion flew."""
        return self.column("flying") > 0.0

    @property
    def legs_m(self) -> Floats:
        """The positions of the mission, north and east [m]; empty if unknown."""
        if self.frame is None or not self.mission:
            return np.empty((0, 2))
        return np.array([self.frame.to_north_east_m(*place) for place in self.mission])

    def seconds_at(self, time_us: int) -> float:
        """A time stamp as seconds since the first record."""
        if self.start_us is None:
            self.start_us = time_us
        return (self._clock.at(time_us) - self.start_us) / 1e6

    def add_decision(self, line: bytes | str) -> None:
        """Add a decision record; an invalid one is counted and left out."""
        try:
            self._add(json.loads(line, parse_constant=_refuse))
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
            self.unusable += 1

    def _add(self, record: Mapping[str, Any]) -> None:
        own = record["own"]
        lat, lon = _number(own, "lat_deg"), _number(own, "lon_deg")
        if abs(lat) > 90.0 or abs(lon) > 180.0:
            raise ValueError("no position on earth")
        if math.hypot(lat, lon) < _NO_FIX_DEG:
            self.without_fix += 1
            return
        columns = {
            name: _number(own, name)
            for name in ("altitude_m", "course_deg", "ground_speed_mps", "airspeed_mps")
        }
        layer, guidance = Layer(record["layer"]), record["guidance"]
        commanded = None
        if guidance is not None:
            commanded = tuple(
                _number(guidance, name) for name in ("course_deg", "airspeed_mps", "altitude_m")
            )
        course, speed, height = commanded or (math.nan, math.nan, math.nan)
        seen = [(str(one["track"]), one, _position_m(one), _evidence_of(one)) for one in record["traffic"]]
        concerns = [_concern_of(one) for one in record.get("concerns", ())]
        threats = {str(one["track"]) for one in record["threats"]}
        time_us = record["time_us"]
        if not isinstance(time_us, int) or isinstance(time_us, bool):
            raise TypeError("time_us")
        state, mode, because = str(record["state"]), record["mode"], str(record["because"])

        if self.home_m is None and own.get("height_m") is not None:
            self.home_m = columns["altitude_m"] - _number(own, "height_m")
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
        for track_id, one, position_m, evidence in seen:
            history = self._history(track_id, one)
            history.append(at, position_m)
            slant_m = math.hypot(*position_m[:2], position_m[2] - columns["altitude_m"])
            history.sighting.note(time_s, evidence._replace(slant_m=slant_m))
        for concern in concerns:
            self._note_concern(time_s, concern)
        for track_id in threats & self.tracks.keys():
            self.tracks[track_id].add_threat(at)
        mode = None if mode is None else str(mode)
        guided = None if commanded is None else (course, speed, height)
        change = Change(time_s, mode, state, layer, guided, because)
        if not self.changes or change.differs(self.changes[-1]):
            self.changes.append(change)

    def _note_concern(self, time_s: float, concern: Concern) -> None:
        key = concern.kind, concern.name
        known = self.concerns.get(key)
        if known is not None:
            nearest = known if _order_m(known) < _order_m(concern) else concern
            self.concerns[key] = nearest._replace(first_s=known.first_s, last_s=time_s)
        elif len(self.concerns) < _MOST_CONCERNS:
            self.concerns[key] = concern._replace(first_s=time_s, last_s=time_s)

    def _history(self, track_id: str, one: Mapping[str, Any]) -> TrackHistory:
        history = self.tracks.get(track_id)
        if history is None:
            history = self.tracks[track_id] = TrackHistory(track_id)
        callsign, icao = one.get("callsign"), one.get("icao")
        history.callsign = str(callsign).strip() if callsign else history.callsign
        history.icao = str(icao) if icao else history.icao
        history.kind = str(one.get("kind", history.kind))
        return history


def _position_m(one: Mapping[str, Any]) -> tuple[float, float, float]:
    return _number(one, "north_m"), _number(one, "east_m"), _number(one, "altitude_m")


def _evidence_of(one: Mapping[str, Any]) -> Evidence:
    """What is known of a track; records of former versions have only its age."""
    state, reports, sigma_m = one.get("state"), one.get("reports", 0), one.get("position_sigma_m")
    return Evidence(
        None if state is None else _word(state),
        tuple(_word(source) for source in list(one.get("sources", ()))[:_MOST_SOURCES]),
        _number(one, "age_s") if "age_s" in one else 0.0,
        0.0,
        None if sigma_m is None else _number(one, "position_sigma_m"),
        reports if isinstance(reports, int) else 0,
    )


def _concern_of(one: Mapping[str, Any]) -> Concern:
    nearest_m = None if one.get("distance_m") is None else _number(one, "distance_m")
    return Concern(_word(one["kind"]), _word(one["name"]), one.get("avoided") is True, nearest_m)


def _order_m(concern: Concern) -> float:
    return math.inf if concern.nearest_m is None else concern.nearest_m


def _word(value: object) -> str:
    return str(value)[:_LONGEST_WORD]


def _number(record: Mapping[str, Any], key: str) -> float:
    value = record[key]
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < _LARGEST:
        raise ValueError(key)
    return float(value)


def _refuse(constant: str) -> float:
    raise ValueError(constant)
