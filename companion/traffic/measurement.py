"""Reports as the filters take them: place and time, accuracy, and whether they were received before."""

import math
from enum import StrEnum
from typing import Final, NamedTuple

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
        HorizontalFix(time_s, lat_deg, lon_deg, velocity_mps, *sigmas),
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
