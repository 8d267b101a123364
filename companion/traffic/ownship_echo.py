"""Our own aircraft, reported back to us as traffic by somebody who does not know that it is we.

An echo was where we were, as fast as we were, a moment ago. Nothing else stays there for long. What is heard
there from the first moment on is an echo at once, or every echo would begin as a conflict at no distance.
"""

import math
from collections import deque
from typing import NamedTuple

from companion.geodesy import LocalFrame
from companion.model import TrafficKind
from companion.traffic.altitude_datums import Datums, compare
from companion.traffic.gates import EchoParams
from companion.traffic.target import Target

_SPACING_S = 0.2
# Whoever is further north or south of us than this (2 km) is not looked at more closely.
_NEAR_DEG = 0.02
# Own position comes in between two moments of the trail.
_AHEAD_S = 0.5
# It comes several times a second, once where the link is slow.
_SILENT_S = 1.0


class OwnMotion(NamedTuple):
    """Where we were at `time_s`, height above mean sea level; velocity north, east and up."""

    time_s: float
    lat_deg: float
    lon_deg: float
    altitude_m: float
    north_mps: float
    east_mps: float
    climb_mps: float


class _Verdict:
    """How many reports in a row, and since when, speak against what is held of one key."""

    __slots__ = ("reports", "since_s")

    def __init__(self) -> None:
        self.reports = 0
        self.since_s = math.inf


class OwnshipEcho:
    """Where we were of late, and who has been there with us; `own` are the keys found to be ourselves."""

    def __init__(self, params: EchoParams) -> None:
        self._params = params
        self._trail: deque[OwnMotion] = deque()
        self._verdicts: dict[str, _Verdict] = {}
        self.own: set[str] = set()

    def note_own(self, own: OwnMotion) -> None:
        """Our own position; earlier ones are kept as long as an echo may take."""
        if self._trail and own.time_s - self._trail[-1].time_s < _SPACING_S - 1e-3:
            return
        self._trail.append(own)
        while own.time_s - self._trail[0].time_s > self._params.delay_s + 1.0:
            self._trail.popleft()

    def judge(self, target: Target, datums: Datums) -> bool:
        """A new measurement of `target`: is it an echo? What stands on the ground is none."""
        if target.kind is TrafficKind.OBSTACLE:
            self.forget(target.key)
            return False
        key, apart = target.key, self._gap(target, datums)
        if apart is None:
            return key in self.own
        verdict = self._verdicts.get(key)
        if verdict is None:
            verdict = self._verdicts[key] = _Verdict()
            found = apart <= 1.0
        elif key in self.own:
            found = not self._is_over(verdict, apart)
        else:
            found = self._is_found(verdict, apart, target.measured_s)
        if found is not (key in self.own):
            verdict.reports = 0
            self.own.symmetric_difference_update((key,))
        return found

    def forget(self, key: str) -> None:
        """This one is not heard any more."""
        self._verdicts.pop(key, None)
        self.own.discard(key)

    def _is_over(self, verdict: _Verdict, apart: float) -> bool:
        """Whether an echo was so far away for so many reports that it is somebody."""
        verdict.reports = verdict.reports + 1 if apart > self._params.split_factor else 0
        return verdict.reports >= self._params.split_reports

    def _is_found(self, verdict: _Verdict, apart: float, now_s: float) -> bool:
        """Whether somebody was with us for so long that it is an echo."""
        if apart > 1.0:
            verdict.reports = 0
            return False
        if not verdict.reports:
            verdict.since_s = now_s
        verdict.reports += 1
        return verdict.reports >= self._params.reports and now_s - verdict.since_s >= self._params.after_s

    def _gap(self, target: Target, datums: Datums) -> float | None:
        """How unlike us it is, in parts of the gate, inf beyond any; `None` when that cannot be said."""
        params, motion = self._params, target.motion
        if motion is None:
            return None
        then = [
            own
            for own in self._trail
            if -_AHEAD_S <= motion.place_s - own.time_s <= params.delay_s + _SPACING_S
        ]
        if not then:
            return None
        if abs(motion.lat_deg - then[-1].lat_deg) > _NEAR_DEG:
            return math.inf
        height = compare(motion.heights, datums, motion.place_s)
        if height is None:
            return None
        frame = LocalFrame(motion.lat_deg, motion.lon_deg)
        vertical_m, furthest = params.vertical_m + height.uncertainty_m, max(params.split_factor, 1.0)
        # Most of who is near is beyond the gate by latitude alone.
        furthest_deg = furthest * params.radius_m / frame.metres_per_degree[0]
        smallest = math.inf
        for own in then:
            if abs(own.lat_deg - motion.lat_deg) > furthest_deg:
                continue
            north_m, east_m = frame.to_north_east_m(own.lat_deg, own.lon_deg)
            apart = math.hypot(north_m, east_m) / params.radius_m
            if apart > furthest or apart >= smallest:
                continue
            unlike_mps = math.hypot(own.north_mps - motion.north_mps, own.east_mps - motion.east_mps)
            apart = max(
                apart,
                unlike_mps / params.velocity_mps,
                abs(own.altitude_m - height.altitude_m) / vertical_m,
                abs(own.climb_mps - height.climb_mps) / params.climb_mps,
            )
            smallest = min(smallest, apart)
        # Who is not where we were may be where we are, if that is not known.
        return None if smallest > 1.0 and motion.place_s - then[-1].time_s > _SILENT_S else smallest
