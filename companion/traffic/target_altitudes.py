"""The altitudes of one target: a filter for each reference that it reports."""

import math
from typing import Final, NamedTuple

from companion.model import AltitudeReference
from companion.traffic.altitude_datums import ReportedAltitude
from companion.traffic.evidence import NOISE_SHARE, StatedRate
from companion.traffic.measurement import DropReason, Measurement
from companion.traffic.params import TrafficParams
from companion.traffic.track_filter import OutlierGate, VerticalFilter, VerticalFix

# Errors of stated climbs below this are of no importance.
_CLIMB_ERROR_MPS: Final = 4.0


class _Vertical(NamedTuple):
    gate: OutlierGate[VerticalFilter, VerticalFix]
    sigma_m: float


class TargetAltitudes:
    """Each reference has its own filter: the difference between two references would look like a climb."""

    __slots__ = ("_climb", "_params", "_stands", "_verticals")

    def __init__(self, params: TrafficParams) -> None:
        self._params = params
        self._climb = StatedRate(NOISE_SHARE * params.estimate.altitude_sigma_m, _CLIMB_ERROR_MPS, 1)
        self._verticals: dict[AltitudeReference, _Vertical] = {}
        self._stands = False

    def explain(self, measurement: Measurement) -> bool:
        """Whether one of the altitudes fits, or there is none to compare with."""
        comparable = False
        for reference, altitude_m, _ in measurement.altitudes:
            known = self._verticals.get(reference)
            if known is None or self._is_outdated(known, measurement.time_s):
                continue
            comparable = True
            if not known.gate.estimate.is_outlier(VerticalFix(measurement.time_s, altitude_m, None)):
                return True
        return not comparable

    def offset_m(self, measurement: Measurement) -> float:
        """How far a measured altitude is from the predicted one; 0 if they are not comparable."""
        for reference, altitude_m, _ in measurement.altitudes:
            known = self._verticals.get(reference)
            if known is not None:
                here = known.gate.estimate
                return abs(altitude_m - here.altitude_m - here.climb_mps * (measurement.time_s - here.time_s))
        return 0.0

    def estimates(self) -> tuple[ReportedAltitude, ...]:
        """The estimate of each reference."""
        return tuple(
            ReportedAltitude(
                reference,
                one.gate.estimate.altitude_m,
                one.gate.estimate.time_s,
                one.gate.estimate.climb_mps,
                self._valid_until_s(one.gate.estimate),
                one.sigma_m,
            )
            for reference, one in self._verticals.items()
        )

    def receive(self, measurement: Measurement, dropped: list[DropReason], *, stands: bool) -> None:
        """Process the altitudes of a report; those of something that `stands` are valid for ever."""
        self._stands = stands
        time_s = measurement.time_s
        valid = [known for known in self._verticals.values() if not self._is_outdated(known, time_s)]
        if not measurement.altitudes and not valid:
            dropped.append(DropReason.NO_ALTITUDE)
        climb_mps = measurement.climb_mps
        for number, (reference, altitude_m, sigma_m) in enumerate(measurement.altitudes):
            if number == 0 and climb_mps is not None:
                trusted = self._climb.trusted
                if not self._climb.receive(time_s, complex(altitude_m), complex(climb_mps), (altitude_m,)):
                    dropped.append(DropReason.CLIMB_WRONG)
                    climb_mps = None
                    if trusted:
                        self._restart_altitude(reference, sigma_m)
                        continue
            self._update(
                reference, VerticalFix(time_s, altitude_m, climb_mps, sigma_m or None), sigma_m, dropped
            )

    def _restart_altitude(self, reference: AltitudeReference, sigma_m: float) -> None:
        """Filter the last altitudes again, without the stated climbs that they contradict."""
        (first_s, first_m), *others = self._climb.places
        estimate = VerticalFilter(VerticalFix(first_s, first_m, None), self._params.estimate)
        for time_s, altitude_m in others:
            estimate.update(VerticalFix(time_s, altitude_m, None))
        self._verticals = {reference: _Vertical(OutlierGate(estimate), sigma_m)}

    def _update(
        self, reference: AltitudeReference, fix: VerticalFix, sigma_m: float, dropped: list[DropReason]
    ) -> None:
        known = self._verticals.get(reference)
        if known is None or self._stands or self._is_outdated(known, fix.time_s):
            gate: OutlierGate[VerticalFilter, VerticalFix]
            gate = OutlierGate(VerticalFilter(fix, self._params.estimate))
            self._verticals[reference] = _Vertical(gate, sigma_m)
            return
        here = known.gate.estimate
        if (
            fix.climb_mps is not None
            and here.is_outlier(fix)
            and not here.is_outlier(fix._replace(climb_mps=None))
        ):
            dropped.append(DropReason.CLIMB_WRONG)
            fix = fix._replace(climb_mps=None)
        if not known.gate.receive(fix):
            dropped.append(DropReason.ALTITUDE_JUMPED)
            return
        self._verticals[reference] = _Vertical(known.gate, sigma_m)

    def _is_outdated(self, known: _Vertical, time_s: float) -> bool:
        return time_s > self._valid_until_s(known.gate.estimate)

    def _valid_until_s(self, here: VerticalFilter) -> float:
        """An altitude is extrapolated for a limited time, unless it is that of an obstacle."""
        return math.inf if self._stands else here.time_s + self._params.altitude_hold_s
