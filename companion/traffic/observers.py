"""The receivers that report one aircraft, and how late each is.

Two receivers of one aircraft are two observers of one target. The reports of an observer that is late,
without saying so, count as older by its delay: otherwise the track would jump back and forth between the two.
This is sensor registration: Bar-Shalom, Willett and Tian, "Tracking and Data Fusion" (2011), 4.9, with the
delay as the bias. Only differences between observers show; as none is early, the least late one is right.
"""

import math
from collections import Counter
from typing import Final

from companion.model import Vec2

# An observer is heard regularly: at least every so often, or within so many of its usual intervals.
_SILENT_S, _SILENT_INTERVALS = 3.0, 3.0
_MOST_OBSERVERS: Final = 8
# A stated time that advances by less than this share of the time that has passed is not the time of a
# position that changes; after so many such reports in a row the ages of that observer are not used.
_ADVANCES_SHARE: Final = 0.2
_STUCK_REPORTS, _ADVANCING_REPORTS = 2, 5
_LEAST_INTERVAL_S: Final = 0.3
# Delays: averaged over so many reports, known after so many, and of importance from so many standard errors.
_AVERAGED_REPORTS, _LEAST_REPORTS, _SIGNIFICANT = 20.0, 3, 3.0
# The scatter of a delay before it is known [s], which counts as so many reports.
_SCATTER_S, _PRIOR_REPORTS = 0.5, 4.0
_MOST_DELAY_S: Final = 10.0
# The track is not moved to the time of an observer that is less ahead of it.
_LEAST_LEAD_S, _LEAST_LEAD_M = 0.5, 30.0
_LEAST_SPEED_MPS: Final = 10.0
# A source is named for this time.
_NAMED_S: Final = 10.0


class Observer:
    """One receiver of the aircraft with this key."""

    __slots__ = (
        "_advancing",
        "_scatter_s2",
        "_stated_s",
        "_stuck",
        "ages_credible",
        "delay_s",
        "interval_s",
        "offsets",
        "received_s",
        "reports",
    )

    def __init__(self) -> None:
        self.received_s = -1e9
        self.interval_s = 1.0
        self.reports = 0
        self.delay_s = 0.0  # relative to the track
        self.offsets = 0  # that were averaged
        self._scatter_s2 = _SCATTER_S**2
        self.ages_credible = True
        self._stated_s = -1e9
        self._stuck = 0
        self._advancing = 0

    def time_of(self, stated_s: float, received_s: float) -> float:
        """The time of a position that differs from the last: as stated, or of the reception."""
        passed_s = received_s - self.received_s
        if self.reports and passed_s >= _LEAST_INTERVAL_S:
            if stated_s - self._stated_s < _ADVANCES_SHARE * passed_s:
                self._stuck, self._advancing = self._stuck + 1, 0
            else:
                self._stuck, self._advancing = 0, self._advancing + 1
            if self._stuck >= _STUCK_REPORTS:
                self.ages_credible = False
            elif self._advancing >= _ADVANCING_REPORTS:
                self.ages_credible = True
        if passed_s >= _LEAST_INTERVAL_S or not self.reports:
            if self.reports and passed_s < 30.0:
                self.interval_s += (passed_s - self.interval_s) / 4.0
            self._stated_s = stated_s
            self.received_s = received_s
        self.reports += 1
        return stated_s if self.ages_credible else received_s

    def is_heard(self, now_s: float) -> bool:
        """Whether it is not silent."""
        return now_s - self.received_s <= max(_SILENT_S, _SILENT_INTERVALS * self.interval_s)

    @property
    def error_s(self) -> float:
        """The standard error of the delay."""
        share = 1.0 / min(max(self.offsets, 1), _AVERAGED_REPORTS)
        return math.sqrt(self._scatter_s2 * share / (2.0 - share))

    def note_offset(self, behind_m: float, speed_mps: float) -> None:
        """Average how far behind the track its position is, along the path."""
        self.offsets += 1
        averaged = min(self.offsets, _AVERAGED_REPORTS)
        off_s = min(max(behind_m / speed_mps, -_MOST_DELAY_S), _MOST_DELAY_S) - self.delay_s
        self.delay_s += off_s / averaged
        new_s2 = (1.0 - 1.0 / averaged) * off_s * off_s
        self._scatter_s2 += (new_s2 - self._scatter_s2) / (averaged + _PRIOR_REPORTS)


class Observers:
    """The observers of one key, by name and sender."""

    __slots__ = ("_by_name",)

    def __init__(self) -> None:
        self._by_name: dict[tuple[str, str], Observer] = {}

    def __len__(self) -> int:
        return len(self._by_name)

    def named(self, name: tuple[str, str]) -> Observer:
        """The observer with this name; the longest silence is forgotten if there are too many."""
        observer = self._by_name.get(name)
        if observer is None:
            if len(self._by_name) >= _MOST_OBSERVERS:
                del self._by_name[min(self._by_name, key=lambda other: self._by_name[other].received_s)]
            for other in self._by_name.values():
                other.offsets = 0  # averages over the same time have the error of the track in common
            observer = self._by_name[name] = Observer()
        return observer

    def delay_s(self, observer: Observer, now_s: float, speed_mps: float) -> float:
        """How much older than stated a report of this observer is, relative to those that are not late."""
        if len(self._by_name) < 2 or observer.offsets < _LEAST_REPORTS or speed_mps < _LEAST_SPEED_MPS:
            return 0.0
        best = self._best(observer, now_s)
        late_s = observer.delay_s - best.delay_s
        return late_s if late_s > _SIGNIFICANT * math.hypot(observer.error_s, best.error_s) else 0.0

    def take_lead_s(self, observer: Observer, now_s: float, speed_mps: float) -> float:
        """How late the track is, if the least late observer is so far ahead; from then on it is not."""
        if len(self._by_name) < 2 or observer.offsets < _LEAST_REPORTS or speed_mps < _LEAST_SPEED_MPS:
            return 0.0
        lead_s = -observer.delay_s
        least_s = max(_LEAST_LEAD_S, _LEAST_LEAD_M / speed_mps, _SIGNIFICANT * observer.error_s)
        if lead_s <= least_s or self._best(observer, now_s) is not observer:
            return 0.0
        for other in self._by_name.values():
            other.delay_s += lead_s
        return lead_s

    def _best(self, observer: Observer, now_s: float) -> Observer:
        """The least late of those that are heard; a coarse one is not the least late by chance."""
        known = [
            other
            for other in self._by_name.values()
            if other is observer or (other.is_heard(now_s) and other.offsets >= _LEAST_REPORTS)
        ]
        return min(known, key=lambda other: other.delay_s + _SIGNIFICANT * other.error_s)

    def note_offset(self, observer: Observer, off_m: Vec2, velocity_mps: Vec2, speed_mps: float) -> None:
        """Learn the delay of an observer from a position relative to the track's."""
        if len(self._by_name) > 1 and speed_mps >= _LEAST_SPEED_MPS:
            along_m = (off_m[0] * velocity_mps[0] + off_m[1] * velocity_mps[1]) / speed_mps
            observer.note_offset(-along_m, speed_mps)

    def names(self, now_s: float) -> tuple[str, ...]:
        """Who was heard in the last seconds, in alphabetical order; in a silence, who was heard last.

        Of several that send the same kind of report, the sender is named, too.
        """
        if len(self._by_name) == 1:
            return tuple(name for name, _ in self._by_name)
        newest_s = max((other.received_s for other in self._by_name.values()), default=now_s)
        since_s = min(now_s, newest_s) - _NAMED_S
        heard = [each for each, other in self._by_name.items() if other.received_s >= since_s]
        counts = Counter(name for name, _ in heard)
        return tuple(sorted(name if counts[name] == 1 else f"{name} {sender}" for name, sender in heard))
