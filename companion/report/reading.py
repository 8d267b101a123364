"""From a log to a flight: the decisions in an MCAP recording, or those of a replay of a tlog."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.engine import Engine, Say
from companion.errors import LogError
from companion.mavlink.log_clock import LogClock
from companion.mavlink.tlog import read_tlog
from companion.recording import DECISION, STATE, TEXT, Entry, is_mcap, later_parts, read_mcap
from companion.replay import replay
from companion.report.flight import Flight, OperatorText
from companion.report.link import LinkLog

Progress = Callable[[int], object]
_MOST_FORWARDED = 1_000_000_000  # a larger number is damage


@dataclass
class Log:
    """A flight, and its link if there is a tlog."""

    flight: Flight
    link: LinkLog | None = None


def files_of(path: Path) -> list[Path]:
    """This file and the later parts of the same recording."""
    return [path, *(part for part in later_parts(path) if part.stat().st_size)]


def read_log(path: Path, engine: Callable[[], Engine], on_progress: Progress = lambda _bytes: None) -> Log:
    """The flight in a log; `LogError` if there is none. `engine` makes the engine that replays a tlog."""
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
            _add_entry(flight, entry)
        before_bytes += log.read_bytes
        if not log.closed:
            flight.notes.append(f"{part.name} was cut off; the report ends there")
    _note_missing(flight)
    tlogs = [part.with_suffix(".tlog") for part in files_of(path)]
    link = None
    if all(tlog.is_file() and tlog.stat().st_size for tlog in tlogs):
        try:
            link = _link_of(tlogs, flight)
        except LogError as error:
            flight.notes.append(str(error))
    else:
        flight.notes.append(f"{tlogs[0].name} is missing: the link is unknown")
    if link is None and not flight and not flight.texts:
        raise LogError(f"{path}: the file has no decisions of Companion")
    return Log(flight, link)


def _add_entry(flight: Flight, entry: Entry) -> None:
    if entry.topic == DECISION.name:
        flight.add_decision(entry.data)
    elif entry.topic == TEXT.name:
        record = _object(entry.data)
        severity, text = record.get("severity"), record.get("text")
        if isinstance(severity, int) and isinstance(text, str) and flight.start_us is not None:
            flight.texts.append(OperatorText(flight.seconds_at(entry.time_us), severity, text))
    elif entry.topic == STATE.name:
        state = _object(entry.data)
        flight.mission = flight.mission or _mission_of(state)
        flight.forwarded = max(flight.forwarded, _forwarded_of(state))


def _mission_of(state: dict[str, Any]) -> list[tuple[float, float]]:
    """The positions of the mission in a state of the display."""
    try:
        mission = state.get("mission") or {}
        positions = [(float(item["lat_deg"]), float(item["lon_deg"])) for item in mission.get("items", ())]
    except (KeyError, TypeError, ValueError, AttributeError):
        return []
    good = all(abs(lat) <= 90.0 and abs(lon) <= 180.0 and (lat, lon) != (0.0, 0.0) for lat, lon in positions)
    return positions if good else []


def _forwarded_of(state: dict[str, Any]) -> int:
    """How many reports had been sent on, in a state of the display."""
    service = state.get("service")
    count = service.get("forwarded_reports") if isinstance(service, dict) else None
    return count if isinstance(count, int) and 0 <= count < _MOST_FORWARDED else 0


def _object(data: bytes) -> dict[str, Any]:
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


def _from_tlog(path: Path, engine: Engine, on_progress: Progress) -> Log:
    flight, parts = Flight(path.name, replayed=True), files_of(path)
    texts: list[tuple[int, Say]] = []
    replayed = replay(
        path,
        engine,
        later_parts=parts[1:],
        on_decision=flight.add_decision,
        on_told=lambda time_us, say: texts.append((time_us, say)),
        on_progress=on_progress,
    )
    _note_missing(flight)
    flight.forwarded = replayed.forwarded
    if replayed.bad_bytes:
        flight.notes.append(f"{replayed.bad_bytes:,} bytes of the log belong to no message")
    link = _link_of(parts, flight)
    # Not by `seconds_at`, whose clock has reached the end of the flight and never runs backwards.
    start_us = flight.start_us or 0
    flight.texts = [OperatorText((at_us - start_us) / 1e6, say.severity, say.text) for at_us, say in texts]
    return Log(flight, link)


def _note_missing(flight: Flight) -> None:
    if flight.unusable:
        flight.notes.append(f"{flight.unusable:,} invalid decisions in the log are left out")
    if flight.without_fix:
        flight.notes.append(f"{flight.without_fix:,} decisions are left out: the aircraft had no position")
    if flight.jumps:
        flight.notes.append(f"{flight.jumps:,} steps of the time by hours, or backwards, are ignored")
    if not flight:
        flight.notes.append("the log has no own position, so that nothing was decided")


def _link_of(tlogs: list[Path], flight: Flight) -> LinkLog:
    """The frames of the tlogs, on the clock of the flight."""
    link, clock = LinkLog(), LogClock()
    for tlog in tlogs:
        log = read_tlog(tlog)
        for stamp_us, frame in log:
            if flight.start_us is None:
                flight.start_us = stamp_us
            link.add((clock.at(stamp_us, frame) - flight.start_us) / 1e6, frame)
        if log.unknown:
            flight.notes.append(f"{log.unknown:,} messages are of unknown types, and count as lost")
    if not flight.mission:
        flight.mission = link.mission
    return link
