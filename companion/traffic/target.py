"""One aircraft (or vehicle, or obstacle) that was heard: what its reports add up to."""

import math
from collections import Counter
from enum import StrEnum
from typing import NamedTuple

from companion.model import AltitudeReference, TrafficKind, TrafficReport, Vec2
from companion.traffic.altitude_datums import Height
from companion.traffic.outlier_gate import OutlierGate
from companion.traffic.params import TrafficParams
from companion.traffic.repeats import RepeatMemory, content_of
from companion.traffic.track_filter import HorizontalEstimate, HorizontalFix, VerticalEstimate, VerticalFix
from companion.traffic.turning import TurnEstimate


class Dropped(StrEnum):
    """Why a report, or a part of it, was not used."""

    NO_ADDRESS = "no address"
    OWN = "ourselves"
    ON_GROUND = "on the ground"
    BAD_NUMBER = "bad number"
    NO_POSITION = "no position"
    STALE = "stale"
    REPEATED = "repeated"
    REORDERED = "reordered"
    JUMPED = "jumped"
    # The rest of the report is used, but it gives no height, or one that is not believed.
    NO_ALTITUDE = "no altitude"
    ALTITUDE_JUMPED = "altitude jumped"


class Motion(NamedTuple):
    """All that flying a target on to now needs: velocities [m/s], and its height in each reference it gave.

    `turn_radps` is positive to the right; `sigma_m` is what the sender states of its position's accuracy.
    """

    lat_deg: float
    lon_deg: float
    place_s: float
    north_mps: float
    east_mps: float
    turn_radps: float
    sigma_m: float | None
    heights: tuple[Height, ...]


class _Vertical(NamedTuple):
    estimate: OutlierGate[VerticalEstimate, VerticalFix]
    sigma_m: float


class Target:
    """The state of one key. Times are those of the tracker's clock, which never runs backwards."""

    __slots__ = (
        "_dropped",
        "_horizontal",
        "_params",
        "_repeats",
        "_turn",
        "_verticals",
        "callsign",
        "forget_s",
        "icao",
        "key",
        "kind",
        "measured_s",
        "motion",
        "source",
    )

    def __init__(self, report: TrafficReport, params: TrafficParams, dropped: Counter[Dropped]) -> None:
        self.source = report.source
        self.key = report.key
        self.icao = report.icao
        self.callsign: str | None = None
        self.kind = TrafficKind.AIRCRAFT
        self.measured_s = -math.inf
        self.forget_s = math.inf
        self.motion: Motion | None = None
        self._params = params
        self._dropped = dropped
        self._repeats = RepeatMemory(params.repeat_window_s)
        self._horizontal: OutlierGate[HorizontalEstimate, HorizontalFix] | None = None
        self._turn = TurnEstimate(params.estimate)
        # References are not mixed: two zeros would look like climbs.
        self._verticals: dict[AltitudeReference, _Vertical] = {}

    def receive(self, report: TrafficReport, lat_deg: float, lon_deg: float, time_s: float) -> bool:
        """Take in a report of the given place, valid at `time_s`; True when it was a new measurement."""
        self.callsign = report.callsign or self.callsign
        if self._repeats.is_repeat(content_of(report), time_s, may_stand_still=self._may_stand_still(report)):
            self._dropped[Dropped.REPEATED] += 1
            return False
        if time_s < self.measured_s:
            self._dropped[Dropped.REORDERED] += 1
            return False
        if report.kind is not self.kind:
            # What stood still may fly from now on, or the reverse: nothing known so far applies.
            self.kind, self._horizontal, self._verticals = report.kind, None, {}
        fix = HorizontalFix(time_s, lat_deg, lon_deg, self._velocity_mps(report))
        if self._horizontal is None or self.kind is TrafficKind.OBSTACLE:
            self._horizontal = OutlierGate(HorizontalEstimate(fix, self._params.estimate))
        elif not self._horizontal.receive(fix):
            self._dropped[Dropped.JUMPED] += 1
            return False
        self._turn.receive(time_s, fix.velocity_mps)
        self._receive_height(report, time_s)
        self.measured_s = time_s
        self.forget_s = time_s + self._params.stale_after_s(self.kind)
        self.motion = self._motion(self._horizontal.estimate, report.position_sigma_m)
        return True

    def _motion(self, here: HorizontalEstimate, sigma_m: float | None) -> Motion:
        heights = tuple(
            self._height(reference, vertical.estimate.estimate, vertical.sigma_m)
            for reference, vertical in self._verticals.items()
        )
        return Motion(
            here.lat_deg,
            here.lon_deg,
            here.time_s,
            here.north_mps,
            here.east_mps,
            self._turn.rate_radps,
            sigma_m,
            heights,
        )

    def _height(self, reference: AltitudeReference, here: VerticalEstimate, sigma_m: float) -> Height:
        until_s = (
            math.inf if self.kind is TrafficKind.OBSTACLE else here.time_s + self._params.altitude_hold_s
        )
        return Height(reference, here.altitude_m, here.time_s, here.climb_mps, until_s, sigma_m)

    def _receive_height(self, report: TrafficReport, time_s: float) -> None:
        for height in () if self.motion is None else self.motion.heights:
            if time_s > height.until_s:
                self._verticals.pop(height.reference, None)
        if report.altitude_m is None:
            self._dropped[Dropped.NO_ALTITUDE] += not self._verticals
            return
        fix = VerticalFix(time_s, report.altitude_m, self._climb_mps(report))
        sigma_m = report.altitude_sigma_m or 0.0
        known = self._verticals.get(report.altitude_reference)
        if known is None or self.kind is TrafficKind.OBSTACLE:
            estimate: OutlierGate[VerticalEstimate, VerticalFix]
            estimate = OutlierGate(VerticalEstimate(fix, self._params.estimate))
        elif known.estimate.receive(fix):
            estimate = known.estimate
        else:
            self._dropped[Dropped.ALTITUDE_JUMPED] += 1
            return
        self._verticals[report.altitude_reference] = _Vertical(estimate, sigma_m)

    def _velocity_mps(self, report: TrafficReport) -> Vec2 | None:
        if self.kind is TrafficKind.OBSTACLE or report.ground_speed_mps == 0.0:
            return 0.0, 0.0
        speed_mps, course_rad = report.ground_speed_mps, report.course_rad
        if speed_mps is None or course_rad is None:
            return None
        if not 0.0 <= speed_mps <= self._params.estimate.max_speed_mps:
            return None
        return speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)

    def _climb_mps(self, report: TrafficReport) -> float | None:
        if self.kind is TrafficKind.OBSTACLE:
            return 0.0
        if report.climb_mps is None or abs(report.climb_mps) > self._params.estimate.max_climb_mps:
            return None
        return report.climb_mps

    def _may_stand_still(self, report: TrafficReport) -> bool:
        return (
            report.kind is TrafficKind.OBSTACLE
            or report.ground_speed_mps is None
            or report.ground_speed_mps <= self._params.hovering_mps
        )
