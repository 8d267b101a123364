"""One source's view of one aircraft, vehicle or obstacle: its reports filtered to a motion."""

import math
from collections import Counter
from enum import StrEnum
from typing import NamedTuple

from companion.model import AltitudeReference, TrafficKind, TrafficReport, Vec2
from companion.traffic.altitude_datums import ReportedAltitude
from companion.traffic.params import TrafficParams
from companion.traffic.track_filter import (
    HorizontalFilter,
    HorizontalFix,
    OutlierGate,
    VerticalFilter,
    VerticalFix,
)

# With more distinct reports of one aircraft in the window (9 Hz) the oldest is forgotten.
_MAX_REMEMBERED = 64

_Content = tuple[float | None, ...]


class DropReason(StrEnum):
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
    # The report is used except for its altitude, which is missing or an outlier.
    NO_ALTITUDE = "no altitude"
    ALTITUDE_JUMPED = "altitude jumped"


class Motion(NamedTuple):
    """Estimated motion, from which the present position follows: velocities in m/s, times in s.

    `turn_radps` is positive to the right; `sigma_m` is the accuracy of the position as stated by the sender.
    There is one altitude for each reference that the target reports.
    """

    lat_deg: float
    lon_deg: float
    position_s: float
    north_mps: float
    east_mps: float
    turn_radps: float
    sigma_m: float | None
    altitudes: tuple[ReportedAltitude, ...]


class RepeatFilter:
    """Recognizes reports of one aircraft that were sent again.

    ArduPilot re-sends a report for up to 5 s without changing its age, and a second link delivers it late,
    after newer ones; therefore several past reports are remembered. An aircraft that stands still sends
    identical reports: the first one after the window, counted from the first of them, is a new measurement.
    """

    __slots__ = ("_first_received_s", "_window_s")

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._first_received_s: dict[_Content, float] = {}

    def is_repeat(self, content: _Content, time_s: float, *, may_stand_still: bool) -> bool:
        """Whether this content, valid at `time_s`, was received before; new content is remembered."""
        first_received_s = self._first_received_s.get(content)
        if first_received_s is None:
            self._forget_before(time_s - self._window_s)
            self._first_received_s[content] = time_s
            return False
        if not may_stand_still or time_s - first_received_s <= self._window_s:
            return True
        self._first_received_s[content] = time_s
        return False

    def _forget_before(self, oldest_s: float) -> None:
        if len(self._first_received_s) >= _MAX_REMEMBERED:
            del self._first_received_s[next(iter(self._first_received_s))]
        self._first_received_s = {
            content: received_s
            for content, received_s in self._first_received_s.items()
            if received_s >= oldest_s
        }


class _Vertical(NamedTuple):
    gate: OutlierGate[VerticalFilter, VerticalFix]
    sigma_m: float


def stale_after_s(kind: TrafficKind, params: TrafficParams) -> float:
    """Time without a new measurement after which a track of this kind is dropped [s]."""
    return params.obstacle_stale_s if kind is TrafficKind.OBSTACLE else params.stale_s


class Target:
    """The state of one key. Its times are those of the tracker's monotonic clock."""

    __slots__ = (
        "_dropped",
        "_horizontal",
        "_params",
        "_repeats",
        "_verticals",
        "callsign",
        "expires_s",
        "icao",
        "key",
        "kind",
        "measured_s",
        "motion",
        "source",
    )

    def __init__(self, report: TrafficReport, params: TrafficParams, dropped: Counter[DropReason]) -> None:
        self.source = report.source
        self.key = report.key
        self.icao = report.icao
        self.callsign: str | None = None
        self.kind = TrafficKind.AIRCRAFT
        self.measured_s = -math.inf
        self.expires_s = math.inf
        self.motion: Motion | None = None
        self._params = params
        self._dropped = dropped
        self._repeats = RepeatFilter(params.repeat_window_s)
        self._horizontal: OutlierGate[HorizontalFilter, HorizontalFix] | None = None
        # Each reference has its own filter: the difference between two references would look like a climb.
        self._verticals: dict[AltitudeReference, _Vertical] = {}

    def receive(self, report: TrafficReport, lat_deg: float, lon_deg: float, time_s: float) -> bool:
        """Process a report of the given position, valid at `time_s`; True if it is a new measurement."""
        self.callsign = report.callsign or self.callsign
        if self._repeats.is_repeat(_content(report), time_s, may_stand_still=self._may_stand_still(report)):
            self._dropped[DropReason.REPEATED] += 1
            return False
        if time_s < self.measured_s:
            self._dropped[DropReason.REORDERED] += 1
            return False
        if report.kind is not self.kind:
            # An obstacle became an aircraft or the reverse: the previous estimates do not apply to it.
            self.kind, self._horizontal, self._verticals = report.kind, None, {}
        fix = HorizontalFix(
            time_s,
            lat_deg,
            lon_deg,
            self._velocity_mps(report),
            report.position_sigma_m,
            report.velocity_sigma_mps,
        )
        if self._horizontal is None or self.kind is TrafficKind.OBSTACLE:
            self._horizontal = OutlierGate(HorizontalFilter(fix, self._params.estimate))
        elif not self._horizontal.receive(fix):
            self._dropped[DropReason.JUMPED] += 1
            return False
        self._receive_altitude(report, time_s)
        self.measured_s = time_s
        self.expires_s = time_s + stale_after_s(self.kind, self._params)
        self.motion = self._motion(self._horizontal.estimate, report.position_sigma_m)
        return True

    def _motion(self, here: HorizontalFilter, sigma_m: float | None) -> Motion:
        altitudes = tuple(
            self._altitude(reference, vertical.gate.estimate, vertical.sigma_m)
            for reference, vertical in self._verticals.items()
        )
        return Motion(
            here.lat_deg,
            here.lon_deg,
            here.time_s,
            here.north_mps,
            here.east_mps,
            here.turn_radps,
            sigma_m,
            altitudes,
        )

    def _altitude(
        self, reference: AltitudeReference, here: VerticalFilter, sigma_m: float
    ) -> ReportedAltitude:
        valid_until_s = (
            math.inf if self.kind is TrafficKind.OBSTACLE else here.time_s + self._params.altitude_hold_s
        )
        return ReportedAltitude(
            reference, here.altitude_m, here.time_s, here.climb_mps, valid_until_s, sigma_m
        )

    def _receive_altitude(self, report: TrafficReport, time_s: float) -> None:
        for altitude in () if self.motion is None else self.motion.altitudes:
            if time_s > altitude.valid_until_s:
                self._verticals.pop(altitude.reference, None)
        if report.altitude_m is None:
            self._dropped[DropReason.NO_ALTITUDE] += not self._verticals
            return
        fix = VerticalFix(time_s, report.altitude_m, self._climb_mps(report), report.altitude_sigma_m)
        sigma_m = report.altitude_sigma_m or 0.0
        known = self._verticals.get(report.altitude_reference)
        if known is None or self.kind is TrafficKind.OBSTACLE:
            gate: OutlierGate[VerticalFilter, VerticalFix]
            gate = OutlierGate(VerticalFilter(fix, self._params.estimate))
        elif known.gate.receive(fix):
            gate = known.gate
        else:
            self._dropped[DropReason.ALTITUDE_JUMPED] += 1
            return
        self._verticals[report.altitude_reference] = _Vertical(gate, sigma_m)

    def _velocity_mps(self, report: TrafficReport) -> Vec2 | None:
        """The reported velocity (north, east), `None` if it is missing or impossible."""
        if self.kind is TrafficKind.OBSTACLE or report.ground_speed_mps == 0.0:
            return 0.0, 0.0
        speed_mps, course_rad = report.ground_speed_mps, report.course_rad
        if speed_mps is None or course_rad is None:
            return None
        if not 0.0 <= speed_mps <= self._params.estimate.max_speed_mps:
            return None
        return speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)

    def _climb_mps(self, report: TrafficReport) -> float | None:
        """The reported climb, `None` if it is missing or impossible."""
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


def _content(report: TrafficReport) -> _Content:
    """The measured values of a report: position, altitude and motion, without the time."""
    return (
        report.lat_deg,
        report.lon_deg,
        report.altitude_m,
        report.course_rad,
        report.ground_speed_mps,
        report.climb_mps,
    )
