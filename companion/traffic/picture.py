"""The picture of the traffic around us: facts from every source in, tracks in the local frame out."""

import cmath
import math
from collections import Counter
from operator import attrgetter

from companion.geodesy import LocalFrame
from companion.mavlink.facts import (
    OWN_ICAO_PARAMETER,
    Fact,
    GeoidSeparation,
    OwnPosition,
    OwnTransponder,
    Parameter,
    PressureAltitude,
    ReceiverOwnship,
    Traffic,
)
from companion.model import Track, TrafficReport, Vec2, adsb_key, uas_key
from companion.traffic.altitude_datums import (
    AS_REPORTED,
    DatumOffsets,
    OwnshipAltitudes,
    ReportedAltitude,
    to_sea_level,
)
from companion.traffic.association import Association, leading_target
from companion.traffic.mavlink_traffic import MavlinkTraffic
from companion.traffic.ownship_echo import OwnshipEcho, OwnshipFix
from companion.traffic.params import TrafficParams
from companion.traffic.target import DropReason, Motion, Target, stale_after_s

# Smaller steps back of a clock are jitter between callers; a larger step means that the clock was set.
_CLOCK_JITTER_S = 1.0


class _MonotonicClock:
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


class Tracker:
    """All traffic received recently, one track for each aircraft however many sources report it.

    The same calls give the same tracks, bit for bit. Altitudes are stored as reported; `offsets` make them
    comparable with ours.

    `dropped` counts reports that were not used, by reason; `evicted` counts targets that were dropped because
    there were too many.
    """

    def __init__(self, params: TrafficParams | None = None) -> None:
        self.params = params or TrafficParams()
        self.dropped: Counter[DropReason] = Counter()
        self.evicted = 0
        self._own_icao = set(self.params.own_icao)
        self._own_uas_key = None if self.params.own_uas_id is None else uas_key(self.params.own_uas_id)
        self._echo = OwnshipEcho(self.params.own_echo)
        self._association = Association(self.params.association)
        self._clock = _MonotonicClock()
        # Both in the order of their last report, the longest silence first.
        self._targets: dict[str, Target] = {}
        self._unplaced_received_s: dict[str, float] = {}
        self._ordered: list[Target] = []

    def add_own_address(self, icao: int) -> None:
        """Exclude the address of our own transponder from traffic. Zero means an unknown address."""
        if icao > 0:
            self._own_icao.add(icao)
            self._remove(adsb_key(icao))
            self._unplaced_received_s.pop(adsb_key(icao), None)

    def observe_ownship(self, fix: OwnshipFix) -> None:
        """Store our own position, so that echoes of it are recognized."""
        self._echo.observe_ownship(OwnshipFix(self._clock.advance(fix.time_s), *fix[1:]))

    def receive(self, report: TrafficReport, now_s: float, offsets: DatumOffsets = AS_REPORTED) -> str | None:
        """Process a report; returns the id of the track that it updates, `None` if there is none."""
        monotonic_s = self._clock.advance(now_s)
        refusal = self._refusal(report)
        if refusal is not None:
            self.dropped[refusal] += 1
            return None
        if not report.airborne:
            self.dropped[DropReason.ON_GROUND] += 1
            self._remove(report.key)
            return None
        if report.lat_deg is None or report.lon_deg is None:
            self.dropped[DropReason.NO_POSITION] += 1
            self._note_unplaced(report.key, monotonic_s)
            return None

        target = self._targets.get(report.key)
        if target is None or monotonic_s > target.expires_s:
            self._remove(report.key)
            target = Target(report, self.params, self.dropped)
        time_s = self._clock.convert(report.time_s)
        if monotonic_s - time_s > stale_after_s(report.kind, self.params):
            self.dropped[DropReason.STALE] += 1
            return None
        if not target.receive(report, report.lat_deg, report.lon_deg, time_s):
            return None
        self._store(target)
        return self._identify(target, offsets)

    def _identify(self, target: Target, offsets: DatumOffsets) -> str | None:
        """The id of the track that a measured target belongs to; `None` for an echo of our own aircraft."""
        if self._echo.classify(target, offsets):
            self.dropped[DropReason.OWN] += 1
            self._association.remove(target.key)
            return None
        self._association.update(target, self._targets, offsets)
        return self._association.group_of(target.key)[0]

    def tracks(
        self, now_s: float, frame: LocalFrame, offsets: DatumOffsets = AS_REPORTED
    ) -> tuple[Track, ...]:
        """All tracks with a known position and altitude, extrapolated to `now_s`, ordered by `track_id`."""
        monotonic_s = self._clock.advance(now_s)
        self._remove_expired(monotonic_s)
        tracks, scale = [], frame.metres_per_degree
        for target in self._by_key():
            leading, altitudes = self._sources_of(target, monotonic_s)
            motion = leading.motion
            altitude = to_sea_level(altitudes, offsets, monotonic_s)
            if motion is None or altitude is None:
                continue
            north_m, east_m, north_mps, east_mps = _extrapolate(motion, monotonic_s, frame, scale)
            # By position: with a thousand tracks, keywords cost as much as the arithmetic.
            tracks.append(
                Track(
                    target.key,
                    now_s,
                    (north_m, east_m, -altitude.altitude_m),
                    (north_mps, east_mps, -altitude.climb_mps),
                    target.icao,
                    target.callsign,
                    target.kind,
                    monotonic_s - leading.measured_s,
                    None,
                    None,
                    None,
                    altitude.uncertainty_m,
                    motion.turn_radps,
                )
            )
        return tuple(tracks)

    def without_position(self, now_s: float) -> int:
        """The number of aircraft received without a position or an altitude.

        They are not avoided: without an altitude, every aircraft far above us would be a conflict.
        """
        monotonic_s = self._clock.advance(now_s)
        self._remove_expired(monotonic_s)
        unplaced = sum(key not in self._targets for key in self._unplaced_received_s)
        return unplaced + sum(
            target.motion is not None
            and self._identifies_track(target)
            and to_sea_level(target.motion.altitudes, AS_REPORTED, monotonic_s) is None
            for target in self._targets.values()
        )

    def _identifies_track(self, target: Target) -> bool:
        return target.key not in self._echo.keys and self._association.group_of(target.key)[0] == target.key

    def _sources_of(self, target: Target, monotonic_s: float) -> tuple[Target, tuple[ReportedAltitude, ...]]:
        """The target that gives the position of this one's track, and the altitudes to choose from.

        There are none if this target identifies no track: an echo, or not the first of its group.
        """
        if target.key in self._echo.keys:
            return target, ()
        group = self._association.groups.get(target.key)
        if group is None:
            return target, () if target.motion is None else target.motion.altitudes
        if group[0] != target.key:
            return target, ()
        members = [self._targets[key] for key in group]
        altitudes = [altitude for member in members if member.motion for altitude in member.motion.altitudes]
        return leading_target(members, monotonic_s), tuple(altitudes)

    def _refusal(self, report: TrafficReport) -> DropReason | None:
        """Why a report cannot be used, regardless of earlier reports; `None` if it can."""
        if not report.key or (report.icao is not None and report.icao <= 0):
            return DropReason.NO_ADDRESS
        if report.icao in self._own_icao or report.key == self._own_uas_key:
            return DropReason.OWN
        numbers = (
            report.time_s,
            report.lat_deg,
            report.lon_deg,
            report.altitude_m,
            report.course_rad,
            report.ground_speed_mps,
            report.climb_mps,
            report.position_sigma_m,
            report.altitude_sigma_m,
        )
        if not all(number is None or math.isfinite(number) for number in numbers):
            return DropReason.BAD_NUMBER
        if abs(report.lat_deg or 0.0) > 90.0 or abs(report.lon_deg or 0.0) > 180.0:
            return DropReason.BAD_NUMBER
        return None

    def _by_key(self) -> list[Target]:
        if not self._ordered:
            self._ordered = sorted(self._targets.values(), key=attrgetter("key"))
        return self._ordered

    def _store(self, target: Target) -> None:
        """Make a target the last in the order of reports; drop the first if there are too many."""
        if self._targets.pop(target.key, None) is not target:
            self._ordered = []
        if len(self._targets) >= self.params.max_tracks:
            self._remove(next(iter(self._targets)))
            self.evicted += 1
        self._targets[target.key] = target

    def _remove(self, key: str) -> None:
        if self._targets.pop(key, None) is not None:
            self._ordered = []
            self._association.remove(key)
            self._echo.remove(key)

    def _note_unplaced(self, key: str, monotonic_s: float) -> None:
        self._unplaced_received_s.pop(key, None)
        if len(self._unplaced_received_s) >= self.params.max_tracks:
            del self._unplaced_received_s[next(iter(self._unplaced_received_s))]
        self._unplaced_received_s[key] = monotonic_s

    def _remove_expired(self, monotonic_s: float) -> None:
        for key in [key for key, target in self._targets.items() if monotonic_s > target.expires_s]:
            self._remove(key)
        oldest_s = monotonic_s - self.params.stale_s
        for key in [key for key, received_s in self._unplaced_received_s.items() if received_s < oldest_s]:
            del self._unplaced_received_s[key]


def _extrapolate(
    motion: Motion, monotonic_s: float, frame: LocalFrame, metres_per_degree: Vec2
) -> tuple[float, float, float, float]:
    """Position [m] and velocity [m/s] at the given time: north, east, north, east.

    The turn is applied to the velocity only: it changes the position by metres, but the course by degrees.
    """
    lat_deg, lon_deg, position_s, north_mps, east_mps, turn_radps, _, _ = motion
    elapsed_s = monotonic_s - position_s
    # Inlined from `LocalFrame.to_north_east_m`: calls cost too much for a thousand tracks.
    dlon_deg = (lon_deg - frame.lon_deg + 180.0) % 360.0 - 180.0
    north_m = (lat_deg - frame.lat_deg) * metres_per_degree[0] + north_mps * elapsed_s
    east_m = dlon_deg * metres_per_degree[1] + east_mps * elapsed_s
    if turn_radps != 0.0:
        turned = cmath.rect(1.0, turn_radps * elapsed_s) * complex(north_mps, east_mps)
        north_mps, east_mps = turned.real, turned.imag
    return north_m, east_m, north_mps, east_mps


class TrafficPicture:
    """Turns facts into tracks. Times are those of the engine's clock."""

    def __init__(self, params: TrafficParams) -> None:
        self.tracker = Tracker(params)
        self._own_altitudes = OwnshipAltitudes(params.heights)
        self._mavlink_traffic = MavlinkTraffic()

    def observe_ownship(self, fact: Fact, now_s: float) -> None:
        """Process a fact of our own autopilot: position, altitude references and transponder address."""
        match fact:
            case OwnPosition():
                self._observe_position(fact, now_s)
            case PressureAltitude():
                self._own_altitudes.observe_pressure_altitude(fact.altitude_m, now_s)
            case GeoidSeparation():
                self._own_altitudes.observe_geoid_separation(fact.separation_m)
            case Parameter() if fact.name == OWN_ICAO_PARAMETER and fact.value >= 1.0:
                self.tracker.add_own_address(int(fact.value))
            case OwnTransponder():
                self.tracker.add_own_address(fact.icao)
            case _:
                pass

    def observe_receiver(self, fact: ReceiverOwnship, now_s: float) -> None:
        """Process what a receiver reports of the aircraft that carries it."""

    def receive(self, fact: Fact, now_s: float) -> str | None:
        """Process a traffic report, or a fact of another MAVLink system.

        Returns the id of the track that it updates, `None` if there is none.
        """
        report = fact.report if isinstance(fact, Traffic) else self._mavlink_traffic.observe(fact, now_s)
        if report is None:
            return None
        return self.tracker.receive(report, now_s, self._own_altitudes.offsets(now_s))

    def tracks(self, now_s: float, frame: LocalFrame) -> tuple[Track, ...]:
        """All tracks in the local frame, extrapolated to `now_s`, ordered by `track_id`."""
        return self.tracker.tracks(now_s, frame, self._own_altitudes.offsets(now_s))

    def _observe_position(self, fact: OwnPosition, now_s: float) -> None:
        self._own_altitudes.observe_altitude(fact.altitude_m)
        north_mps, east_mps, down_mps = fact.velocity_mps
        self.tracker.observe_ownship(
            OwnshipFix(now_s, fact.lat_deg, fact.lon_deg, fact.altitude_m, north_mps, east_mps, -down_mps)
        )
