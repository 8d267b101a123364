"""What a replay saw of all aircraft, as a table for people and as JSON values."""

import math
from collections.abc import Iterator
from operator import itemgetter
from typing import Any, Final

from companion.model import Track, TrafficKind
from companion.output.effects import Record
from companion.output.sighting import Evidence, Sighting

# Further aircraft are counted, but not described: a flood must not fill the memory.
_MOST_AIRCRAFT: Final = 5000
_MOST_ROWS: Final = 20
_HEAD = ("aircraft", "first heard", "last heard", "reports", "closest", "at the end", "sources")


class Sightings:
    """The aircraft of a flight by `track_id`; `left_out` is the number of those beyond what is kept."""

    def __init__(self) -> None:
        self._by_id: dict[str, Sighting] = {}
        self._names: dict[str, str] = {}
        self._left_out: set[str] = set()
        self._end_s = 0.0

    @property
    def left_out(self) -> int:
        """The number of aircraft that are not described."""
        return len(self._left_out)

    def take(self, since_s: float, record: Record) -> None:
        """Take in the tracks of a decision, `since_s` after the start."""
        self._end_s = since_s
        own_m, reports = record.own.position_m, record.around.reports
        for track in record.tracks:
            if track.kind is TrafficKind.OBSTACLE:
                continue
            sighting = self._sighting(track)
            if sighting is not None:
                slant_m = math.dist(track.position_m, own_m)
                sighting.note(since_s, _evidence(track, slant_m, reports.get(track.track_id, 0)))

    def _sighting(self, track: Track) -> Sighting | None:
        sighting = self._by_id.get(track.track_id)
        if sighting is None:
            if len(self._by_id) >= _MOST_AIRCRAFT:
                if len(self._left_out) < _MOST_AIRCRAFT:
                    self._left_out.add(track.track_id)
                return None
            sighting = self._by_id[track.track_id] = Sighting()
        if track.callsign or track.track_id not in self._names:
            self._names[track.track_id] = track.name
        return sighting

    def values(self) -> list[dict[str, Any]]:
        """One JSON object for each aircraft, the nearest first; times are since the start."""
        found = [
            {
                "track": track_id,
                "name": self._names[track_id],
                "sources": list(one.sources),
                "reports": one.reports,
                "first_heard_s": round(one.first_heard_s, 1),
                "last_heard_s": round(one.last_heard_s, 1),
                "closest_m": round(one.closest_m),
                "closest_s": round(one.closest_s, 1),
                "coasted_s": round(one.coasted_s(), 1),
                "state": one.state_at(self._end_s),
            }
            for track_id, one in self._by_id.items()
        ]
        return sorted(found, key=itemgetter("closest_m", "track"))

    def lines(self) -> Iterator[str]:
        """The table; nothing without aircraft."""
        values = self.values()
        if not values:
            return
        rows = [_HEAD, *(_row(one) for one in values[:_MOST_ROWS])]
        widths = [max(len(row[column]) for row in rows) for column in range(len(_HEAD))]
        for row in rows:
            cells = [_aligned(column, cell, widths[column]) for column, cell in enumerate(row)]
            yield "  ".join(cells).rstrip()
        more = len(values) - _MOST_ROWS + self.left_out
        if more > 0:
            least = "at least " if self.left_out == _MOST_AIRCRAFT else ""
            yield f"and {least}{more} more aircraft"


def _evidence(track: Track, slant_m: float, reports: int) -> Evidence:
    return Evidence(track.state.value, track.sources, track.age_s, slant_m, track.position_sigma_m, reports)


def _row(one: dict[str, Any]) -> tuple[str, ...]:
    closest = f"{one['closest_m']} m at {one['closest_s']:.1f} s"
    first, last = f"{one['first_heard_s']:.1f} s", f"{one['last_heard_s']:.1f} s"
    return one["name"], first, last, str(one["reports"]), closest, one["state"], ", ".join(one["sources"])


def _aligned(column: int, cell: str, width: int) -> str:
    """Text to the left, numbers to the right."""
    return cell.rjust(width) if 1 <= column <= 4 else cell.ljust(width)
