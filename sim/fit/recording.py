"""A recorded flight: what the autopilot reported, and the commands that it received, on its own clock."""

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from companion.errors import LogError
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.framing import decode
from companion.mavlink.tlog import read_tlog
from sim.vehicle.mission import NAV_WAYPOINT, MissionItem, takeoff_item

Numbers = NDArray[np.float64]
Autopilot = Literal["ardupilot", "px4"]
AUTOPILOT_IDS: dict[int, Autopilot] = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot",
    mavlink.MAV_AUTOPILOT_PX4: "px4",
}
_VEHICLE = (1, 1)
# What changes the flight; requests for data do not.
_COMMANDS = frozenset(
    {
        "COMMAND_INT",
        "COMMAND_LONG",
        "MISSION_SET_CURRENT",
        "PARAM_SET",
        "SET_MODE",
        "SET_POSITION_TARGET_GLOBAL_INT",
        "SET_POSITION_TARGET_LOCAL_NED",
    }
)
_DATA_REQUESTS = frozenset({mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE})
_WANTED = frozenset(
    {
        "ATTITUDE",
        "AUTOPILOT_VERSION",
        "GLOBAL_POSITION_INT",
        "HEARTBEAT",
        "HOME_POSITION",
        "MISSION_CURRENT",
        "MISSION_ITEM_INT",
        "PARAM_VALUE",
        "POSITION_TARGET_GLOBAL_INT",
        "VFR_HUD",
    }
)
_IDS = {kind.msgname: message_id for message_id, kind in mavlink.mavlink_map.items()}
_INTEGER_TYPES = range(mavlink.MAV_PARAM_TYPE_UINT8, mavlink.MAV_PARAM_TYPE_REAL32)


@dataclass(frozen=True, slots=True)
class Track:
    """The motion over time [s since boot], one row for each position reported."""

    time_s: Numbers
    lat_deg: Numbers
    lon_deg: Numbers
    altitude_m: Numbers
    north_mps: Numbers
    east_mps: Numbers
    climb_mps: Numbers
    heading_rad: Numbers
    airspeed_mps: Numbers
    bank_rad: Numbers

    @property
    def course_rad(self) -> Numbers:
        """Course over ground, in (-pi, pi]."""
        return np.arctan2(self.east_mps, self.north_mps)

    def index(self, time_s: float) -> int:
        """The row of the first position at this time or later; the last row beyond the end."""
        return min(int(np.searchsorted(self.time_s, time_s)), len(self.time_s) - 1)

    def place(self, index: int) -> GeoPoint:
        """The place of a row, height above mean sea level."""
        return GeoPoint(float(self.lat_deg[index]), float(self.lon_deg[index]), float(self.altitude_m[index]))


@dataclass(frozen=True, slots=True)
class Steps:
    """A number that changes at some times: its values from those times on."""

    times_s: tuple[float, ...]
    values: tuple[int, ...]

    def at(self, time_s: float) -> int:
        """The value at a time; the first one before its time."""
        return self.values[max(int(np.searchsorted(self.times_s, time_s, side="right")) - 1, 0)]

    def during(self, begin_s: float, end_s: float) -> set[int]:
        """All values that held at some time of an interval."""
        inside = zip(self.times_s, self.values, strict=True)
        return {self.at(begin_s), *(value for time_s, value in inside if begin_s <= time_s <= end_s)}

    def since_s(self, time_s: float) -> float:
        """The time since when the value of `time_s` holds."""
        return self.times_s[max(int(np.searchsorted(self.times_s, time_s, side="right")) - 1, 0)]

    @classmethod
    def of(cls, rows: list[tuple[float, int]]) -> "Steps":
        """The changes in rows of time and value, in the order of time."""
        changes = [row for i, row in enumerate(rows) if i == 0 or row[1] != rows[i - 1][1]]
        return cls(tuple(time_s for time_s, _ in changes), tuple(value for _, value in changes))


@dataclass(frozen=True, slots=True)
class Recording:
    """One flight of one autopilot. `items` are numbered as the autopilot numbers them.

    `version`: major and minor, if reported; `modes` and `sequences`: mode and mission item as reported.
    """

    name: str
    autopilot: Autopilot
    version: tuple[int, int] | None
    home: GeoPoint
    items: tuple[MissionItem, ...]
    parameters: dict[str, float]
    track: Track
    modes: Steps
    sequences: Steps
    commands: tuple[tuple[float, Message], ...]


def read_recording(path: Path) -> Recording:
    """The flight in a telemetry log; `LogError` without an autopilot's positions and heartbeats."""
    rows = list(_messages(path))
    clock = _Clock(rows, path)
    reported: dict[str, list[tuple[float, Message]]] = {kind: [] for kind in _WANTED}
    commands = []
    for stamp_s, address, message in rows:
        kind = message.get_type()
        if address == _VEHICLE and kind in _WANTED:
            reported[kind].append((clock.time_s(stamp_s), message))
        elif address != _VEHICLE and _commands_vehicle(message):
            commands.append((clock.time_s(stamp_s), message))
    beats = reported["HEARTBEAT"]
    autopilot = AUTOPILOT_IDS.get(beats[0][1].autopilot) if beats else None
    if autopilot is None:
        raise LogError(f"{path}: no heartbeat of an autopilot that is simulated here")
    sequences = Steps.of([(time_s, m.seq) for time_s, m in reported["MISSION_CURRENT"]])
    return Recording(
        path.stem,
        autopilot,
        _version(reported),
        _home(reported, path),
        _items(reported, sequences, autopilot),
        {m.param_id: _parameter(m, autopilot) for _, m in reported["PARAM_VALUE"]},
        _track(reported),
        Steps.of([(time_s, m.custom_mode) for time_s, m in beats]),
        sequences,
        tuple(commands),
    )


def _messages(path: Path) -> Iterator[tuple[float, tuple[int, int], Message]]:
    """Stamp [s], sender and content of each message that matters."""
    for stamp_us, frame in read_tlog(path, {_IDS[kind] for kind in _WANTED | _COMMANDS}):
        message = decode(frame)
        if message is not None:
            yield stamp_us / 1e6, (frame.system_id, frame.component_id), message


class _Clock:
    """The vehicle's time since boot for each stamp of the log, by its positions."""

    def __init__(self, rows: list[tuple[float, tuple[int, int], Message]], path: Path) -> None:
        pairs = [
            (stamp_s, message.time_boot_ms / 1e3)
            for stamp_s, address, message in rows
            if address == _VEHICLE and message.get_type() == "GLOBAL_POSITION_INT"
        ]
        if len(pairs) < 2:
            raise LogError(f"{path}: no positions of an autopilot")
        self._stamps_s, self._boot_s = np.array(pairs).T

    def time_s(self, stamp_s: float) -> float:
        """Seconds since boot at a stamp, interpolated between two positions."""
        return float(np.interp(stamp_s, self._stamps_s, self._boot_s))


def _commands_vehicle(message: Message) -> bool:
    if message.get_type() not in _COMMANDS or message.target_system != _VEHICLE[0]:
        return False
    return getattr(message, "command", None) not in _DATA_REQUESTS


def _version(reported: dict[str, list[tuple[float, Message]]]) -> tuple[int, int] | None:
    versions = [message.flight_sw_version for _, message in reported["AUTOPILOT_VERSION"]]
    return (versions[-1] >> 24, versions[-1] >> 16 & 0xFF) if versions else None


def _home(reported: dict[str, list[tuple[float, Message]]], path: Path) -> GeoPoint:
    if not reported["HOME_POSITION"]:
        raise LogError(f"{path}: no home position")
    home = reported["HOME_POSITION"][-1][1]
    return GeoPoint(home.latitude / 1e7, home.longitude / 1e7, home.altitude / 1e3)


def _items(
    reported: dict[str, list[tuple[float, Message]]], sequences: Steps, autopilot: Autopilot
) -> tuple[MissionItem, ...]:
    """The mission as downloaded; otherwise a take-off, then the targets that were reported on the way."""
    downloaded = {m.seq: _item(m) for _, m in reported["MISSION_ITEM_INT"] if m.mission_type == 0}
    if downloaded:
        return tuple(downloaded[sequence] for sequence in sorted(downloaded))
    targets = {sequences.at(time_s): m for time_s, m in reported["POSITION_TARGET_GLOBAL_INT"]}
    first = 1 if autopilot == "ardupilot" else 0
    flown = {sequence: _waypoint_at(m) for sequence, m in targets.items() if sequence > first}
    return tuple(flown.get(sequence, takeoff_item(0.0)) for sequence in range(max(targets, default=-1) + 1))


def _item(message: Message) -> MissionItem:
    params = (message.param1, message.param2, message.param3, message.param4)
    first, second, third, fourth = (0.0 if math.isnan(value) else value for value in params)
    place = (message.x, message.y, message.z, message.frame)
    return MissionItem(message.command, (first, second, third, fourth), *place, message.autocontinue)


def _waypoint_at(message: Message) -> MissionItem:
    return MissionItem(
        NAV_WAYPOINT,
        lat_e7=message.lat_int,
        lon_e7=message.lon_int,
        altitude_m=message.alt,
        frame=0,
    )


def _parameter(message: Message, autopilot: Autopilot) -> float:
    """The value; PX4 puts the bytes of integers into the float."""
    if autopilot == "px4" and message.param_type in _INTEGER_TYPES:
        return float(struct.unpack("<i", struct.pack("<f", message.param_value))[0])
    return float(message.param_value)


def _track(reported: dict[str, list[tuple[float, Message]]]) -> Track:
    positions = [message for _, message in reported["GLOBAL_POSITION_INT"]]
    time_s = np.array([m.time_boot_ms for m in positions]) / 1e3
    keep = np.concatenate(([True], np.diff(np.maximum.accumulate(time_s)) > 0.0))

    def column(field: str, scale: float) -> Numbers:
        return (np.array([getattr(m, field) for m in positions]) / scale)[keep]

    time_s = time_s[keep]
    airspeed = np.array([(t_s, m.airspeed) for t_s, m in reported["VFR_HUD"]])
    bank = np.array([(m.time_boot_ms / 1e3, m.roll) for _, m in reported["ATTITUDE"]])
    return Track(
        time_s,
        column("lat", 1e7),
        column("lon", 1e7),
        column("alt", 1e3),
        column("vx", 1e2),
        column("vy", 1e2),
        -column("vz", 1e2),
        np.radians(column("hdg", 1e2)),
        np.interp(time_s, *airspeed.T),
        np.interp(time_s, *bank.T),
    )
