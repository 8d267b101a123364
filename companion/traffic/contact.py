"""All that is received under one key: the hypotheses of its aircraft, and the receivers that report it.

A report belongs to the hypothesis whose prediction it fits in place and altitude (gating), and to the nearest
if several fit (nearest neighbour; Blackman and Popoli, Design and Analysis of Modern Tracking Systems, 1999,
6.3). One that fits none begins another hypothesis, which is a track when a second report confirms it (M of N
initiation, 2 of 3). Where the first falls silent while the other is heard, it has jumped. Where both go on,
the key is reported in two places, and both are tracks.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.traffic.measurement import DropReason, Measurement, RepeatFilter
from companion.traffic.observers import Observer, Observers
from companion.traffic.params import TrafficParams
from companion.traffic.target import CONFIRMED_REPORTS, Target

# A hypothesis that is not confirmed in this time is dropped: three scans of a slow receiver.
_UNCONFIRMED_S: Final = 12.0
# The silence after which a hypothesis has jumped to where the other one is; longer if both were heard by
# turns.
_JUMPED_S, _JUMPED_IN_CONFLICT_S, _JUMPED_INTERVALS = 3.0, 5.0, 4.0
_BOTH_HEARD_S, _BOTH_HEARD_INTERVALS = 10.0, 8.0
_REPLACING_REPORTS: Final = 3
# Two hypotheses are one aircraft when one is silent this near the other, with this difference of velocities.
_SAME_S, _SAME_INTERVALS, _SAME_M, _SAME_MPS = 2.0, 2.5, 250.0, 10.0
# An aircraft that may be near us within this time is a track at its first report.
URGENT_S: Final = 10.0
# Three positions on a line: within this of each other's prediction, and further apart than noise.
_LINE_M, _LINE_SHARE, _LEAST_WAY_M = 90.0, 0.15, 100.0
_LEAST_STEP_S, _LONGEST_STEP_S = 0.3, 12.0
# A late copy is near where the aircraft was by then, and further from it the more it may have turned since.
_COPY_M, _COPY_MPS2, _OLDEST_COPY_S = 100.0, 2.5, 10.0
# A report of one receiver that is this much older than the newest one of another is still used.
_OLDEST_USED_S: Final = 3.0


class Assignment(NamedTuple):
    """The hypothesis that a report updates, what was not used of it, and the hypotheses that ended."""

    target: Target | None
    dropped: list[DropReason]
    removed: list[Target]


class Contact:
    """One key."""

    __slots__ = ("_params", "_recent", "heard_s", "hypotheses", "key", "observers", "repeats")

    def __init__(self, key: str, params: TrafficParams) -> None:
        self.key = key
        self.heard_s = -math.inf
        self.hypotheses: list[Target] = []
        self.observers = Observers()
        self.repeats = RepeatFilter(params.repeat_window_s)
        self._params = params
        self._recent: deque[tuple[Measurement, Target]] = deque(maxlen=2)

    def assign(
        self, measurement: Measurement, observer: Observer, reach_s: Callable[[Measurement], float]
    ) -> Assignment:
        """Update the hypothesis that a measurement fits, or begin one; `reach_s`: how soon it may be near."""
        found = self._nearest(measurement)
        if found is None and self._is_late_copy(measurement, observer):
            return Assignment(None, [DropReason.REORDERED], [])
        if found is None:
            assignment = self._begin(measurement, reach_s)
        else:
            in_order = self._in_order(found, measurement, observer)
            if in_order is None:
                return Assignment(None, [DropReason.REORDERED], [])
            measurement = in_order
            dropped = found.receive(measurement)
            removed = [*self._drop_jumped(found), *self._drop_same(found, measurement)]
            assignment = Assignment(found, dropped, removed)
        if assignment.target is not None:
            self._recent.append((measurement, assignment.target))
        return assignment

    def _nearest(self, measurement: Measurement) -> Target | None:
        hypotheses = self.hypotheses
        if len(hypotheses) == 1:
            return hypotheses[0] if hypotheses[0].explains(measurement) else None
        fitting = [target for target in hypotheses if target.explains(measurement)]
        return min(fitting, key=lambda target: target.distance(measurement), default=None)

    # --- several receivers

    def _in_order(self, target: Target, measurement: Measurement, observer: Observer) -> Measurement | None:
        """The measurement at its true time, or at that of a newer estimate; `None` if it is too old."""
        velocity_mps = target.velocity_mps
        off_m, speed_mps = target.offset_m(measurement), math.hypot(*velocity_mps)
        self.observers.note_offset(observer, off_m, velocity_mps, speed_mps)
        lead_s = self.observers.take_lead_s(observer, measurement.received_s, speed_mps)
        if lead_s > 0.0:
            target.count_as_older(lead_s)
        delay_s = self.observers.delay_s(observer, measurement.received_s, speed_mps)
        if delay_s > 0.0:
            measurement = measurement.valid_at(measurement.time_s - delay_s)
        late_s = target.measured_s - measurement.time_s
        if late_s <= 0.0:
            return measurement
        return target.flown_on(measurement) if late_s <= _OLDEST_USED_S and len(self.observers) > 1 else None

    def _is_late_copy(self, measurement: Measurement, observer: Observer) -> bool:
        """Whether a report is where a hypothesis was some seconds ago, from another receiver than it."""
        if len(self.observers) < 2:
            return False
        for target in self.hypotheses:
            north_mps, east_mps = target.velocity_mps
            speed_mps = math.hypot(north_mps, east_mps)
            if speed_mps < 1.0 or not target.is_confirmed or not target.explains_altitude(measurement):
                continue
            if target.last.observer == measurement.observer:
                continue
            north_m, east_m = target.offset_m(measurement)
            late_s = -(north_m * north_mps + east_m * east_mps) / speed_mps**2
            across_m = abs(east_m * north_mps - north_m * east_mps) / speed_mps
            if 0.0 < late_s <= _OLDEST_COPY_S and across_m <= _COPY_M + _COPY_MPS2 * late_s**2:
                self.observers.note_offset(observer, (north_m, east_m), (north_mps, east_mps), speed_mps)
                return True
        return False

    # --- hypotheses

    def _begin(self, measurement: Measurement, reach_s: Callable[[Measurement], float]) -> Assignment:
        """Begin a hypothesis, or restart one whose positions contradict its stated velocity."""
        first = not self.hypotheses
        if first:
            target = self._new(measurement, 1)
            target.first = True
            return Assignment(target, target.receive(measurement), [])
        reason, reach = DropReason.ALTITUDE_JUMPED, math.inf
        if not any(target.explains_place(measurement) for target in self.hypotheses):
            restarted = self._restart_on_line(measurement)
            if restarted is not None:
                return restarted
            reason, reach = DropReason.JUMPED, reach_s(measurement)
        removed = self._make_room(measurement, reach)
        if removed is None:
            return Assignment(None, [reason], [])
        taken = {target.number for target in self.hypotheses}
        number = next(number for number in range(1, len(taken) + 2) if number not in taken)
        target = self._new(measurement._replace(urgent=reach < URGENT_S), number)
        target.reach_s = reach
        target.receive(measurement)
        return Assignment(target, [reason], removed)

    def _new(self, measurement: Measurement, number: int) -> Target:
        target = Target(measurement, self.key, number, self._params)
        self.hypotheses.append(target)
        return target

    def _make_room(self, measurement: Measurement, reach_s: float) -> list[Target] | None:
        """Drop what was never confirmed, and the least urgent of too many; `None`: that is the new one."""
        now_s = measurement.time_s
        removed = [
            one for one in self.hypotheses if not one.shown and now_s - one.measured_s > _UNCONFIRMED_S
        ]
        self._remove(removed)
        if len(self.hypotheses) < self._params.hypotheses:
            return removed
        candidates = [one for one in self.hypotheses if not one.threat]
        least = max(candidates, key=lambda one: (one.reach_s, -one.measured_s), default=None)
        if least is None or (least.shown and least.reach_s < reach_s and not least.is_silent(now_s)):
            return None
        self._remove([least])
        return [*removed, least]

    def _drop_jumped(self, heard: Target) -> list[Target]:
        """Drop hypotheses that are silent, while this one is heard regularly in their place."""
        if len(self.hypotheses) == 1:
            return []
        now_s = heard.measured_s
        removed = []
        for other in self.hypotheses:
            if other is heard:
                continue
            if not other.shown:
                ended = now_s - other.measured_s > _UNCONFIRMED_S
            elif heard.reports < _REPLACING_REPORTS:
                ended = False
            elif not other.is_confirmed or other.measured_s < heard.born_s:
                least_s = _JUMPED_IN_CONFLICT_S if other.threat else _JUMPED_S
                ended = other.is_silent(now_s, _JUMPED_INTERVALS, least_s)
            else:
                # Two aircraft: a conflict with one of them is coasted.
                ended = not other.threat and other.is_silent(now_s, _BOTH_HEARD_INTERVALS, _BOTH_HEARD_S)
            if ended:
                removed.append(other)
        if removed:
            self._remove(removed)
            heard.first |= not any(one.first for one in self.hypotheses)
        return removed

    def _drop_same(self, heard: Target, measurement: Measurement) -> list[Target]:
        """Drop hypotheses that are silent beside this one, with its motion: they are the same aircraft.

        So ends what a burst begins: reports that waited somewhere, and arrive at once with the same time.
        """
        if len(self.hypotheses) == 1 or heard.reports < _REPLACING_REPORTS:
            return []
        removed = []
        for other in self.hypotheses:
            if other is heard or not other.is_silent(measurement.time_s, _SAME_INTERVALS, _SAME_S):
                continue
            beside_m = math.dist(other.offset_m(measurement), heard.offset_m(measurement))
            apart_mps = math.dist(other.velocity_mps, heard.velocity_mps)
            if beside_m <= _SAME_M and apart_mps <= _SAME_MPS and other.explains_altitude(measurement):
                removed.append(other)
        if removed:
            self._remove(removed)
            heard.first |= not any(one.first for one in self.hypotheses)
        return removed

    def _remove(self, removed: list[Target]) -> None:
        self.hypotheses = [one for one in self.hypotheses if one not in removed]

    def _restart_on_line(self, measurement: Measurement) -> Assignment | None:
        """The hypothesis of the last three positions, if they are on a line that no velocity explains."""
        measurements = [recent for recent, _ in self._recent] + [measurement]
        if len(measurements) < 3 or not _on_line(measurements, self._params.estimate.max_speed_mps):
            return None
        involved = [one for one in self.hypotheses if any(one is target for _, target in self._recent)]
        if not involved:
            return None
        keeper = min(involved, key=lambda one: one.number)
        keeper.restart(measurements)
        removed = [one for one in involved if one is not keeper and one.reports < CONFIRMED_REPORTS]
        self._remove(removed)
        return Assignment(keeper, [DropReason.VELOCITY_WRONG], removed)


def _on_line(measurements: list[Measurement], max_speed_mps: float) -> bool:
    """Whether three positions are those of one straight flight at one speed."""
    first, second, third = measurements
    before_s, after_s = second.time_s - first.time_s, third.time_s - second.time_s
    if not (_LEAST_STEP_S <= before_s <= _LONGEST_STEP_S and _LEAST_STEP_S <= after_s <= _LONGEST_STEP_S):
        return False
    frame = LocalFrame(second.lat_deg, second.lon_deg)
    north_m, east_m = frame.to_north_east_m(first.lat_deg, first.lon_deg)
    further_north_m, further_east_m = frame.to_north_east_m(third.lat_deg, third.lon_deg)
    share = after_s / before_s
    way_m = math.hypot(further_north_m - north_m, further_east_m - east_m)
    off_m = math.hypot(further_north_m + north_m * share, further_east_m + east_m * share)
    if not _LEAST_WAY_M < way_m < max_speed_mps * (before_s + after_s):
        return False
    return off_m < _LINE_M + _LINE_SHARE * way_m
