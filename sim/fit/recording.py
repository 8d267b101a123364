"""A recorded flight: what the autopilot reported, and the commands that it received, on its own clock."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from companion.autopilots import NAMES
from companion.errors import LogError
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AirData,
    AutopilotVersion,
    Fact,
    Heartbeat,
    HomePosition,
    MissionProgress,
    NavigationTarget,
    OwnPosition,
    Parameter,
)
from companion.mavlink.framing import decode
from companion.mavlink.tlog import read_tlog
from companion.mavlink.translate import frame_to_fact
from sim.scenario import Autopilot
from sim.vehicle.mission import NAV_WAYPOINT, MissionItem, takeoff_item
from sim.vehicle.mission_protocol import MISSION, item_from

Numbers = NDArray[np.float64]
VEHICLE = (1, 1)
# What changes the flight; requests for data do not.
_COMMANDS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_COMMAND_INT,
        mavlink.MAVLINK_MSG_ID_COMMAND_LONG,
        mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT,
        mavlink.MAVLINK_MSG_ID_PARAM_SET,
        mavlink.MAVLINK_MSG_ID_SET_MODE,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
        mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
    }
)
_DATA_REQUESTS = frozenset({mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE})
_FACTS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
    }
)
# Of these Companion needs no facts, or not all that the fake does.
_MESSAGES = frozenset({mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT})


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

    @classmethod
    def of(cls, rows: list[tuple[float, int]]) -> "Steps":
        """The changes in rows of time and value, in the order of time."""
        changes = [row for i, row in enumerate(rows) if i == 0 or row[1] != rows[i - 1][1]]
        return cls(tuple(time_s for time_s, _ in changes), tuple(value for _, value in changes))


@dataclass(frozen=True, slots=True)
class Recording:
    """One flight of one autopilot. `items` are numbered as the autopilot numbers them.

    `modes` and `sequences`: mode and mission item as reported.
    """

    name: str
    autopilot: Autopilot
    home: GeoPoint
    items: tuple[MissionItem, ...]
    parameters: dict[str, float]
    track: Track
    modes: Steps
    sequences: Steps
    commands: tuple[tuple[float, Message], ...]


_Kind = TypeVar("_Kind")


class _Log:
    """What the vehicle sent and the commands to it, on its own clock [s since boot]."""

    def __init__(self, path: Path) -> None:
        self.path = path
        rows = list(_contents(path))
        positions = [(s, fact.boot_time_s) for s, _, fact in rows if isinstance(fact, OwnPosition)]
        if len(positions) < 2:
            raise LogError(f"{path}: no positions of an autopilot")
        stamps_s, boot_s = np.array(positions).T
        times_s = np.interp([stamp_s for stamp_s, _, _ in rows], stamps_s, boot_s).tolist()
        timed = [(time_s, ours, content) for time_s, (_, ours, content) in zip(times_s, rows, strict=True)]
        self._sent = [(time_s, content) for time_s, ours, content in timed if ours]
        self.commands = tuple((time_s, content) for time_s, ours, content in timed if not ours)

    def of(self, kind: type[_Kind]) -> list[tuple[float, _Kind]]:
        """Times, and facts or messages, of one kind."""
        return [(time_s, content) for time_s, content in self._sent if isinstance(content, kind)]

    def last(self, kind: type[_Kind], what: str) -> _Kind:
        """The last one of a kind; `LogError` if there is none."""
        facts = self.of(kind)
        if not facts:
            raise LogError(f"{self.path}: no {what}")
        return facts[-1][1]


def _contents(path: Path) -> Iterator[tuple[float, bool, Fact | Message]]:
    """Stamp [s], whether the vehicle sent it, and the fact or message; from others only its commands."""
    for stamp_us, frame in read_tlog(path, set(_FACTS | _MESSAGES | _COMMANDS)):
        ours = (frame.system_id, frame.component_id) == VEHICLE
        if ours and frame.message_id in _FACTS:
            fact = frame_to_fact(frame, stamp_us / 1e6)
            if fact is not None:
                yield stamp_us / 1e6, ours, fact
        elif frame.message_id in (_MESSAGES if ours else _COMMANDS):
            message = decode(frame)
            if message is not None and (ours or _commands_vehicle(message)):
                yield stamp_us / 1e6, ours, message


def _commands_vehicle(message: Message) -> bool:
    return message.target_system == VEHICLE[0] and getattr(message, "command", None) not in _DATA_REQUESTS


def read_recording(path: Path) -> Recording:
    """The flight in a telemetry log; `LogError` without an autopilot's positions and heartbeats."""
    log = _Log(path)
    sequences = Steps.of([(time_s, fact.sequence) for time_s, fact in log.of(MissionProgress)])
    home = log.last(HomePosition, "home position")
    autopilot = _autopilot(log)
    return Recording(
        path.stem,
        autopilot,
        GeoPoint(home.lat_deg, home.lon_deg, home.altitude_m),
        _items(log, sequences, autopilot),
        {fact.name: fact.value for _, fact in log.of(Parameter)},
        _track(log),
        Steps.of([(time_s, fact.custom_mode) for time_s, fact in log.of(Heartbeat)]),
        sequences,
        log.commands,
    )


def _autopilot(log: _Log) -> Autopilot:
    """The autopilot that is simulated here; PX4 is 1.16 if it does not report its version."""
    kind = log.last(Heartbeat, "heartbeat of an autopilot").autopilot
    if kind == NAMES["ardupilot"]:
        return "ardupilot"
    if kind != NAMES["px4"]:
        raise LogError(f"{log.path}: no heartbeat of an autopilot that is simulated here")
    since_1_18 = any((fact.major, fact.minor) >= (1, 18) for _, fact in log.of(AutopilotVersion))
    return "px4-1.18" if since_1_18 else "px4"


def _items(log: _Log, sequences: Steps, autopilot: Autopilot) -> tuple[MissionItem, ...]:
    """The mission as downloaded; otherwise a take-off, then the targets that were reported on the way."""
    messages = log.of(mavlink.MAVLink_mission_item_int_message)
    downloaded = {m.seq: item_from(m) for _, m in messages if m.mission_type == MISSION}
    if downloaded:
        items = (downloaded[sequence] for sequence in sorted(downloaded))
        return tuple(item for item in items if item is not None)
    targets = {sequences.at(time_s): fact for time_s, fact in log.of(NavigationTarget)}
    first = 1 if autopilot == "ardupilot" else 0
    flown = {sequence: _waypoint_at(fact) for sequence, fact in targets.items() if sequence > first}
    return tuple(flown.get(sequence, takeoff_item(0.0)) for sequence in range(max(targets, default=-1) + 1))


def _waypoint_at(target: NavigationTarget) -> MissionItem:
    return MissionItem(
        NAV_WAYPOINT,
        lat_e7=round(target.lat_deg * 1e7),
        lon_e7=round(target.lon_deg * 1e7),
        altitude_m=target.altitude_m or 0.0,
        frame=0,
    )


def _track(log: _Log) -> Track:
    positions = np.array(
        [
            (fact.boot_time_s, fact.lat_deg, fact.lon_deg, fact.altitude_m, *fact.velocity_mps)
            for _, fact in log.of(OwnPosition)
        ]
    )
    later = np.diff(np.maximum.accumulate(positions[:, 0])) > 0.0
    time_s, lat_deg, lon_deg, altitude_m, north_mps, east_mps, down_mps = positions[
        np.concatenate(([True], later))
    ].T
    airspeed = [(t, fact.airspeed_mps) for t, fact in log.of(AirData) if fact.airspeed_mps is not None]
    bank = [(m.time_boot_ms / 1e3, m.roll) for _, m in log.of(mavlink.MAVLink_attitude_message)]
    return Track(
        time_s,
        lat_deg,
        lon_deg,
        altitude_m,
        north_mps,
        east_mps,
        -down_mps,
        np.interp(time_s, *np.array(airspeed).T),
        np.interp(time_s, *np.array(bank).T),
    )
