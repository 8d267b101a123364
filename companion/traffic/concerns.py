"""What the operator should know of traffic: not avoided, contradicting itself, or not heard any more."""

import math
from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import LatLon
from companion.traffic.contact import Contact
from companion.traffic.own_aircraft import OwnIdentity, OwnTrail
from companion.traffic.ownship_echo import OwnshipEcho
from companion.traffic.params import TrafficParams
from companion.traffic.store import TargetStore
from companion.traffic.target import Target
from companion.traffic.tracks import Coasting

# What is near is looked at for this long after it was reported.
_RECENT_S: Final = 10.0
_MOST_OLD: Final = 64
# Of several aircraft of a kind, the nearest are named.
_MOST_OF_A_KIND: Final = 3
# Two hypotheses of one key further apart than this are two places. Nearer, they are two heights if those
# differ by this, otherwise two places all the same.
_TWO_PLACES_M, _TWO_HEIGHTS_M = 300.0, 50.0


class ConcernKind(StrEnum):
    """Why an aircraft is of concern."""

    HEIGHT_UNKNOWN = "height unknown"
    OLD_REPORTS = "old reports"
    NOT_HEARD = "not heard"
    LOST = "lost"
    TWO_PLACES = "reported in two places"
    TWO_HEIGHTS = "reported at two heights"
    OWN_SHADOW = "own shadow"
    OWN_ADDRESS = "own address flies elsewhere"
    LEFT_OUT = "aircraft left out"


class Concern(NamedTuple):
    """One aircraft as seen from ours: `seconds` is how old, how late or how long silent it is.

    Distance [m] and bearing [rad] are `None` where our own position or that of the aircraft is unknown. For
    LEFT_OUT the name is their number.
    """

    kind: ConcernKind
    name: str
    distance_m: float | None = None
    bearing_rad: float | None = None
    seconds: float = 0.0


class OldReport(NamedTuple):
    """A report that was thrown away because of its age."""

    received_s: float
    age_s: float
    place_deg: LatLon


class Notes(NamedTuple):
    """What is noted while reports are received, so that concerns are looked for only when they are asked for.

    `without_altitude` has the ids of targets, `contested` the keys with several hypotheses, `old` the reports
    that were thrown away because of their age, by the aircraft's name.
    """

    without_altitude: dict[str, None]
    contested: dict[str, None]
    old: dict[str, OldReport]


class ConcernedView:
    """Places as seen from our aircraft, and which of them are near."""

    def __init__(self, params: TrafficParams, trail: OwnTrail) -> None:
        self._params, self._trail = params, trail

    def seen(self, kind: ConcernKind, name: str, place_deg: LatLon | None, seconds: float = 0.0) -> Concern:
        """A concern about an aircraft at a place."""
        own = self._trail.latest
        if own is None or place_deg is None:
            return Concern(kind, name, None, None, seconds)
        north_m, east_m = LocalFrame(own.lat_deg, own.lon_deg).to_north_east_m(*place_deg)
        return Concern(kind, name, math.hypot(north_m, east_m), math.atan2(east_m, north_m), seconds)

    def is_near(self, seen: Concern, reach_s: float = math.inf) -> bool:
        """Whether it is near us, or will be soon."""
        near = seen.distance_m is not None and seen.distance_m <= self._params.near_m
        return near or reach_s <= self._params.near_s

    def contradictions(self, contact: Contact, now_s: float) -> Iterator[Concern]:
        """A key that several aircraft have, or that is reported at several heights."""
        heard = [
            one for one in contact.hypotheses if one.is_confirmed and now_s - one.measured_s <= _RECENT_S
        ]
        if len(heard) < 2:
            return
        one, other = place_of(heard[0], now_s), place_of(heard[1], now_s)
        if one is None or other is None:
            return
        apart_m = math.hypot(*LocalFrame(*one).to_north_east_m(*other))
        heights = apart_m <= _TWO_PLACES_M and _heights_apart_m(heard[0], heard[1]) > _TWO_HEIGHTS_M
        kind = ConcernKind.TWO_HEIGHTS if heights else ConcernKind.TWO_PLACES
        seen = [self.seen(kind, name_of(target), place_of(target, now_s)) for target in heard]
        nearest = min(seen, key=lambda concern: concern.distance_m or 0.0)
        if nearest.distance_m is None or self.is_near(nearest, min(target.reach_s for target in heard)):
            yield nearest


def _heights_apart_m(one: Target, other: Target) -> float:
    """How far two targets are apart in a reference that both report; 0 if there is none."""
    if one.motion is None or other.motion is None:
        return 0.0
    heights_m = {height.reference: height.altitude_m for height in one.motion.altitudes}
    apart_m = [
        abs(height.altitude_m - heights_m[height.reference])
        for height in other.motion.altitudes
        if height.reference in heights_m
    ]
    return max(apart_m, default=0.0)


def nearest_of_each(concerns: list[Concern]) -> tuple[Concern, ...]:
    """The nearest few of each kind, in the order of their kinds."""
    chosen: list[Concern] = []
    for kind in ConcernKind:
        of_kind = [concern for concern in concerns if concern.kind is kind]
        of_kind.sort(key=lambda concern: (concern.distance_m or 0.0, concern.name))
        chosen += of_kind[:_MOST_OF_A_KIND]
    return tuple(chosen)


def name_of(target: Target) -> str:
    """The name that people read: the callsign, otherwise the key."""
    return target.callsign or target.key


def place_of(target: Target, now_s: float) -> LatLon | None:
    """Its extrapolated place."""
    motion = target.motion
    if motion is None:
        return None
    elapsed_s = now_s - motion.position_s
    frame = LocalFrame(motion.lat_deg, motion.lon_deg)
    return frame.to_geo(motion.north_mps * elapsed_s, motion.east_mps * elapsed_s, 0.0)[:2]


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
    """Finds what is of concern, from what the tracker knows and what it noted."""

    def __init__(self, known: Known, notes: Notes, view: ConcernedView) -> None:
        self._known, self._notes, self._view = known, notes, view

    def note_old(self, name: str, report: OldReport) -> None:
        """Note a report that was thrown away because of its age; only the newest are kept."""
        old = self._notes.old
        old.pop(name, None)
        if len(old) >= _MOST_OLD:
            del old[next(iter(old))]
        old[name] = report

    def find(self, threats: set[str], evicted_s: float, evicted: int, now_s: float) -> tuple[Concern, ...]:
        """All concerns, the nearest of each kind; `evicted` targets made room, the last at `evicted_s`."""
        found = [
            *self._heightless(now_s),
            *self._old(now_s),
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

    def _old(self, now_s: float) -> Iterator[Concern]:
        """Aircraft near us whose reports are too old to be used."""
        for name, one in list(self._notes.old.items()):
            if now_s - one.received_s > _RECENT_S:
                del self._notes.old[name]
                continue
            seen = self._view.seen(ConcernKind.OLD_REPORTS, name, one.place_deg, one.age_s)
            if self._view.is_near(seen):
                yield seen

    def _heightless(self, now_s: float) -> Iterator[Concern]:
        for track_id in list(self._notes.without_altitude):
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
        for key in list(self._notes.contested):
            contact = self._known.contacts.get(key)
            if contact is None or len(contact.hypotheses) < 2:
                del self._notes.contested[key]
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
