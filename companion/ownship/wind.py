"""The wind as the autopilot reports it, otherwise estimated from ground and air velocity."""

import math

from companion.mavlink.facts import OwnPosition, Wind
from companion.model import Vec2

# Time constant of the estimate: longer than a gust or the swing of the nose.
_TIME_CONSTANT_S = 10.0
_FRESH_S = 5.0
# The estimate is updated with every position, unless airspeed or heading is missing.
_ESTIMATE_FRESH_S = 30.0
# An estimate above this share of the airspeed comes from a wrong airspeed, as on the ground.
_LARGEST_SHARE = 0.6
# Reports come from a filter that has observed turns, and may be stronger; this is hurricane force.
_STRONGEST_REPORTED_MPS = 40.0


class WindEstimator:
    """The newest report and a running estimate."""

    def __init__(self) -> None:
        self._report: Wind | None = None
        self._report_s = -math.inf
        self._estimate: Vec2 | None = None
        self._estimate_s = -math.inf

    def report(self, fact: Wind, now_s: float) -> None:
        """Store a report, unless it is implausible or exactly 0, as ArduPilot sends without an estimate."""
        speed_mps = math.hypot(fact.north_mps, fact.east_mps)
        if 0.0 < speed_mps <= _STRONGEST_REPORTED_MPS:
            self._report, self._report_s = fact, now_s

    def observe(self, position: OwnPosition, airspeed_mps: float | None, now_s: float) -> None:
        """Update the estimate: velocity over ground minus velocity through the air, smoothed."""
        if airspeed_mps is None or position.heading_rad is None or airspeed_mps < 1.0:
            return
        north = position.velocity_mps[0] - airspeed_mps * math.cos(position.heading_rad)
        east = position.velocity_mps[1] - airspeed_mps * math.sin(position.heading_rad)
        if self._estimate is None or not 0.0 <= now_s - self._estimate_s <= _ESTIMATE_FRESH_S:
            self._estimate = north, east
        else:
            share = 1.0 - math.exp((self._estimate_s - now_s) / _TIME_CONSTANT_S)
            known = self._estimate
            self._estimate = known[0] + share * (north - known[0]), known[1] + share * (east - known[1])
        self._estimate_s = now_s

    def wind_mps(self, airspeed_mps: float, now_s: float) -> Vec2 | None:
        """Velocity of the air over the ground, north and east; `None` when unknown or too strong.

        A fresh report takes precedence over the estimate.
        """
        report = self._report
        if report is not None and 0.0 <= now_s - self._report_s <= _FRESH_S:
            # The prediction needs an aircraft that makes headway against the wind.
            if math.hypot(report.north_mps, report.east_mps) < airspeed_mps:
                return report.north_mps, report.east_mps
            return None
        estimate = self._estimate
        if estimate is None or now_s - self._estimate_s > _ESTIMATE_FRESH_S:
            return None
        return estimate if math.hypot(*estimate) <= _LARGEST_SHARE * airspeed_mps else None
