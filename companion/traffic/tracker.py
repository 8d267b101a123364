"""The tracker: reports in, tracks out. Each report updates a target, and each target is judged again."""

import math
from collections import Counter
from collections.abc import Callable
from typing import Final

from companion.geodesy import LocalFrame
from companion.mavlink.facts import Sender
from companion.model import AltitudeReference, LatLon, Track, TrafficKind, TrafficReport
from companion.traffic.altitudes import AS_REPORTED, DatumOffsets, SeaLevelAltitude, to_sea_level
from companion.traffic.anonymous import AnonymousContacts
from companion.traffic.concerns import Concern, ConcernedView, ConcernFinder, Known, Notes, OldReport
from companion.traffic.contact import Assignment, Contact
from companion.traffic.evidence import UNKNOWN, Surroundings
from companion.traffic.measurement import (
    DropReason,
    Measurement,
    RepeatFilter,
    content_of,
    is_possible,
    measure,
)
from companion.traffic.own_aircraft import Identity, OwnIdentity, OwnshipFix, OwnTrail
from companion.traffic.ownship_echo import OwnshipEcho
from companion.traffic.params import TrafficParams
from companion.traffic.store import Association, TargetStore
from companion.traffic.target import Target, stale_after_s
from companion.traffic.tracks import Coasting, FarTracks, TrackMaker
from companion.traffic.triage import Triage, Urgency

# Smaller steps back of a clock are jitter between callers; a larger step means that the clock was set.
_CLOCK_JITTER_S = 1.0


class MonotonicClock:
    """Time that stands still during jitter of the caller's clock and continues after a step back of it.

    Without it, ages would be negative after a step back, until the caller's clock has caught up.
    """

    def __init__(self) -> None:
        self._offset_s = 0.0
        self._latest_s: float | None = None

    def advance(self, now_s: float) -> float:
        """The monotonic time of the caller's present time."""
        monotonic_s = now_s + self._offset_s
        if self._latest_s is not None and monotonic_s < self._latest_s:
            if self._latest_s - monotonic_s > _CLOCK_JITTER_S:
                self._offset_s = self._latest_s - now_s
            return self._latest_s
        self._latest_s = monotonic_s
        return monotonic_s

    def convert(self, time_s: float) -> float:
        """The monotonic time of a time stamp of the caller's clock, at most the latest present time."""
        monotonic_s = time_s + self._offset_s
        return monotonic_s if self._latest_s is None else min(monotonic_s, self._latest_s)


Mark = Callable[[tuple[Track, ...], LocalFrame, float], tuple[Track, ...]]

# Our own positions are kept for the last reports of a slow shadow and its delay.
_TRAIL_S = 60.0
# A smaller change of the uncertainty of altitudes does not change what stands on the ground.
_JUDGED_AGAIN_M: Final = 5.0
# Keys that are remembered though all their reports were too old: their ages may turn out to be wrong.
_MOST_IDLE = 256


class Tracker:
    """All traffic received recently, one track for each aircraft however many sources report it.

    The same calls give the same tracks, bit for bit. Altitudes are stored as reported; `offsets_at` returns
    what makes them comparable with ours. `mark` completes the tracks of those that are known otherwise.

    `dropped` counts reports, and parts of them, that were not used, by reason; `evicted` counts targets that
    were dropped because there were too many.
    """

    def __init__(
        self,
        params: TrafficParams | None = None,
        offsets_at: Callable[[float], DatumOffsets] = lambda _now_s: AS_REPORTED,
        mark: Mark | None = None,
    ) -> None:
        self.params = params = params or TrafficParams()
        self.offsets_at = offsets_at
        self._mark = mark
        self.dropped: Counter[DropReason] = Counter()
        self.evicted = 0
        self.surroundings: Surroundings = UNKNOWN
        self._clock = MonotonicClock()
        self._trail = OwnTrail(_TRAIL_S)
        self.own_identity = OwnIdentity(params, self._trail)
        self._echo = OwnshipEcho(params.own_echo, self._trail)
        self._association = Association(params.association)
        self._store = TargetStore(params.max_tracks)
        self._contacts: dict[str, Contact] = {}
        self._idle: dict[str, None] = {}  # the keys of contacts that never had a target, the oldest first
        self._anonymous = AnonymousContacts(params, self._store.grid)
        self._coasting = Coasting(params, self._trail)
        self._far = FarTracks()
        self._triage = Triage(self._contacts, self._trail)
        self._notes = Notes({}, {}, {})
        self._concerns = ConcernFinder(
            Known(
                self._store,
                self._contacts,
                self._echo,
                self.own_identity,
                self._coasting,
                self._identifies_track,
            ),
            self._notes,
            ConcernedView(params, self._trail),
        )
        self._evicted_s = -math.inf
        self._threats: set[str] = set()
        self._offsets = AS_REPORTED
        self._unjudged_m = 0.0  # change of the altitudes' uncertainty since all targets were judged

    # --- our own aircraft

    def add_own_address(self, icao: int) -> None:
        """Take an address as that of our own transponder, unless it flies elsewhere. Zero means unknown."""
        key = self.own_identity.claim(icao)
        if key is None:
            return
        for target in () if key not in self._contacts else self._contacts[key].hypotheses:
            self._identify(target)

    @property
    def own_icao(self) -> int | None:
        """The address by which others hear us, `None` while it is unknown or one of several."""
        return self.own_identity.icao

    def observe_ownship(self, fix: OwnshipFix) -> None:
        """Store our own position; what was received before is compared with it when it is known again."""
        began = self._trail.observe(OwnshipFix(self._clock.advance(fix.time_s), *fix[1:]))
        self.surroundings = self.surroundings._replace(own_altitude_m=fix.altitude_m)
        if began:
            for target in list(self._store.grid.near(fix.lat_deg, fix.lon_deg)):
                self._identify(target)

    def own_distance_m(self, time_s: float, place_deg: LatLon) -> float | None:
        """How far a place is from where we were at a time; `None` if that is unknown."""
        if not math.isfinite(time_s) or not all(map(math.isfinite, place_deg)):
            return None
        own = self._trail.at(self._clock.convert(time_s))
        if own is None:
            return None
        return math.hypot(*LocalFrame(own.lat_deg, own.lon_deg).to_north_east_m(*place_deg))

    def note_threats(self, track_ids: list[str], now_s: float) -> None:
        """Note which tracks are in conflict with us: they are kept, and coasted when they fall silent."""
        monotonic_s = self._clock.advance(now_s)
        self._coasting.note_threats(track_ids, self._store.targets, monotonic_s)
        threats = {key for track_id in track_ids for key in self._association.group_of(track_id)}
        for key in self._threats - threats:
            if key in self._store.targets:
                self._store.targets[key].threat = False
        for key in threats:
            if key in self._store.targets:
                self._store.targets[key].threat = True
        self._threats = threats

    # --- reports

    def urgency(self, report: TrafficReport, now_s: float) -> Urgency:
        """How soon a report is to be processed, while there are more than can be."""
        return self._triage.urgency(report, self._clock.advance(now_s), self.offsets_at(now_s))

    def receive(self, report: TrafficReport, now_s: float, sent_by: Sender | None = None) -> str | None:
        """Process a report; returns the id of the track that it updates, `None` if there is none.

        Several that send the same kind of report differ in `sent_by`, each with a delay of its own.
        """
        monotonic_s = self._clock.advance(now_s)
        self._offsets = self.offsets_at(now_s)
        sender = "" if sent_by is None or report.heard_by else "{}/{}".format(*sent_by)
        if not is_possible(report):
            self.dropped[DropReason.BAD_NUMBER] += 1
            return None
        time_s = self._clock.convert(report.time_s)
        place_deg, report = self._place_of(report, time_s)
        if place_deg is None:
            own = self.own_identity.is_claimed(report)
            if not own:
                self._note_name(report)
            self.dropped[DropReason.OWN if own else DropReason.NO_POSITION] += 1
            return None
        if not report.key or (report.icao is not None and report.icao <= 0):
            assignment = self._assign_anonymous(report, place_deg, time_s, monotonic_s, sender)
        else:
            assignment = self._assign(report, place_deg, time_s, monotonic_s, sender)
        for reason in assignment.dropped:
            self.dropped[reason] += 1
        for removed in assignment.removed:
            self._forget(removed)
        target = assignment.target
        if target is None or not self._keep(target, monotonic_s):
            return None
        return self._identify(target, new=True)

    def _place_of(self, report: TrafficReport, time_s: float) -> tuple[LatLon | None, TrafficReport]:
        """Where it is, also of a report relative to us, which gets an altitude relative to ours."""
        if report.lat_deg is not None and report.lon_deg is not None:
            return (report.lat_deg, report.lon_deg), report
        own = None if report.relative_m is None else self._trail.at(time_s)
        if own is None or report.relative_m is None:
            return None, report
        return self._trail.placed(report, own)

    def _assign_anonymous(
        self, report: TrafficReport, place_deg: LatLon, time_s: float, monotonic_s: float, sender: str
    ) -> Assignment:
        if self._is_repeat(self._anonymous.repeats, report, monotonic_s, moves=False):
            return Assignment(None, [DropReason.REPEATED], [])
        if monotonic_s - time_s > stale_after_s(report.kind, self.params):
            return self._too_old("anonymous", place_deg, time_s, monotonic_s)
        measurement = measure(report, time_s, monotonic_s, *place_deg, self.params, sender)
        return self._anonymous.assign(measurement, self._reach_s)

    def _assign(
        self, report: TrafficReport, place_deg: LatLon, stated_s: float, monotonic_s: float, sender: str
    ) -> Assignment:
        contact = self._contacts.get(report.key)
        if contact is None:
            contact = self._new_contact(report.key)
        contact.heard_s = monotonic_s
        for target in contact.hypotheses:
            if monotonic_s > target.expires_s:
                self._expire(target, monotonic_s)
                self._contacts.setdefault(contact.key, contact)
        observer = contact.observers.named((report.heard_by or report.source.value, sender))
        hypotheses = contact.hypotheses
        moves = bool(hypotheses) and hypotheses[0].evidence.moves
        if self._is_repeat(contact.repeats, report, monotonic_s, moves=moves):
            if hypotheses and (report.ground_speed_mps or 0.0) <= self.params.hovering_mps:
                self._note_standing(hypotheses[0], monotonic_s)
            return Assignment(None, [DropReason.REPEATED], [])
        time_s = observer.time_of(stated_s, monotonic_s)
        if monotonic_s - time_s > stale_after_s(report.kind, self.params):
            return self._too_old(report.callsign or report.key, place_deg, time_s, monotonic_s)
        if self._notes.old:
            self._notes.old.pop(report.callsign or report.key, None)
        measurement = measure(report, time_s, monotonic_s, *place_deg, self.params, sender)
        if self._idle:
            self._idle.pop(contact.key, None)
        assignment = contact.assign(measurement, observer, self._reach_s)
        if len(contact.hypotheses) > 1:
            self._notes.contested[contact.key] = None
        return assignment

    def _is_repeat(
        self, repeats: RepeatFilter, report: TrafficReport, monotonic_s: float, *, moves: bool
    ) -> bool:
        speed_mps = report.ground_speed_mps
        may_stand_still = report.kind is TrafficKind.OBSTACLE or (
            not moves if speed_mps is None else speed_mps <= self.params.hovering_mps
        )
        return repeats.is_repeat(content_of(report), monotonic_s, may_stand_still=may_stand_still)

    def _note_standing(self, target: Target, monotonic_s: float) -> None:
        """A repetition shows that a parked aircraft stands still."""
        target.evidence.observe_again()
        target.judge_kind(monotonic_s, self._altitude_of(target), self.surroundings)

    def _too_old(self, name: str, place_deg: LatLon, time_s: float, monotonic_s: float) -> Assignment:
        self._concerns.note_old(name, OldReport(monotonic_s, monotonic_s - time_s, place_deg))
        return Assignment(None, [DropReason.STALE], [])

    def _new_contact(self, key: str) -> Contact:
        """A contact without a target; of those only the newest are remembered."""
        self._idle[key] = None
        if len(self._idle) > _MOST_IDLE:
            idle = next(iter(self._idle))
            del self._idle[idle], self._contacts[idle]
        contact = self._contacts[key] = Contact(key, self.params)
        return contact

    def _reach_s(self, measurement: Measurement) -> float:
        """How soon a report's aircraft could be near us."""
        altitude_m = None
        if measurement.altitudes:
            reference, altitude_m, _ = measurement.altitudes[0]
            altitude_m += self._offsets[reference].offset_m
        place_deg = measurement.lat_deg, measurement.lon_deg
        return self._trail.reach_s(measurement.time_s, place_deg, measurement.velocity_mps, altitude_m)

    def _keep(self, target: Target, monotonic_s: float) -> bool:
        """Store a target, if there is room for it; it may be another that makes room."""
        if self._store.is_full and target.track_id not in self._store.targets:
            target.reach_s = self._reach_s(target.last)
        for other in self._store.put(target):
            self.evicted += 1
            self._evicted_s = monotonic_s
            self._end(other)
            if other is target:
                self.dropped[DropReason.FULL] += 1
                return False
        return True

    def _altitude_of(self, target: Target) -> SeaLevelAltitude | None:
        motion = target.motion
        return None if motion is None else to_sea_level(motion.altitudes, self._offsets, motion.position_s)

    def _identify(self, target: Target, *, new: bool = False) -> str | None:
        """Decide what a target is; returns the id of its track, `None` if it has none."""
        altitude = self._altitude_of(target)
        target.judge_kind(target.last.received_s, altitude, self.surroundings)
        if target.motion is not None:
            place_deg = target.motion.lat_deg, target.motion.lon_deg
            height_m = None if altitude is None else altitude.altitude_m
            velocity_mps = target.motion.north_mps, target.motion.east_mps
            target.reach_s = self._trail.reach_s(target.measured_s, place_deg, velocity_mps, height_m)
        if altitude is None:
            self._notes.without_altitude[target.track_id] = None
        else:
            self._notes.without_altitude.pop(target.track_id, None)
        if not target.evidence.stated_airborne and target.evidence.on_ground:
            self.dropped[DropReason.ON_GROUND] += new
            self._association.remove(target.track_id)
            return None
        if self._is_echo(target, altitude):
            self.dropped[DropReason.OWN] += new
            self._association.remove(target.track_id)
            return None
        self._association.update(target, self._store, self._offsets)
        track_id = self._association.group_of(target.track_id)[0]
        return track_id if target.shown else None

    def _is_echo(self, target: Target, altitude: SeaLevelAltitude | None) -> bool:
        """Whether it is ourselves; one that is far away, and never was near us, needs no closer look."""
        identity, key, echo = self.own_identity.identify(target, altitude), target.track_id, self._echo
        known = key in echo.keys or key in echo.evidence or key in echo.shadows.evidence
        if known or identity is Identity.OURS or target.kind is TrafficKind.OBSTACLE:
            return echo.classify(target, altitude, identity)
        if not self.own_identity.is_far(target):
            return echo.classify(target, altitude, identity)
        target.seen_far |= identity is not Identity.ANOTHERS
        return False

    # --- tracks

    def tracks(self, now_s: float, frame: LocalFrame) -> tuple[Track, ...]:
        """All tracks with a known position and altitude, ordered by `track_id`.

        They are extrapolated to `now_s`; of many, those far away to a time up to a second before.
        """
        monotonic_s = self._clock.advance(now_s)
        self._use_offsets(self.offsets_at(now_s))
        self._remove_expired(monotonic_s)
        maker = TrackMaker(now_s, monotonic_s, frame, self._offsets)
        self._far.begin(frame, len(self._store.targets), now_s - monotonic_s)
        tracks = []
        for target in self._store:
            if target.track_id in self._echo.keys or not target.shown:
                continue
            if target.evidence.on_ground and not target.evidence.stated_airborne:
                continue
            group = self._association.groups.get(target.track_id)
            if group is None:
                track = self._far.known(target, monotonic_s)
                if track is None:
                    contact = self._contacts.get(target.key)
                    track = maker.track(target, None if contact is None else contact.observers)
                    self._far.keep(target, track, monotonic_s)
            elif group[0] == target.track_id:
                members = [self._store.targets[key] for key in group if key in self._store.targets]
                track = maker.track_of_group(target, members)
            else:
                continue
            if track is not None:
                tracks.append(track)
        found = tuple(tracks)
        return found if self._mark is None else self._mark(found, frame, now_s)

    def _use_offsets(self, offsets: DatumOffsets) -> None:
        """Judge all targets again when it becomes known how altitudes compare with ours, or unknown."""
        before, self._offsets = self._offsets, offsets
        self._unjudged_m += max(
            abs(offsets[each].uncertainty_m - before[each].uncertainty_m) for each in AltitudeReference
        )
        if self._unjudged_m > _JUDGED_AGAIN_M:
            self._unjudged_m = 0.0
            for target in list(self._store):
                self._identify(target)

    def _identifies_track(self, target: Target) -> bool:
        if target.track_id in self._echo.keys or target.evidence.on_ground or not target.shown:
            return False
        return self._association.group_of(target.track_id)[0] == target.track_id

    def unheard(self, now_s: float) -> tuple[str, float] | None:
        """Name and silence [s] of the last threat, if it is not heard any more."""
        return self._coasting.unheard(self._store.targets, self._clock.advance(now_s))

    def concerns(self, now_s: float) -> tuple[Concern, ...]:
        """What the operator should know of traffic, the nearest of each kind."""
        return self._concerns.find(self._threats, self._evicted_s, self.evicted, self._clock.advance(now_s))

    # --- forgetting

    def _note_name(self, report: TrafficReport) -> None:
        """A name may come in a report of its own, without a position."""
        contact = self._contacts.get(report.key)
        for target in () if contact is None else contact.hypotheses:
            target.callsign = report.callsign or target.callsign

    def _remove_expired(self, monotonic_s: float) -> None:
        for target in [target for target in self._store if monotonic_s > target.expires_s]:
            self._expire(target, monotonic_s)

    def _expire(self, target: Target, monotonic_s: float) -> None:
        """Drop a target that is not heard any more, unless it is coasted."""
        altitude = None
        if target.motion is not None:
            altitude = to_sea_level(target.motion.altitudes, self._offsets, monotonic_s, coast=True)
        is_echo = target.track_id in self._echo.keys
        if not is_echo and self._coasting.keeps(target, altitude, monotonic_s):
            return
        self._coasting.note_lost(target, monotonic_s)
        self._end(target)

    def _end(self, target: Target) -> None:
        """Remove a target, and its contact if it was the only one."""
        self._forget(target)
        contact = self._contacts.get(target.key)
        if contact is None:
            return
        contact.hypotheses = [one for one in contact.hypotheses if one is not target]
        if not contact.hypotheses:
            del self._contacts[target.key]

    def _forget(self, target: Target) -> None:
        """Remove a target from everything but its contact."""
        if self._store.remove(target):
            self._association.remove(target.track_id)
            self._echo.remove(target.track_id)
            target.seen_far = False
            self._far.remove(target.track_id)
            self._notes.without_altitude.pop(target.track_id, None)
