"""Shadows: targets that repeat our own track, late and displaced.

Radar stations, networks and repeaters report us late and displaced, under addresses of their own. Such a
shadow keeps a constant delay and a constant small offset from us. In straight flight, so does an aircraft
that flies along: an identity that is known to be another's needs more evidence, and must have followed our
turn or our climb. Who comes nearer while we fly straight is no shadow.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame, wrap_pi
from companion.model import Vec2
from companion.traffic.altitudes import SeaLevelAltitude
from companion.traffic.own_aircraft import OwnshipFix, OwnTrail, furthest_echo_m
from companion.traffic.params import EchoParams
from companion.traffic.target import Target

_MOST_SAMPLES, _COMPARED_SAMPLES = 12, 8
_DELAY_STEP_S: Final = 1.0
# How far a position may be from the mean offset, across the path; along it, by the jitter of delays in
# addition.
_RESIDUAL_M, _JITTER_S = 25.0, 0.7
_RESIDUAL_SIGMAS, _LARGEST_RESIDUAL_M = 3.0, 75.0
# The offset drifts by no more than this in the time of the samples, or than so many times its noise.
_DRIFT_M, _DRIFT_SIGMAS = 15.0, 4.0
# The noise of a few positions is unknown: it is estimated with a prior of this, worth so many positions
# (inverse-gamma; Gelman et al., Bayesian Data Analysis, 3rd ed. 2013, 14.2).
_NOISE_M, _PRIOR_POSITIONS = 8.0, 3.0
# A manoeuvre of ours that only a shadow repeats.
_TURNED_RAD, _CLIMBED_M = math.radians(20.0), 30.0
_STRAIGHT_RAD: Final = math.radians(6.0)
# It comes nearer: by more than the noise of averages of so many reports, and at this speed.
_NEARER_M, _CLOSING_MPS, _AVERAGED = 8.0, 0.4, 3
_MOST_STRAIGHT: Final = 20
_LEAST_SPEED_MPS: Final = 5.0
# Full comparisons in a second: a flood around us is traffic, without a look at each.
_COMPARISONS_PER_S: Final = 300.0


class Sample(NamedTuple):
    """A reported position, with the altitude above mean sea level if known."""

    time_s: float
    lat_deg: float
    lon_deg: float
    altitude_m: float | None
    uncertainty_m: float
    velocity_mps: Vec2 | None


class Match(NamedTuple):
    """A constant delay and offset that explain the samples, and whether we manoeuvred meanwhile."""

    delay_s: float
    offset_m: float
    manoeuvred: bool


class _Evidence:
    __slots__ = ("comes_nearer", "is_shadow", "match", "misses", "reports", "samples", "straight")

    def __init__(self) -> None:
        self.samples: deque[Sample] = deque(maxlen=_MOST_SAMPLES)
        # Distances, and stated speeds of approach, while we fly straight.
        self.straight: deque[tuple[float, float | None]] = deque(maxlen=_MOST_STRAIGHT)
        self.comes_nearer = False  # or did once: then it is another's, though it flies along now
        self.reports = 0
        self.misses = 0
        self.is_shadow = False
        self.match: Match | None = None


class Shadows:
    """The targets that repeat our track."""

    def __init__(self, params: EchoParams, trail: OwnTrail) -> None:
        self._params, self._trail = params, trail
        self.evidence: dict[str, _Evidence] = {}  # of targets near us
        self._comparisons_left = _COMPARISONS_PER_S
        self._compared_s = -math.inf

    def remove(self, track_id: str) -> None:
        """Forget a target that is not received any more."""
        self.evidence.pop(track_id, None)

    def comes_nearer(self, track_id: str) -> bool:
        """Whether a target comes nearer while we fly straight: then it is not ours."""
        evidence = self.evidence.get(track_id)
        return evidence is not None and evidence.comes_nearer

    def match_of(self, track_id: str) -> Match | None:
        """The delay and offset of a shadow."""
        evidence = self.evidence.get(track_id)
        return evidence.match if evidence is not None and evidence.is_shadow else None

    def classify(self, target: Target, altitude: SeaLevelAltitude | None, *, known_other: bool) -> bool:
        """Whether a target with a new measurement is a shadow; `known_other`: by its identity it is not."""
        sample = _sample(target, altitude)
        evidence, own = self.evidence.get(target.track_id), self._trail.at(sample.time_s)
        if own is None:
            return evidence is not None and evidence.is_shadow
        distance_m = math.hypot(*_offset_m(own, sample))
        if distance_m > furthest_echo_m(own, self._params):
            self.remove(target.track_id)
            return False
        if evidence is None:
            evidence = self.evidence[target.track_id] = _Evidence()
        if evidence.samples and evidence.samples[-1].time_s == sample.time_s:
            evidence.samples.pop()
        else:
            evidence.reports += 1
        evidence.samples.append(sample)
        comes_nearer = self._comes_nearer(evidence, sample, own, distance_m)
        new = evidence.reports <= self._params.reports
        evidence.comes_nearer |= comes_nearer
        known_other |= evidence.comes_nearer
        was = evidence.is_shadow
        # Who is a shadow already may be further off for a moment.
        residual_m = _residual_m(target) * (self._params.split_factor if was else 1.0)
        match = None if comes_nearer else self._match(evidence.samples, residual_m)
        if match is not None:
            evidence.misses = 0
            evidence.match = match
            evidence.is_shadow = was or self._is_enough(evidence, match, known_other=known_other)
        elif was:
            evidence.misses += 1
            if comes_nearer or known_other or new or evidence.misses >= self._params.split_reports:
                evidence.is_shadow = False
                evidence.samples.clear()
        return evidence.is_shadow

    def _is_enough(self, evidence: _Evidence, match: Match, *, known_other: bool) -> bool:
        """Whether a target that matches is a shadow."""
        samples, params = evidence.samples, self._params
        lasted_s = samples[-1].time_s - samples[0].time_s
        often = len(samples) >= params.reports or lasted_s >= 2.0 * params.after_s
        if known_other:
            return match.manoeuvred and len(samples) >= params.reports and lasted_s >= params.after_s
        if evidence.reports == 1:
            # It appeared beside us with our velocity of then: it does not come nearer.
            return samples[0].velocity_mps is not None
        return len(samples) >= 3 and often and lasted_s >= params.after_s

    def _comes_nearer(self, evidence: _Evidence, sample: Sample, own: OwnshipFix, distance_m: float) -> bool:
        """Whether its distance shrank while we flew straight, and its velocity says so too, if it states one.

        The delay of a network drifts: then the distance shrinks, and the velocity is ours.
        """
        before = self._trail.at(own.time_s - self._params.shadow_delay_s)
        if before is None or abs(wrap_pi(_course_rad(own) - _course_rad(before))) > _STRAIGHT_RAD:
            evidence.straight.clear()
            return False
        closing_mps = None
        if sample.velocity_mps is not None:
            north_m, east_m = _offset_m(own, sample)
            north_mps, east_mps = (
                sample.velocity_mps[0] - own.north_mps,
                sample.velocity_mps[1] - own.east_mps,
            )
            closing_mps = -(north_m * north_mps + east_m * east_mps) / max(distance_m, 1.0)
        evidence.straight.append((distance_m, closing_mps))
        if len(evidence.straight) < 2 * _AVERAGED:
            return False
        distances_m = [one for one, _ in evidence.straight]
        stated_mps = [one for _, one in evidence.straight if one is not None]
        shrunk_m = (sum(distances_m[:_AVERAGED]) - sum(distances_m[-_AVERAGED:])) / _AVERAGED
        if stated_mps and sum(stated_mps) / len(stated_mps) < _CLOSING_MPS:
            return False
        return shrunk_m > (_NEARER_M if stated_mps else 2.0 * _NEARER_M)

    def _match(self, samples: Sequence[Sample], residual_m: float) -> Match | None:
        """The delay and the mean offset that explain all of the last samples; `None` if there are none."""
        newest = samples[-1]
        compared = list(samples)[-_COMPARED_SAMPLES:]
        delays_s = [
            number * _DELAY_STEP_S
            for number in range(int(self._params.shadow_delay_s / _DELAY_STEP_S) + 1)
            if self._fits(newest, number * _DELAY_STEP_S) is not None
        ]
        if not delays_s or not self._may_compare(newest.time_s):
            return None
        found = [match for delay_s in delays_s if (match := self._match_with(compared, delay_s, residual_m))]
        return min(found, key=lambda match: match.offset_m, default=None)

    def _may_compare(self, now_s: float) -> bool:
        elapsed_s = max(now_s - self._compared_s, 0.0)
        self._compared_s = max(now_s, self._compared_s)
        left = min(self._comparisons_left + elapsed_s * _COMPARISONS_PER_S, _COMPARISONS_PER_S)
        self._comparisons_left = max(left - 1.0, 0.0)
        return left >= 1.0

    def _match_with(self, samples: Sequence[Sample], delay_s: float, residual_m: float) -> Match | None:
        offsets: list[Vec2] = []
        owns: list[OwnshipFix] = []
        for sample in samples:
            fitting = self._fits(sample, delay_s)
            if fitting is None:
                return None
            own, offset_m = fitting
            owns.append(own)
            offsets.append(offset_m)
        north_m = sum(offset[0] for offset in offsets) / len(offsets)
        east_m = sum(offset[1] for offset in offsets) / len(offsets)
        mean_m = math.hypot(north_m, east_m)
        if mean_m > self._params.shadow_radius_m or _drifts(samples, offsets):
            return None
        for own, (one_m, other_m) in zip(owns, offsets, strict=True):
            off_north_m, off_east_m = one_m - north_m, other_m - east_m
            speed_mps = math.hypot(own.north_mps, own.east_mps)
            north, east = (own.north_mps, own.east_mps) if speed_mps > 0.1 else (1.0, 0.0)
            length = math.hypot(north, east)
            along_m = (off_north_m * north + off_east_m * east) / length
            across_m = (off_east_m * north - off_north_m * east) / length
            if math.hypot(along_m / (residual_m + _JITTER_S * speed_mps), across_m / residual_m) > 1.0:
                return None
        return Match(delay_s, mean_m, self._manoeuvred(owns))

    def _manoeuvred(self, owns: Sequence[OwnshipFix]) -> bool:
        """Whether we turned or climbed while we were where the samples repeat us."""
        if owns[0].time_s < self._trail.assumed_until_s:
            return False
        first = owns[0]
        turned_rad = max(abs(wrap_pi(_course_rad(own) - _course_rad(first))) for own in owns)
        heights_m = [own.altitude_m for own in owns]
        return turned_rad > _TURNED_RAD or max(heights_m) - min(heights_m) > _CLIMBED_M

    def _change_mps(self, time_s: float) -> float:
        """How much our velocity changed around a time, within a step of the delays."""
        before, after = self._trail.at(time_s - _DELAY_STEP_S), self._trail.at(time_s + _DELAY_STEP_S)
        if before is None or after is None:
            return 0.0
        return 0.5 * math.hypot(after.north_mps - before.north_mps, after.east_mps - before.east_mps)

    def _fits(self, sample: Sample, delay_s: float) -> tuple[OwnshipFix, Vec2] | None:
        """Our position this long before and the offset from it, if velocity and altitude are as ours were."""
        params, own = self._params, self._trail.at(sample.time_s - delay_s)
        if own is None or math.hypot(own.north_mps, own.east_mps) < _LEAST_SPEED_MPS:
            return None
        if sample.velocity_mps is not None:
            off_mps = math.hypot(
                sample.velocity_mps[0] - own.north_mps, sample.velocity_mps[1] - own.east_mps
            )
            # In a turn of ours, a moment makes a difference.
            if off_mps > params.velocity_mps + self._change_mps(own.time_s):
                return None
        height_gate_m = params.vertical_m + sample.uncertainty_m
        if sample.altitude_m is not None and abs(sample.altitude_m - own.altitude_m) > height_gate_m:
            return None
        offset_m = _offset_m(own, sample)
        return (own, offset_m) if math.hypot(*offset_m) <= 2.0 * params.shadow_radius_m else None


def _residual_m(target: Target) -> float:
    """How far a position may be from the mean offset, across the path: more where so much noise is stated."""
    stated_m = target.last.report.position_sigma_m or 0.0
    return min(max(_RESIDUAL_M, _RESIDUAL_SIGMAS * stated_m), _LARGEST_RESIDUAL_M)


def _drifts(samples: Sequence[Sample], offsets: Sequence[Vec2]) -> bool:
    """Whether the offset changes steadily: by more than its noise, from a line through the offsets."""
    count = len(samples)
    if count < 3:
        return False
    middle_s = sum(sample.time_s for sample in samples) / count
    points = [complex(*offset) for offset in offsets]
    mean = sum(points) / count
    times_s = [sample.time_s - middle_s for sample in samples]
    spread = sum(time_s**2 for time_s in times_s)
    slope = sum(time_s * point for time_s, point in zip(times_s, points, strict=True)) / max(spread, 1e-6)
    scatter2 = sum(
        abs(point - mean - slope * time_s) ** 2 for time_s, point in zip(times_s, points, strict=True)
    )
    usual2 = 2.0 * _NOISE_M**2  # of both axes
    noise_m = math.sqrt((_PRIOR_POSITIONS * usual2 + scatter2) / (_PRIOR_POSITIONS + count - 2))
    drift_m = abs(slope) * (times_s[-1] - times_s[0])
    return drift_m > max(_DRIFT_M, _DRIFT_SIGMAS * noise_m)


def _sample(target: Target, altitude: SeaLevelAltitude | None) -> Sample:
    newest = target.last
    return Sample(
        newest.time_s,
        newest.lat_deg,
        newest.lon_deg,
        None if altitude is None else altitude.altitude_m,
        0.0 if altitude is None else altitude.uncertainty_m,
        newest.velocity_mps,
    )


def _offset_m(own: OwnshipFix, sample: Sample) -> Vec2:
    return LocalFrame(own.lat_deg, own.lon_deg).to_north_east_m(sample.lat_deg, sample.lon_deg)


def _course_rad(own: OwnshipFix) -> float:
    return math.atan2(own.east_mps, own.north_mps)
