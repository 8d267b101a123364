"""What was seen of one aircraft over a flight: when, by which sources, how near, and how it ended."""

import math
from typing import Final, NamedTuple

from companion.model import TrackState

# An aircraft that is no track for this long at the end is lost.
_LOST_AFTER_S: Final = 1.0
# A shorter pause of a source does not divide its time.
_PAUSE_S: Final = 5.0
_MOST_SOURCES: Final = 16
NOT_HEARD: Final = "not heard"


class Evidence(NamedTuple):
    """A track at one moment. `state` is `None` and `reports` 0 in records of former versions."""

    state: str | None
    sources: tuple[str, ...]
    age_s: float
    slant_m: float
    position_sigma_m: float | None = None
    reports: int = 0


class Sighting:
    """One aircraft. `spans_s` has the times by source from first to last, and those it was coasted."""

    def __init__(self) -> None:
        self.state: str | None = None
        self.reports = 0
        self.first_heard_s, self.last_heard_s = math.inf, -math.inf
        self.closest_m, self.closest_s = math.inf, 0.0
        self.least_sigma_m: float | None = None
        self.spans_s: dict[str, list[tuple[float, float]]] = {}
        self._seen_s = -math.inf

    def note(self, at_s: float, evidence: Evidence) -> None:
        """Take in the track at a time; times never run backwards."""
        self._seen_s = at_s
        self.state, self.reports = evidence.state, max(self.reports, evidence.reports)
        heard_s = at_s - evidence.age_s
        self.first_heard_s = min(self.first_heard_s, heard_s)
        self.last_heard_s = max(self.last_heard_s, heard_s)
        if evidence.slant_m < self.closest_m:
            self.closest_m, self.closest_s = evidence.slant_m, at_s
        sigma_m = evidence.position_sigma_m
        if sigma_m is not None and (self.least_sigma_m is None or sigma_m < self.least_sigma_m):
            self.least_sigma_m = sigma_m
        if evidence.state == TrackState.COASTED:
            self._extend(NOT_HEARD, at_s)
        else:
            for source in evidence.sources:
                self._extend(source, at_s)

    @property
    def sources(self) -> tuple[str, ...]:
        """All sources that reported it, in alphabetical order."""
        return tuple(sorted(source for source in self.spans_s if source != NOT_HEARD))

    def state_at(self, end_s: float) -> str | None:
        """Its state at the end of the flight; `None` if states are not known."""
        if self.state is None:
            return None
        return TrackState.LOST.value if end_s - self._seen_s > _LOST_AFTER_S else self.state

    def coasted_s(self) -> float:
        """The seconds for which it was extrapolated."""
        return sum(end_s - begin_s for begin_s, end_s in self.spans_s.get(NOT_HEARD, ()))

    def _extend(self, source: str, at_s: float) -> None:
        spans_s = self.spans_s.get(source)
        if spans_s is None:
            if len(self.spans_s) <= _MOST_SOURCES:
                self.spans_s[source] = [(at_s, at_s)]
        elif at_s - spans_s[-1][1] <= _PAUSE_S:
            spans_s[-1] = spans_s[-1][0], at_s
        else:
            spans_s.append((at_s, at_s))
