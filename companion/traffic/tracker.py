"""Reports to tracks: who is out there now, in the local frame."""

import math
from collections import Counter
from operator import attrgetter

from companion.geodesy import GeoPoint, LocalFrame
from companion.model import Track, TrafficReport
from companion.traffic.forward_clock import ForwardClock
from companion.traffic.params import TrafficParams
from companion.traffic.target import Dropped, Target


class Tracker:
    """All traffic that was heard lately, one track for each address.

    The same calls give the same tracks, bit for bit. Heights are taken as reported: whoever knows the
    difference between barometric and true height corrects the reports beforehand.

    `dropped` counts reports that were not used, by reason; `evicted` counts tracks that gave way to newer
    ones for want of room.
    """

    def __init__(self, params: TrafficParams | None = None) -> None:
        self.params = params or TrafficParams()
        self.dropped: Counter[Dropped] = Counter()
        self.evicted = 0
        self._own_icao = set(self.params.own_icao)
        self._clock = ForwardClock()
        # Both in the order in which they were last heard, the longest silence first.
        self._targets: dict[int, Target] = {}
        self._unplaced_heard_s: dict[int, float] = {}
        self._ordered: list[Target] = []

    def learn_own(self, icao: int) -> None:
        """This address is our own transponder's: what it reports is not traffic. Zero says nothing."""
        if icao > 0:
            self._own_icao.add(icao)
            self._forget(icao)
            self._unplaced_heard_s.pop(icao, None)

    def receive(self, report: TrafficReport, now_s: float) -> bool:
        """Take in a report; True when it is a new measurement of somebody else."""
        steady_now_s = self._clock.at(now_s)
        refusal = self._refusal(report)
        if refusal is not None:
            self.dropped[refusal] += 1
            return False
        if report.lat_deg is None or report.lon_deg is None:
            self.dropped[Dropped.NO_POSITION] += 1
            self._note_unplaced(report.icao, steady_now_s)
            return False

        target = self._targets.get(report.icao)
        if target is None or steady_now_s > target.forget_s:
            target = Target(report.icao, self.params, self.dropped)
        time_s = self._clock.of(report.time_s)
        if steady_now_s - time_s > self.params.stale_after_s(report.kind):
            self.dropped[Dropped.STALE] += 1
            return False
        if not target.receive(report, report.lat_deg, report.lon_deg, time_s):
            return False
        self._keep(target)
        return True

    def tracks(self, now_s: float, frame: LocalFrame) -> tuple[Track, ...]:
        """Everyone whose place and height are known, flown on to `now_s`, in order of `track_id`."""
        steady_now_s = self._clock.at(now_s)
        self._forget_stale(steady_now_s)
        north_m_per_deg, east_m_per_deg, _ = frame.to_ned_m(
            GeoPoint(frame.lat_deg + 1.0, frame.lon_deg + 1.0, 0.0)  # the frame is linear in degrees
        )
        tracks = []
        for target in self._by_track_id():
            motion = target.motion
            if motion is None or steady_now_s > motion.height_until_s:
                continue
            lat_deg, lon_deg, place_s, north_mps, east_mps, altitude_m, height_s, climb_mps, _ = motion
            flown_s = steady_now_s - place_s
            dlon_deg = (lon_deg - frame.lon_deg + 180.0) % 360.0 - 180.0  # the short way over the date line
            position_m = (
                (lat_deg - frame.lat_deg) * north_m_per_deg + north_mps * flown_s,
                dlon_deg * east_m_per_deg + east_mps * flown_s,
                -altitude_m - climb_mps * (steady_now_s - height_s),
            )
            velocity_mps = (north_mps, east_mps, -climb_mps)
            age_s = steady_now_s - target.measured_s
            # By position: with a thousand tracks, keywords cost as much as the arithmetic.
            tracks.append(
                Track(
                    target.track_id,
                    now_s,
                    position_m,
                    velocity_mps,
                    target.icao,
                    target.callsign,
                    target.kind,
                    age_s,
                )
            )
        return tuple(tracks)

    def without_position(self, now_s: float) -> int:
        """How many are heard, but cannot be placed for want of a position or a height.

        They are not avoided: without a height, every aircraft passing far overhead would be a conflict.
        """
        steady_now_s = self._clock.at(now_s)
        self._forget_stale(steady_now_s)
        unplaced = sum(icao not in self._targets for icao in self._unplaced_heard_s)
        motions = (target.motion for target in self._targets.values())
        return unplaced + sum(m is None or steady_now_s > m.height_until_s for m in motions)

    def _refusal(self, report: TrafficReport) -> Dropped | None:
        if report.icao <= 0:
            return Dropped.NO_ADDRESS
        if report.icao in self._own_icao:
            return Dropped.OWN
        numbers = (
            report.time_s,
            report.lat_deg,
            report.lon_deg,
            report.altitude_m,
            report.course_rad,
            report.ground_speed_mps,
            report.climb_mps,
        )
        if not all(number is None or math.isfinite(number) for number in numbers):
            return Dropped.BAD_NUMBER
        if abs(report.lat_deg or 0.0) > 90.0 or abs(report.lon_deg or 0.0) > 180.0:
            return Dropped.BAD_NUMBER
        return None

    def _by_track_id(self) -> list[Target]:
        if not self._ordered:
            self._ordered = sorted(self._targets.values(), key=attrgetter("track_id"))
        return self._ordered

    def _keep(self, target: Target) -> None:
        if self._targets.pop(target.icao, None) is not target:
            self._ordered = []
        if len(self._targets) >= self.params.max_tracks:
            self._forget(next(iter(self._targets)))
            self.evicted += 1
        self._targets[target.icao] = target

    def _forget(self, icao: int) -> None:
        self._targets.pop(icao, None)
        self._ordered = []

    def _note_unplaced(self, icao: int, steady_now_s: float) -> None:
        self._unplaced_heard_s.pop(icao, None)
        if len(self._unplaced_heard_s) >= self.params.max_tracks:
            del self._unplaced_heard_s[next(iter(self._unplaced_heard_s))]
        self._unplaced_heard_s[icao] = steady_now_s

    def _forget_stale(self, steady_now_s: float) -> None:
        for icao in [icao for icao, t in self._targets.items() if steady_now_s > t.forget_s]:
            self._forget(icao)
        oldest_s = steady_now_s - self.params.stale_s
        for icao in [i for i, heard_s in self._unplaced_heard_s.items() if heard_s < oldest_s]:
            del self._unplaced_heard_s[icao]
