"""From a file to a flight: by the decisions in an MCAP recording, or those that an engine makes of a tlog."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.engine import Engine, Say
from companion.errors import LogError
from companion.mavlink.tlog import read_tlog
from companion.recording import DECISION, STATE, TEXT, Entry, is_mcap, later_parts, read_mcap
from companion.replay import LogClock, replay
from companion.report.flight import Flight, Told
from companion.report.link import LinkLog

Progress = Callable[[int], object]


@dataclass
class Log:
    """A flight, and its link where a tlog tells of it."""

    flight: Flight
    link: LinkLog | None = None


def files_of(path: Path) -> list[Path]:
    """This file and the later parts of the same recording."""
    return [path, *(part for part in later_parts(path) if part.stat().st_size)]


def read_log(path: Path, engine: Callable[[], Engine], on_progress: Progress = lambda _bytes: None) -> Log:
    """What a log tells of its flight; `LogError` when that is nothing. `engine` decides about tlogs."""
    if is_mcap(path):
        return _from_mcap(path, on_progress)
    return _from_tlog(path, engine(), on_progress)


def _from_mcap(path: Path, on_progress: Progress) -> Log:
    flight, before_bytes = Flight(path.name), 0
    for part in files_of(path):
        log = read_mcap(part)
        for count, entry in enumerate(log):
            if count % 256 == 0:
                on_progress(before_bytes + log.read_bytes)
            _take(flight, entry)
        before_bytes += log.read_bytes
        if not log.closed:
            flight.notes.append(f"{part.name} was cut off; what is before the cut is reported")
    _note_missing(flight)
    tlogs = [part.with_suffix(".tlog") for part in files_of(path)]
    link = None
    if all(tlog.is_file() and tlog.stat().st_size for tlog in tlogs):
        try:
            link = _link_of(tlogs, flight)
        except LogError as error:
            flight.notes.append(str(error))
    else:
        flight.notes.append(f"{tlogs[0].name} is not beside it: nothing is known of the link")
    if link is None and not flight and not flight.told:
        raise LogError(f"{path}: the file holds no decision of a companion")
    return Log(flight, link)


def _take(flight: Flight, entry: Entry) -> None:
    if entry.topic == DECISION.name:
        flight.take(entry.data)
    elif entry.topic == TEXT.name:
        told = _object(entry.data)
        severity, text = told.get("severity"), told.get("text")
        if isinstance(severity, int) and isinstance(text, str) and flight.start_us is not None:
            flight.told.append(Told(flight.seconds_at(entry.time_us), severity, text))
    elif entry.topic == STATE.name and not flight.mission:
        flight.mission = _mission_of(_object(entry.data))


def _mission_of(state: dict[str, Any]) -> list[tuple[float, float]]:
    """The places of the mission, as the display showed it."""
    try:
        mission = state.get("mission") or {}
        places = [(float(item["lat_deg"]), float(item["lon_deg"])) for item in mission.get("items", ())]
    except (KeyError, TypeError, ValueError, AttributeError):
        return []
    good = all(abs(lat) <= 90.0 and abs(lon) <= 180.0 and (lat, lon) != (0.0, 0.0) for lat, lon in places)
    return places if good else []


def _object(data: bytes) -> dict[str, Any]:
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


def _from_tlog(path: Path, engine: Engine, on_progress: Progress) -> Log:
    flight, parts = Flight(path.name, replayed=True), files_of(path)
    told: list[tuple[int, Say]] = []
    replayed = replay(
        path,
        engine,
        later_parts=parts[1:],
        on_decision=flight.take,
        on_told=lambda time_us, said: told.append((time_us, said)),
        on_progress=on_progress,
    )
    _note_missing(flight)
    if replayed.bad_bytes:
        flight.notes.append(f"{replayed.bad_bytes:,} bytes of the log belong to no message")
    link = _link_of(parts, flight)
    flight.told = [Told(flight.seconds_at(time_us), said.severity, said.text) for time_us, said in told]
    return Log(flight, link)


def _note_missing(flight: Flight) -> None:
    if flight.unusable:
        flight.notes.append(f"{flight.unusable:,} decisions in the log make no sense and are left out")
    if flight.without_fix:
        flight.notes.append(
            f"{flight.without_fix:,} decisions are left out: the aircraft had no position yet"
        )
    if flight.jumps:
        flight.notes.append(
            f"the time is not believed in {flight.jumps:,} places: it steps by hours, or back"
        )
    if not flight:
        flight.notes.append("nothing is known of a position in this log, so nothing was decided")


def _link_of(tlogs: list[Path], flight: Flight) -> LinkLog:
    """Everything that came and went, on the flight's own clock."""
    link, clock = LinkLog(), LogClock()
    for tlog in tlogs:
        log = read_tlog(tlog)
        for stamp_us, frame in log:
            if flight.start_us is None:
                flight.start_us = stamp_us
            link.observe((clock.at(stamp_us) - flight.start_us) / 1e6, frame)
        if log.unknown:
            flight.notes.append(f"{log.unknown:,} messages are of kinds unknown to us, and count as lost")
    if not flight.mission:
        flight.mission = link.mission
    return link
