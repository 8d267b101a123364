"""Reports to tracks: who is out there now, in the local frame."""

import cmath
import math
from collections import Counter
from operator import attrgetter

from companion.geodesy import LocalFrame
from companion.model import Track, TrafficReport, adsb_key, uas_key
from companion.traffic.altitude_datums import AS_REPORTED, Datums, Height, compare
from companion.traffic.association import Association, leader
from companion.traffic.forward_clock import ForwardClock
from companion.traffic.ownship_echo import OwnMotion, OwnshipEcho
from companion.traffic.params import TrafficParams
from companion.traffic.target import Dropped, Target


class Tracker:
    """All traffic that was heard lately, one track for each aircraft however many ways it is heard.

    The same calls give the same tracks, bit for bit. Heights are kept as reported; `datums` says how they
    compare with ours, and is to be renewed by whoever knows.

    `dropped` counts reports that were not used, by reason; `evicted` counts tracks that gave way to newer
    ones for want of room.
    """

    def __init__(self, params: TrafficParams | None = None) -> None:
        self.params = params or TrafficParams()
        self.dropped: Counter[Dropped] = Counter()
        self.evicted = 0
        self.datums: Datums = AS_REPORTED
        self._own_icao = set(self.params.own_icao)
        self._own_uas_key = None if self.params.own_uas_id is None else uas_key(self.params.own_uas_id)
        self._echo = OwnshipEcho(self.params.own_echo)
        self._association = Association(self.params.association)
        self._clock = ForwardClock()
        # Both in the order in which they were last heard, the longest silence first.
        self._targets: dict[str, Target] = {}
        self._unplaced_heard_s: dict[str, float] = {}
        self._ordered: list[Target] = []

    def learn_own(self, icao: int) -> None:
        """This address is our own transponder's: what it reports is not traffic. Zero says nothing."""
        if icao > 0:
            self._own_icao.add(icao)
            self._forget(adsb_key(icao))
            self._unplaced_heard_s.pop(adsb_key(icao), None)

    def note_own(self, own: OwnMotion) -> None:
        """Where we are ourselves: what is always there too is not traffic."""
        self._echo.note_own(OwnMotion(self._clock.at(own.time_s), *own[1:]))

    def receive(self, report: TrafficReport, now_s: float) -> str | None:
        """Take in a report; the id of the track of which it is a new measurement, `None` if it is none."""
        steady_now_s = self._clock.at(now_s)
        refusal = self._refusal(report)
        if refusal is not None:
            self.dropped[refusal] += 1
            return None
        if not report.airborne:
            self.dropped[Dropped.ON_GROUND] += 1
            self._forget(report.key)
            return None
        if report.lat_deg is None or report.lon_deg is None:
            self.dropped[Dropped.NO_POSITION] += 1
            self._note_unplaced(report.key, steady_now_s)
            return None

        target = self._targets.get(report.key)
        if target is None or steady_now_s > target.forget_s:
            self._forget(report.key)
            target = Target(report, self.params, self.dropped)
        time_s = self._clock.of(report.time_s)
        if steady_now_s - time_s > self.params.stale_after_s(report.kind):
            self.dropped[Dropped.STALE] += 1
            return None
        if not target.receive(report, report.lat_deg, report.lon_deg, time_s):
            return None
        self._keep(target)
        return self._identify(target)

    def _identify(self, target: Target) -> str | None:
        """The id of the track that a measured target is, or is part of; `None` when it is ourselves."""
        if self._echo.judge(target, self.datums):
            self.dropped[Dropped.OWN] += 1
            self._association.forget(target.key)
            return None
        self._association.heard(target, self._targets, self.datums)
        return self._association.group_of(target.key)[0]

    def tracks(self, now_s: float, frame: LocalFrame) -> tuple[Track, ...]:
        """Everyone whose place and height are known, flown on to `now_s`, in order of `track_id`."""
        steady_now_s = self._clock.at(now_s)
        self._forget_stale(steady_now_s)
        north_m_per_deg, east_m_per_deg = frame.metres_per_degree
        tracks = []
        for target in self._by_key():
            led_by, heights = self._shown(target, steady_now_s)
            motion = led_by.motion
            height = compare(heights, self.datums, steady_now_s)
            if motion is None or height is None:
                continue
            lat_deg, lon_deg, place_s, north_mps, east_mps, turn_radps, _, _ = motion
            flown_s = steady_now_s - place_s
            dlon_deg = (lon_deg - frame.lon_deg + 180.0) % 360.0 - 180.0  # the short way over the date line
            position_m = (
                (lat_deg - frame.lat_deg) * north_m_per_deg + north_mps * flown_s,
                dlon_deg * east_m_per_deg + east_mps * flown_s,
                -height.altitude_m,
            )
            if turn_radps != 0.0:
                # The place is some metres wrong for that, the course is some degrees.
                turned = cmath.rect(1.0, turn_radps * flown_s) * complex(north_mps, east_mps)
                north_mps, east_mps = turned.real, turned.imag
            velocity_mps = (north_mps, east_mps, -height.climb_mps)
            age_s = steady_now_s - led_by.measured_s
            # By position: with a thousand tracks, keywords cost as much as the arithmetic.
            tracks.append(
                Track(
                    target.key,
                    now_s,
                    position_m,
                    velocity_mps,
                    target.icao,
                    target.callsign,
                    target.kind,
                    age_s,
                    None,
                    None,
                    None,
                    height.uncertainty_m,
                    turn_radps,
                )
            )
        return tuple(tracks)

    def without_position(self, now_s: float) -> int:
        """How many are heard, but cannot be placed for want of a position or a height.

        They are not avoided: without a height, every aircraft passing far overhead would be a conflict.
        """
        steady_now_s = self._clock.at(now_s)
        self._forget_stale(steady_now_s)
        unplaced = sum(key not in self._targets for key in self._unplaced_heard_s)
        return unplaced + sum(
            target.motion is not None
            and self._names_a_track(target)
            and compare(target.motion.heights, self.datums, steady_now_s) is None
            for target in self._targets.values()
        )

    def _names_a_track(self, target: Target) -> bool:
        return target.key not in self._echo.own and self._association.group_of(target.key)[0] == target.key

    def _shown(self, target: Target, steady_now_s: float) -> tuple[Target, tuple[Height, ...]]:
        """Whose place to show for a target, and all heights there are; no heights where nothing is shown."""
        if target.key in self._echo.own:
            return target, ()
        group = self._association.groups.get(target.key)
        if group is None:
            return target, () if target.motion is None else target.motion.heights
        if group[0] != target.key:
            return target, ()
        members = [self._targets[key] for key in group]
        heights = [height for member in members if member.motion for height in member.motion.heights]
        return leader(members, steady_now_s), tuple(heights)

    def _refusal(self, report: TrafficReport) -> Dropped | None:
        if not report.key or (report.icao is not None and report.icao <= 0):
            return Dropped.NO_ADDRESS
        if report.icao in self._own_icao or report.key == self._own_uas_key:
            return Dropped.OWN
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
            return Dropped.BAD_NUMBER
        if abs(report.lat_deg or 0.0) > 90.0 or abs(report.lon_deg or 0.0) > 180.0:
            return Dropped.BAD_NUMBER
        return None

    def _by_key(self) -> list[Target]:
        if not self._ordered:
            self._ordered = sorted(self._targets.values(), key=attrgetter("key"))
        return self._ordered

    def _keep(self, target: Target) -> None:
        if self._targets.pop(target.key, None) is not target:
            self._ordered = []
        if len(self._targets) >= self.params.max_tracks:
            self._forget(next(iter(self._targets)))
            self.evicted += 1
        self._targets[target.key] = target

    def _forget(self, key: str) -> None:
        if self._targets.pop(key, None) is not None:
            self._ordered = []
            self._association.forget(key)
            self._echo.forget(key)

    def _note_unplaced(self, key: str, steady_now_s: float) -> None:
        self._unplaced_heard_s.pop(key, None)
        if len(self._unplaced_heard_s) >= self.params.max_tracks:
            del self._unplaced_heard_s[next(iter(self._unplaced_heard_s))]
        self._unplaced_heard_s[key] = steady_now_s

    def _forget_stale(self, steady_now_s: float) -> None:
        for key in [key for key, target in self._targets.items() if steady_now_s > target.forget_s]:
            self._forget(key)
        oldest_s = steady_now_s - self.params.stale_s
        for key in [k for k, heard_s in self._unplaced_heard_s.items() if heard_s < oldest_s]:
            del self._unplaced_heard_s[key]
