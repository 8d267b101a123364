"""Reports as the filters take them: place and time, accuracy, repetitions, and stated rates.

A stated rate (velocity, climb) counts while it agrees with the positions: their residuals against the
integral of the stated rate are fitted by a line, whose slope is the error of the rate. The noise of positions
differs between senders, so that its variance is estimated with the slope, from an inverse-gamma prior (Gelman
et al., Bayesian Data Analysis, 3rd ed. 2013, 14.2).
"""

import math
from enum import StrEnum
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import AltitudeReference, TrafficReport, TrafficSource, Vec2
from companion.traffic.params import TrafficParams
from companion.traffic.track_filter import HorizontalFix

# Standard deviations of each horizontal axis [m] if the sender states none. ADS-B, ADS-R: NACp 8, a 95 %
# radius of 93 m, which most installations keep (RTCA DO-260B, table 2-14). TIS-B: radar within 60 NM, a 95 %
# radius of 0.2 NM (RTCA DO-286B, 2.1.2); MLAT: 150 m RMS (EUROCAE ED-142). FLARM and Remote ID: satellite
# receivers, with the steps of a short-range message (ASTM F3411-22a, 95 % 10 to 30 m). UTM: a network of such
# receivers. Other autopilots send filtered positions.
TYPICAL_SIGMA_M: Final = {
    TrafficSource.ADSB: 30.0,
    TrafficSource.ADSR: 30.0,
    TrafficSource.TISB: 150.0,
    TrafficSource.MLAT: 100.0,
    TrafficSource.MODE_S: 1000.0,
    TrafficSource.FLARM: 10.0,
    TrafficSource.REMOTE_ID: 12.0,
    TrafficSource.UTM: 20.0,
    TrafficSource.SYSTEM: 5.0,
}
# The same of a velocity [m/s]: NACv 1 has a 95 % radius of 10 m/s, NACv 2 of 3 m/s (DO-260B, table 2-22).
_TYPICAL_SIGMA_MPS: Final = {
    TrafficSource.ADSB: 1.5,
    TrafficSource.ADSR: 1.5,
    TrafficSource.TISB: 5.0,
    TrafficSource.MLAT: 5.0,
    TrafficSource.MODE_S: 10.0,
    TrafficSource.FLARM: 1.0,
    TrafficSource.REMOTE_ID: 1.0,
    TrafficSource.UTM: 1.5,
    TrafficSource.SYSTEM: 0.5,
}
_TRANSPONDERS: Final = frozenset({TrafficSource.ADSB, TrafficSource.ADSR})
# A source with a lower rank identifies an aircraft in more places: the track takes its key.
RANK: Final = {source: number for number, source in enumerate(TYPICAL_SIGMA_M)} | {
    TrafficSource.ADSB: 0,
    TrafficSource.ADSR: 1,
    TrafficSource.MLAT: 2,
    TrafficSource.TISB: 3,
    TrafficSource.FLARM: 4,
    TrafficSource.REMOTE_ID: 5,
    TrafficSource.UTM: 6,
    TrafficSource.SYSTEM: 7,
    TrafficSource.MODE_S: 8,
}
# Stated errors beyond these mean the same: nothing is known.
_WORST_M, _WORST_MPS = 50_000.0, 1_000.0
# A normal error exceeds this many sigmas of an axis with the probability of SIL 1, 2, 3: sqrt(-2 ln P).
_CONTAINED_SIGMAS: Final = {1: 3.717, 2: 4.799, 3: 5.678}


def position_sigma_m(report: TrafficReport) -> float:
    """The standard deviation of each horizontal axis [m]: stated, contained, or typical of the source."""
    if report.position_sigma_m is not None and report.position_sigma_m > 0.0:
        return min(report.position_sigma_m, _WORST_M)
    sigmas = _CONTAINED_SIGMAS.get(report.sil or 0)
    if sigmas is not None and report.containment_m is not None and report.containment_m > 0.0:
        return min(report.containment_m / sigmas, _WORST_M)
    return TYPICAL_SIGMA_M[report.source]


def filter_sigma_m(report: TrafficReport) -> float | None:
    """The same for a filter; `None`: the usual one, of transponders, which are better than typical."""
    if report.position_sigma_m is None and report.source in _TRANSPONDERS:
        return None
    return position_sigma_m(report)


def velocity_sigma_mps(report: TrafficReport) -> float:
    """The standard deviation of each horizontal axis of a stated velocity [m/s]."""
    if report.velocity_sigma_mps is not None and report.velocity_sigma_mps > 0.0:
        return min(report.velocity_sigma_mps, _WORST_MPS)
    return _TYPICAL_SIGMA_MPS[report.source]


# A larger stated error means the same: nothing is known.
_WORST_ALTITUDE_M: Final = 10_000.0
Content = tuple[float | None, ...]
# With more distinct reports of one aircraft in the window (9 Hz) the oldest is forgotten.
MOST_OF_ONE: Final = 64


class DropReason(StrEnum):
    """Why a report, or a part of it, was not used."""

    OWN = "ourselves"
    ON_GROUND = "on the ground"
    BAD_NUMBER = "bad number"
    NO_POSITION = "no position"
    STALE = "stale"
    REPEATED = "repeated"
    REORDERED = "reordered"
    # It begins another hypothesis of its key: of another place or of another altitude.
    JUMPED = "jumped"
    ALTITUDE_JUMPED = "altitude jumped"
    # The report is used except for a part of it, which is missing or contradicts the positions.
    NO_ALTITUDE = "no altitude"
    VELOCITY_WRONG = "wrong velocity"
    CLIMB_WRONG = "wrong climb"
    FULL = "too many"


class Measurement(NamedTuple):
    """A report of a place at `time_s`, heard at `received_s` on the tracker's clock.

    The stated velocity (north, east) and climb are `None` if missing or impossible. Each altitude has its
    reference and its standard deviation, 0 if the sender states none. `fix` is the place for a filter.
    """

    report: TrafficReport
    time_s: float
    received_s: float
    lat_deg: float
    lon_deg: float
    velocity_mps: Vec2 | None
    climb_mps: float | None
    altitudes: tuple[tuple[AltitudeReference, float, float], ...]
    fix: HorizontalFix
    urgent: bool = False  # it may be near us within seconds
    sender: str = ""  # of several that send the same kind of report
    late_s: float = 0.0  # how much before `time_s` it was measured

    @property
    def observer(self) -> tuple[str, str]:
        """The receiver, or the kind of surveillance and who sends it."""
        return self.report.heard_by or self.report.source.value, self.sender

    def valid_at(self, time_s: float) -> "Measurement":
        """The same at another time."""
        return self._replace(time_s=time_s, fix=self.fix._replace(time_s=time_s))


def measure(
    report: TrafficReport,
    time_s: float,
    received_s: float,
    lat_deg: float,
    lon_deg: float,
    params: TrafficParams,
    sender: str = "",
) -> Measurement:
    """The measurement that a report at this place is."""
    climb_mps = report.climb_mps
    if climb_mps is not None and abs(climb_mps) > params.estimate.max_climb_mps:
        climb_mps = None
    velocity_mps = _velocity_mps(report, params.estimate.max_speed_mps)
    sigmas = filter_sigma_m(report), velocity_sigma_mps(report)
    return Measurement(
        report,
        time_s,
        received_s,
        lat_deg,
        lon_deg,
        velocity_mps,
        climb_mps,
        _altitudes(report),
        HorizontalFix(
            time_s, lat_deg, lon_deg, velocity_mps, *sigmas, report.heard_by or report.source.value + sender
        ),
        sender=sender,
    )


def _altitudes(report: TrafficReport) -> tuple[tuple[AltitudeReference, float, float], ...]:
    """One altitude, or a barometric and a geometric one."""
    sigma_m = min(max(report.altitude_sigma_m or 0.0, 0.0), _WORST_ALTITUDE_M)
    first = () if report.altitude_m is None else ((report.altitude_reference, report.altitude_m, sigma_m),)
    if report.geometric_altitude_m is None or report.altitude_reference is AltitudeReference.GEOMETRIC:
        return first
    # The stated accuracy is that of satellite altitudes.
    if first and report.altitude_reference is AltitudeReference.BAROMETRIC:
        first = ((AltitudeReference.BAROMETRIC, first[0][1], 0.0),)
    return (*first, (AltitudeReference.GEOMETRIC, report.geometric_altitude_m, sigma_m))


def _velocity_mps(report: TrafficReport, max_speed_mps: float) -> Vec2 | None:
    speed_mps, course_rad = report.ground_speed_mps, report.course_rad
    if speed_mps == 0.0:
        return 0.0, 0.0
    if speed_mps is None or course_rad is None or not 0.0 <= speed_mps <= max_speed_mps:
        return None
    return speed_mps * math.cos(course_rad), speed_mps * math.sin(course_rad)


class RepeatFilter:
    """Recognizes reports that were sent again.

    ArduPilot re-sends a report for up to 5 s without changing its age, and a second link delivers it late,
    after newer ones; therefore several past reports are remembered. An aircraft that stands still sends
    identical reports: the first one after the window, counted from the first of them, is a new measurement.
    """

    __slots__ = ("_first_received_s", "_most", "_window_s")

    def __init__(self, window_s: float, most: int = MOST_OF_ONE) -> None:
        self._window_s = window_s
        self._most = most
        # In the order of the reception, the oldest first.
        self._first_received_s: dict[Content, float] = {}

    def is_repeat(self, content: Content, time_s: float, *, may_stand_still: bool) -> bool:
        """Whether this content, received at `time_s`, was received before; new content is remembered."""
        first_received_s = self._first_received_s.get(content)
        if first_received_s is None:
            self._forget_before(time_s - self._window_s)
            self._first_received_s[content] = time_s
            return False
        if not may_stand_still or time_s - first_received_s <= self._window_s:
            return True
        del self._first_received_s[content]
        self._first_received_s[content] = time_s
        return False

    def _forget_before(self, oldest_s: float) -> None:
        received = self._first_received_s
        while received:
            content = next(iter(received))
            if len(received) < self._most and received[content] >= oldest_s:
                return
            del received[content]


def content_of(report: TrafficReport) -> Content:
    """The measured values of a report: position, altitude and motion, without the time."""
    return (
        report.lat_deg,
        report.lon_deg,
        report.altitude_m,
        report.course_rad,
        report.ground_speed_mps,
        report.climb_mps,
        *(report.relative_m or ()),
    )


def is_possible(report: TrafficReport) -> bool:
    """Whether all numbers are finite, and the position is on the globe."""
    total = (
        report.time_s
        + (report.lat_deg or 0.0)
        + (report.lon_deg or 0.0)
        + (report.altitude_m or 0.0)
        + (report.course_rad or 0.0)
        + (report.ground_speed_mps or 0.0)
        + (report.climb_mps or 0.0)
        + (report.position_sigma_m or 0.0)
        + (report.altitude_sigma_m or 0.0)
        + (report.velocity_sigma_mps or 0.0)
        + (report.containment_m or 0.0)
        + (report.geometric_altitude_m or 0.0)
        + sum(report.relative_m or ())
    )
    if not math.isfinite(total):
        return False
    return abs(report.lat_deg or 0.0) <= 90.0 and abs(report.lon_deg or 0.0) <= 180.0


# Noise of positions and altitudes of which little is known yet: the filters', and more for coarse senders.
NOISE_SHARE: Final = 4.0 / 3.0
_MOST_POINTS, _LEAST_POINTS = 8, 3
# The first points are near each other, so that an error is found soon; the others reach further back.
_SPACING_S, _CLOSE_POINTS = 0.5, 4
_LONGEST_GAP_S: Final = 12.0
_LONGEST_S: Final = 30.0
# Weight of the prior, in degrees of freedom: of the usual noise, and of what was learnt of the sender's.
_PRIOR_FREEDOM, _LEARNT_FREEDOM = 4.0, 24.0
# One in ten thousand windows of a correct rate has a larger slope, in standard deviations (two axes).
# Later ones, of which there are many, must be clearer by the second number for each point.
_SIGNIFICANT, _MORE_SIGNIFICANT = 4.3, 0.4
# Time stamps are off by one or two seconds, evenly: the position along the path by this much of a second's
# way.
_TIMING_S: Final = 0.55
_WRONG_SHARE, _RIGHT_SHARE = 0.25, 0.15
# Most rates are right: then all points are compared only so often.
_SKIPPED, _PLAINLY_SHARE = 4, 0.5
# A line through so many places continues within so many sigmas, and as far as the aircraft can turn away.
_LINE_POINTS, _LINE_SIGMAS, _ACCELERATION_MPS2 = 4, 3.0, 5.0
# A rate that was wrong must agree for this long.
_REGAINED_S: Final = 15.0


class _Point(NamedTuple):
    time_s: float
    residual: complex
    place: tuple[float, ...]


class StatedRate:
    """A stated rate along two axes (north, east as one complex number) or one (the imaginary part is 0)."""

    __slots__ = (
        "_axes",
        "_floor_mps",
        "_integral",
        "_last",
        "_learnt_m2",
        "_learnt_windows",
        "_points",
        "_right_since_s",
        "_sigma_m",
        "_skipped",
        "trusted",
    )

    def __init__(self, sigma_m: float, floor_mps: float, axes: int) -> None:
        self._sigma_m, self._floor_mps, self._axes = sigma_m, floor_mps, axes
        self._points: list[_Point] = []
        self._integral = 0j
        self._last: tuple[float, complex] | None = None  # time and stated rate of the last report
        self._right_since_s: float | None = None
        self._learnt_m2, self._learnt_windows = 0.0, 0.0
        self._skipped = 0
        self.trusted = True

    @property
    def places(self) -> list[tuple[float, ...]]:
        """Time and place of the reports that are compared, the oldest first."""
        return [(point.time_s, *point.place) for point in self._points]

    def continues(self, time_s: float, place: tuple[float, float]) -> bool:
        """Whether a place (latitude, longitude) is on the line of the last ones, whatever rate is stated."""
        if len(self._points) < 2:
            return False
        first, last = self._points[-min(len(self._points), _LINE_POINTS)], self._points[-1]
        elapsed_s = time_s - last.time_s
        if not 0.0 <= elapsed_s <= _LONGEST_GAP_S:
            return False
        share = elapsed_s / (last.time_s - first.time_s)
        frame = LocalFrame(last.place[0], last.place[1])
        back_m = complex(*frame.to_north_east_m(first.place[0], first.place[1]))
        off_m = complex(*frame.to_north_east_m(*place)) + share * back_m
        noise_m = self._sigma_m * math.sqrt(1.0 + (1.0 + share) ** 2 + share**2)
        return abs(off_m) <= _LINE_SIGMAS * noise_m + 0.5 * _ACCELERATION_MPS2 * elapsed_s**2

    def receive(
        self, time_s: float, position_m: complex, stated_mps: complex | None, place: tuple[float, ...]
    ) -> bool:
        """Compare a position and the stated rate with those before; returns whether the rate is to be used.

        `place` is kept for `places`.
        """
        if stated_mps is None:
            return self.trusted
        last, self._last = self._last, (time_s, stated_mps)
        if last is None or not 0.0 <= time_s - last[0] <= _LONGEST_GAP_S:
            self._points.clear()
            self._integral = position_m
        else:
            self._integral += 0.5 * (last[1] + stated_mps) * (time_s - last[0])
        points = self._points
        spacing_s = _SPACING_S if len(points) < _CLOSE_POINTS else 1.4 * _SPACING_S
        if points and time_s - points[-1].time_s < spacing_s - 1e-3:
            return self.trusted
        while points and (len(points) >= _MOST_POINTS or time_s - points[0].time_s > _LONGEST_S):
            del points[0]
        points.append(_Point(time_s, position_m - self._integral, place))
        if len(points) >= _LEAST_POINTS and not self._is_plainly_right():
            self._judge(time_s, stated_mps)
        return self.trusted

    def _is_plainly_right(self) -> bool:
        """Whether first and last agree, so that only every fourth time all are compared."""
        self._skipped = (self._skipped + 1) % _SKIPPED if self.trusted else 0
        first, last = self._points[0], self._points[-1]
        drift_mps = abs(last.residual - first.residual) / (last.time_s - first.time_s)
        return self._skipped != 0 and drift_mps < _PLAINLY_SHARE * self._floor_mps

    def _judge(self, time_s: float, stated_mps: complex) -> None:
        count = len(self._points)
        middle_s = sum(point.time_s for point in self._points) / count
        mean = sum(point.residual for point in self._points) / count
        spread = sum((point.time_s - middle_s) ** 2 for point in self._points)
        slope = sum((point.time_s - middle_s) * point.residual for point in self._points) / spread
        error_mps, freedom = abs(slope), self._axes * (count - 2)
        faster_mps = max(abs(stated_mps), abs(stated_mps + slope))
        floor_mps = max(self._floor_mps, _WRONG_SHARE * faster_mps)
        scatter = sum(
            abs(point.residual - mean - slope * (point.time_s - middle_s)) ** 2 for point in self._points
        )
        sigma_mps = math.sqrt(self._variance_m2(scatter, freedom, faster_mps) / spread)
        significant = _SIGNIFICANT + _MORE_SIGNIFICANT * max(count - _CLOSE_POINTS - 1, 0)
        if error_mps > floor_mps and error_mps > significant * sigma_mps:
            self.trusted, self._right_since_s = False, None
        elif error_mps > max(self._floor_mps, _RIGHT_SHARE * faster_mps):
            self._right_since_s = None
        elif not self.trusted:
            self._right_since_s = time_s if self._right_since_s is None else self._right_since_s
            if time_s - self._right_since_s >= _REGAINED_S:
                self.trusted = True

    def _variance_m2(self, scatter_m2: float, freedom: int, speed_mps: float) -> float:
        """The variance of a position along each axis, and what is learnt of it from this window."""
        usual_m2 = self._sigma_m**2 + (_TIMING_S * speed_mps) ** 2
        windows = self._learnt_windows
        prior = min(_PRIOR_FREEDOM + windows, _LEARNT_FREEDOM)
        share = windows / (windows + _PRIOR_FREEDOM)
        expected_m2 = usual_m2 + share * (max(self._learnt_m2, 0.5 * usual_m2) - usual_m2)
        if self.trusted and freedom >= self._axes * (_MOST_POINTS - 2):
            self._learnt_windows = min(windows + 1.0, _LEARNT_FREEDOM)
            self._learnt_m2 += (scatter_m2 / freedom - self._learnt_m2) / self._learnt_windows
        return (prior * expected_m2 + scatter_m2) / (prior + freedom)
