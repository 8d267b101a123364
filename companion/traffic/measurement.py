"""Reports with place and time as the filters take them, and reports that were received before."""

import math
from enum import StrEnum
from typing import Final, NamedTuple

from companion.model import AltitudeReference, TrafficReport, Vec2
from companion.traffic.params import TrafficParams

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
    reference and its standard deviation, 0 if the sender states none.
    """

    report: TrafficReport
    time_s: float
    received_s: float
    lat_deg: float
    lon_deg: float
    velocity_mps: Vec2 | None
    climb_mps: float | None
    altitudes: tuple[tuple[AltitudeReference, float, float], ...]
    urgent: bool = False  # it may be near us within seconds


def measure(
    report: TrafficReport,
    time_s: float,
    received_s: float,
    lat_deg: float,
    lon_deg: float,
    params: TrafficParams,
) -> Measurement:
    """The measurement that a report at this place is."""
    climb_mps = report.climb_mps
    if climb_mps is not None and abs(climb_mps) > params.estimate.max_climb_mps:
        climb_mps = None
    return Measurement(
        report,
        time_s,
        received_s,
        lat_deg,
        lon_deg,
        _velocity_mps(report, params.estimate.max_speed_mps),
        climb_mps,
        _altitudes(report),
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
