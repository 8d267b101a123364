"""Whether the service keeps up: ticks that came late or not at all, and what was dropped."""

from collections import deque
from typing import Final, NamedTuple

from companion.mavlink.dialect import mavlink
from companion.output.notice import Condition

# A tick this much after its time is late: half of the interval.
_LATE_US: Final = 50_000
# Over this time the service does not keep up when so large a share of the ticks was late, or anything was
# dropped.
_OVER_S, _LATE_SHARE = 5.0, 0.1
_LEAST_TICKS: Final = 10
OVERLOADED: Final = "overloaded"


class _Moment(NamedTuple):
    time_s: float
    ticks: int
    late: int  # with those that were skipped
    dropped: int


class Load:
    """The load of the last seconds. `late_ticks` counts since the start."""

    def __init__(self) -> None:
        self.late_ticks = 0
        self._moments: deque[_Moment] = deque()

    def note_tick(self, late_us: int) -> None:
        """Note how late a tick was made."""
        self.late_ticks += late_us > _LATE_US

    def condition(self, now_s: float, *, ticks: int, skipped: int, dropped: int) -> Condition | None:
        """What the operator should know; the counts are since the start: ticks made and skipped, drops."""
        moments = self._moments
        moments.append(_Moment(now_s, ticks + skipped, self.late_ticks + skipped, dropped))
        while now_s - moments[0].time_s > _OVER_S or moments[0].time_s > now_s:
            moments.popleft()
        first, last = moments[0], moments[-1]
        late_share = (last.late - first.late) / max(last.ticks - first.ticks, _LEAST_TICKS)
        dropped_now = last.dropped - first.dropped
        troubles = []
        if dropped_now:
            per_s = dropped_now / max(now_s - first.time_s, 1.0)
            troubles.append(f"{max(per_s, 1.0):.0f}/s dropped")
        if late_share >= _LATE_SHARE:
            troubles.append(f"{100.0 * min(late_share, 1.0):.0f} % of ticks late")
        if not troubles:
            return None
        return Condition(
            OVERLOADED,
            mavlink.MAV_SEVERITY_WARNING,
            f"Overloaded: {', '.join(troubles)}",
            "Avoidance keeps up again",
        )
