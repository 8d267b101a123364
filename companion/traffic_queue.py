"""Frames of traffic that wait for their turn, while more arrive than can be processed.

Everything about our own aircraft is processed at once, whatever traffic arrives: in each tick a limited time
is spent on traffic. Beyond a part of it only the reports of threats, and of known aircraft that may be near
us soon, are processed at once. The others wait, by their urgency, and are processed after the next tick as
far as time allows. What had to wait for too long was dropped.
"""

import time
from collections.abc import Callable
from typing import Final, NamedTuple

from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import Fact
from companion.mavlink.framing import Frame
from companion.mavlink.translate import frame_to_fact
from companion.traffic import Urgency

# Of the 100 ms between two ticks: for traffic as it comes, and for what comes first.
_USUAL_S, _URGENT_S = 0.012, 0.025
_MOST_WAITING: Final = 1000
_LONGEST_US: Final = 1_000_000
_TRAFFIC: Final = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ADSB_VEHICLE,
        mavlink.MAVLINK_MSG_ID_UTM_GLOBAL_POSITION,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION,
        mavlink.MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK,
    }
)

UrgencyOf = Callable[[Fact, float], Urgency | None]


class _Waiting(NamedTuple):
    frame: Frame
    arrived_us: int


class TrafficQueue:
    """Decides which frames wait. `dropped` counts those that are never processed."""

    def __init__(self, urgency_of: UrgencyOf, clock_s: Callable[[], float] = time.perf_counter) -> None:
        """`urgency_of(fact, now_s)` is `None` for what must not wait; `clock_s` measures the time spent."""
        self.dropped = 0
        self._urgency_of, self._clock_s = urgency_of, clock_s
        self._spent_s = 0.0
        self._waiting: tuple[dict[object, _Waiting], ...] = tuple({} for _ in Urgency)
        self._count = 0

    def process(self, frame: Frame, act: Callable[[Frame], None]) -> None:
        """Process a frame by `act`; the time counts if it is about traffic."""
        if frame.message_id not in _TRAFFIC:
            act(frame)
            return
        begun_s = self._clock_s()
        act(frame)
        self._spent_s += self._clock_s() - begun_s

    def takes(self, frame: Frame, now_us: int) -> bool:
        """Take a frame that must wait; false for one that is to be processed now."""
        if self._spent_s < _USUAL_S or frame.message_id not in _TRAFFIC:
            return False
        fact = frame_to_fact(frame, now_us / 1e6)
        urgency = None if fact is None else self._urgency_of(fact, now_us / 1e6)
        if fact is None or urgency is None:
            return False
        if urgency <= Urgency.NEAR_AGAIN and self._spent_s < _URGENT_S:
            return False
        report = getattr(fact, "report", None)
        self._put(urgency, (fact.sender, getattr(report, "key", None)), _Waiting(frame, now_us))
        return True

    def begin(self, now_us: int) -> None:
        """A tick was made: begin the next interval, and forget what waited for too long."""
        self._spent_s = 0.0
        for of_urgency in self._waiting if self._count else ():
            while of_urgency:
                key = next(iter(of_urgency))
                if now_us - of_urgency[key].arrived_us <= _LONGEST_US:
                    break
                self._drop(of_urgency, key)

    def next(self) -> Frame | None:
        """The most urgent frame that waits, the oldest first; `None` if there is none, or no time left."""
        if not self._count or self._spent_s >= _USUAL_S:
            return None
        of_urgency = next(one for one in self._waiting if one)
        self._count -= 1
        return of_urgency.pop(next(iter(of_urgency))).frame

    def _put(self, urgency: Urgency, key: object, waiting: _Waiting) -> None:
        of_urgency = self._waiting[urgency]
        if key in of_urgency:
            self._drop(of_urgency, key)  # a newer report of the same aircraft
        of_urgency[key] = waiting
        self._count += 1
        if self._count > _MOST_WAITING:
            least = next(one for one in reversed(self._waiting) if one)
            self._drop(least, next(iter(least)))

    def _drop(self, of_urgency: dict[object, _Waiting], key: object) -> None:
        del of_urgency[key]
        self._count -= 1
        self.dropped += 1
