"""Telling a report that was sent again from a new measurement."""

from companion.model import TrafficReport

# More distinct reports of one aircraft than this within the window is 9 Hz: the oldest may go.
_REMEMBERED = 64

Content = tuple[float | None, ...]


def content_of(report: TrafficReport) -> Content:
    """What a measurement changes: place, height and motion, but not the time."""
    return (
        report.lat_deg,
        report.lon_deg,
        report.altitude_m,
        report.course_rad,
        report.ground_speed_mps,
        report.climb_mps,
    )


class RepeatMemory:
    """The recent reports of one aircraft, and when each was first heard.

    ArduPilot re-sends a report for up to 5 s without ageing it, and a second link brings it late, after newer
    ones; so not only the last report is remembered. An aircraft that stands still says the same again
    truly: once the window has passed since the first of identical reports, the next one counts as new.
    """

    __slots__ = ("_first_heard_s", "_window_s")

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._first_heard_s: dict[Content, float] = {}

    def is_repeat(self, content: Content, time_s: float, *, may_stand_still: bool) -> bool:
        """Whether this content, valid at `time_s`, was heard before; if not, it is remembered."""
        first_heard_s = self._first_heard_s.get(content)
        if first_heard_s is None:
            self._forget_before(time_s - self._window_s)
            self._first_heard_s[content] = time_s
            return False
        if not may_stand_still or time_s - first_heard_s <= self._window_s:
            return True
        self._first_heard_s[content] = time_s
        return False

    def _forget_before(self, oldest_s: float) -> None:
        if len(self._first_heard_s) >= _REMEMBERED:
            del self._first_heard_s[next(iter(self._first_heard_s))]
        self._first_heard_s = {
            c: heard_s for c, heard_s in self._first_heard_s.items() if heard_s >= oldest_s
        }
