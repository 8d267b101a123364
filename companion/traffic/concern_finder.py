"""Finds what the operator should know of the traffic that is known."""

from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from companion.traffic.coasting import Coasting
from companion.traffic.concerns import (
    Concern,
    ConcernedView,
    ConcernKind,
    OldReport,
    name_of,
    nearest_of_each,
    place_of,
)
from companion.traffic.contact import Contact
from companion.traffic.own_identity import OwnIdentity
from companion.traffic.ownship_echo import OwnshipEcho
from companion.traffic.store import TargetStore
from companion.traffic.target import Target

# Evictions in this time are a flood.
_FLOOD_S: Final = 10.0


class Known(NamedTuple):
    """What the tracker knows; `is_track` is whether a target identifies a track."""

    store: TargetStore
    contacts: dict[str, Contact]
    echo: OwnshipEcho
    own: OwnIdentity
    coasting: Coasting
    is_track: Callable[[Target], bool]


class ConcernFinder:
    """Notes what may be of concern while reports are received, and finds what is when it is asked for."""

    def __init__(self, known: Known, view: ConcernedView) -> None:
        self._known, self._view = known, view
        self._without_altitude: dict[str, None] = {}
        self._contested: dict[str, None] = {}

    def note_altitude(self, track_id: str, *, known: bool) -> None:
        """Note whether a target has an altitude."""
        if not known:
            self._without_altitude[track_id] = None
        elif self._without_altitude:
            self._without_altitude.pop(track_id, None)

    def note_contested(self, key: str) -> None:
        """Note that a key has several hypotheses."""
        self._contested[key] = None

    def note_old(self, name: str, report: OldReport) -> None:
        """Note a report that was thrown away because of its age."""
        self._view.note_old(name, report)

    def note_fresh(self, name: str) -> None:
        """Note a report that was not."""
        self._view.forget_old(name)

    def find(self, threats: set[str], evicted_s: float, evicted: int, now_s: float) -> tuple[Concern, ...]:
        """All concerns, the nearest of each kind; `evicted` targets made room, the last at `evicted_s`."""
        found = [
            *self._heightless(now_s),
            *self._view.old(now_s),
            *self._silent(threats, now_s),
            *self._contradictions(now_s),
            *self._shadows(now_s),
            *self._refuted(now_s),
        ]
        if now_s - evicted_s <= _FLOOD_S:
            found.append(Concern(ConcernKind.LEFT_OUT, str(evicted)))
        return nearest_of_each(found)

    def _of(self, kind: ConcernKind, target: Target, now_s: float, seconds: float) -> Concern:
        return self._view.seen(kind, name_of(target), place_of(target, now_s), seconds)

    def _heightless(self, now_s: float) -> Iterator[Concern]:
        for track_id in list(self._without_altitude):
            target = self._known.store.targets.get(track_id)
            if target is None or not self._known.is_track(target):
                continue
            seen = self._of(ConcernKind.HEIGHT_UNKNOWN, target, now_s, now_s - target.measured_s)
            if self._view.is_near(seen, target.reach_s):
                yield seen

    def _silent(self, threats: set[str], now_s: float) -> Iterator[Concern]:
        """Threats that are coasted, and those that were lost."""
        targets = self._known.store.targets
        for key in sorted(threats & targets.keys()):
            target = targets[key]
            if target.is_silent(now_s):
                yield self._of(ConcernKind.NOT_HEARD, target, now_s, now_s - target.measured_s)
        for lost in self._known.coasting.lost(now_s):
            if lost.track_id not in targets:
                place_deg = lost.lat_deg, lost.lon_deg
                yield self._view.seen(ConcernKind.LOST, lost.name, place_deg, now_s - lost.measured_s)

    def _contradictions(self, now_s: float) -> Iterator[Concern]:
        for key in list(self._contested):
            contact = self._known.contacts.get(key)
            if contact is None or len(contact.hypotheses) < 2:
                del self._contested[key]
            else:
                yield from self._view.contradictions(contact, now_s)

    def _shadows(self, now_s: float) -> Iterator[Concern]:
        """The echoes of us that are late or beside us, under another's identity."""
        targets, echo = self._known.store.targets, self._known.echo
        for track_id in sorted(echo.keys & targets.keys()):
            match = echo.shadows.match_of(track_id)
            if match is not None and echo.is_odd(targets[track_id], match):
                yield self._of(ConcernKind.OWN_SHADOW, targets[track_id], now_s, match.delay_s)

    def _refuted(self, now_s: float) -> Iterator[Concern]:
        """The addresses that were said to be ours, and fly elsewhere."""
        for key in self._known.own.refuted:
            contact = self._known.contacts.get(key)
            if contact is not None and contact.hypotheses:
                there = place_of(contact.hypotheses[0], now_s)
                yield self._view.seen(ConcernKind.OWN_ADDRESS, key, there)
