"""Altitudes: those of a target as it reports them, and their datums, so that they can be compared with ours.

Traffic reports its altitude in the standard atmosphere, above the ellipsoid, or above mean sea level; our own
altitude is known in each of them as far as our autopilot reports it. A target keeps its altitude as reported.
It is converted only when it is compared with ours, with the offsets at our present position and altitude: two
barometers in the same air have the same error, so at our altitude the comparison is exact, even if our own
offset was different further down.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from companion.model import AltitudeReference
from companion.traffic.measurement import NOISE_SHARE, DropReason, Measurement, StatedRate
from companion.traffic.params import HeightParams, TrafficParams
from companion.traffic.track_filter import OutlierGate, VerticalFilter, VerticalFix

# Error that an old altitude gains, and the steps in which age and error count. The steps keep the selection
# constant when two references are received alternately, once a second each.
_AGEING_MPS = 3.0
_AGE_STEP_S, _UNCERTAINTY_STEP_M = 5.0, 5.0
# The error of an altitude that is not reported any more grows by this, up to this.
_COASTED_MPS, _COASTED_M = 1.0, 60.0
# Order among equally certain references: first the one in which our autopilot states our own altitude, then
# barometers, because transponders state satellite altitudes to 45 m or worse (DO-260B, geometric vertical
# accuracy).
_PREFERENCE = {
    AltitudeReference.SEA_LEVEL: 0,
    AltitudeReference.BAROMETRIC: 1,
    AltitudeReference.GEOMETRIC: 2,
}


class DatumOffset(NamedTuple):
    """Offset to add to altitudes of one reference for altitudes above mean sea level, and its error [m]."""

    offset_m: float = 0.0
    uncertainty_m: float = 0.0


DatumOffsets = Mapping[AltitudeReference, DatumOffset]
_NO_OFFSET = DatumOffset()
AS_REPORTED: DatumOffsets = dict.fromkeys(AltitudeReference, _NO_OFFSET)


class ReportedAltitude(NamedTuple):
    """An altitude in its own reference, estimated for `time_s`, not used after `valid_until_s`.

    `climb_mps` is positive up; `sigma_m` is the accuracy stated by the sender, 0 if none.
    """

    reference: AltitudeReference
    altitude_m: float
    time_s: float
    climb_mps: float
    valid_until_s: float
    sigma_m: float


class SeaLevelAltitude(NamedTuple):
    """An altitude above mean sea level [m] with its climb (positive up) and its error relative to ours."""

    altitude_m: float
    climb_mps: float
    uncertainty_m: float


class OwnshipAltitudes:
    """Our own altitude in each reference, and the offsets between the references that follow from it."""

    def __init__(self, params: HeightParams | None = None) -> None:
        self._params = params or HeightParams()
        self._altitude_m: float | None = None
        self._pressure: DatumOffset | None = None
        self._pressure_s = -math.inf
        self._pressure_at_m = 0.0
        self._geoid = DatumOffset(0.0, self._params.geoid_unknown_m)

    def observe_altitude(self, altitude_m: float) -> None:
        """Store our altitude above mean sea level."""
        self._altitude_m = altitude_m

    def observe_pressure_altitude(self, pressure_altitude_m: float, now_s: float) -> None:
        """Store our altitude in the standard atmosphere; ignored while that above the sea is unknown."""
        if self._altitude_m is not None:
            self._pressure = DatumOffset(self._altitude_m - pressure_altitude_m, 0.0)
            self._pressure_s, self._pressure_at_m = now_s, self._altitude_m

    def observe_geoid_separation(self, separation_m: float) -> None:
        """Store the height of the geoid above the ellipsoid here; it varies by about a metre in 10 km."""
        self._geoid = DatumOffset(-separation_m, 0.0)

    def offsets(self, now_s: float) -> DatumOffsets:
        """The offset of each reference from mean sea level."""
        return {
            AltitudeReference.BAROMETRIC: self._barometric(now_s),
            AltitudeReference.GEOMETRIC: self._geoid,
            AltitudeReference.SEA_LEVEL: _NO_OFFSET,
        }

    def _barometric(self, now_s: float) -> DatumOffset:
        params = self._params
        if self._pressure is None or self._altitude_m is None:
            return DatumOffset(0.0, params.pressure_unknown_m)
        stale_s = now_s - self._pressure_s - params.pressure_fresh_s
        if stale_s <= 0.0:
            return self._pressure
        climbed_m = abs(self._altitude_m - self._pressure_at_m)
        error_m = stale_s * params.pressure_stale_mps + climbed_m * params.pressure_stretch
        return DatumOffset(self._pressure.offset_m, min(error_m, params.pressure_unknown_m))


def to_sea_level(
    altitudes: Sequence[ReportedAltitude], offsets: DatumOffsets, now_s: float, *, coast: bool = False
) -> SeaLevelAltitude | None:
    """The most certain of the altitudes, extrapolated to `now_s`; `None` if none is valid any more.

    With `coast` the newest of those that are not valid any more is used: it climbs until then, and its error
    grows after that.
    """
    best = altitudes[0] if len(altitudes) == 1 else _most_certain(altitudes, offsets, now_s)
    if best is None or now_s > best.valid_until_s:
        return _coasted(altitudes, offsets, now_s) if coast and altitudes else None
    reference, altitude_m, time_s, climb_mps, _, sigma_m = best
    offset_m, uncertainty_m = offsets[reference]
    if sigma_m:
        uncertainty_m = math.hypot(uncertainty_m, sigma_m)
    return SeaLevelAltitude(altitude_m + climb_mps * (now_s - time_s) + offset_m, climb_mps, uncertainty_m)


def _coasted(altitudes: Sequence[ReportedAltitude], offsets: DatumOffsets, now_s: float) -> SeaLevelAltitude:
    newest = max(altitudes, key=lambda altitude: altitude.time_s)
    offset_m, uncertainty_m = offsets[newest.reference]
    climbed_m = newest.climb_mps * (newest.valid_until_s - newest.time_s)
    grown_m = min(_COASTED_MPS * (now_s - newest.valid_until_s), _COASTED_M)
    return SeaLevelAltitude(
        newest.altitude_m + climbed_m + offset_m, 0.0, math.hypot(uncertainty_m, newest.sigma_m) + grown_m
    )


def _most_certain(
    altitudes: Iterable[ReportedAltitude], offsets: DatumOffsets, now_s: float
) -> ReportedAltitude | None:
    def uncertainty(altitude: ReportedAltitude) -> tuple[float, int]:
        error_m = math.hypot(offsets[altitude.reference].uncertainty_m, altitude.sigma_m)
        aged_m = _AGEING_MPS * _AGE_STEP_S * ((now_s - altitude.time_s) // _AGE_STEP_S)
        return (error_m + aged_m) // _UNCERTAINTY_STEP_M, _PREFERENCE[altitude.reference]

    valid = (altitude for altitude in altitudes if now_s <= altitude.valid_until_s)
    return min(valid, key=uncertainty, default=None)


# Errors of stated climbs below this are of no importance.
_CLIMB_ERROR_MPS: Final = 4.0


class _Vertical(NamedTuple):
    gate: OutlierGate[VerticalFilter, VerticalFix]
    sigma_m: float


class TargetAltitudes:
    """Each reference has its own filter: the difference between two references would look like a climb."""

    __slots__ = ("_climbs", "_params", "_stands", "_verticals")

    def __init__(self, params: TrafficParams) -> None:
        self._params = params
        self._climbs: dict[AltitudeReference, StatedRate] = {}
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

    def flown_on(
        self, measurement: Measurement, late_s: float
    ) -> tuple[tuple[AltitudeReference, float, float], ...]:
        """The altitudes of a measurement from `late_s` before, climbed on as estimated."""
        flown = []
        for reference, altitude_m, sigma_m in measurement.altitudes:
            known = self._verticals.get(reference)
            climb_mps = measurement.climb_mps if known is None else known.gate.estimate.climb_mps
            flown.append((reference, altitude_m + (climb_mps or 0.0) * late_s, sigma_m))
        return tuple(flown)

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
                climb = self._climb_in(reference)
                trusted = climb.trusted
                if not climb.receive(time_s, complex(altitude_m), complex(climb_mps), (altitude_m,)):
                    dropped.append(DropReason.CLIMB_WRONG)
                    climb_mps = None
                    if trusted:
                        self._restart_altitude(reference, sigma_m)
                        continue
            fix = VerticalFix(time_s, altitude_m, climb_mps, sigma_m or None, measurement.late_s)
            self._update(reference, fix, sigma_m, dropped)
        if climb_mps is not None and len(self._verticals) > len(measurement.altitudes):
            self._share_climb(measurement, climb_mps)

    def _climb_in(self, reference: AltitudeReference) -> StatedRate:
        """What is known of stated climbs, compared with altitudes in one reference."""
        climb = self._climbs.get(reference)
        if climb is None:
            noise_m = NOISE_SHARE * self._params.estimate.altitude_sigma_m
            climb = self._climbs[reference] = StatedRate(noise_m, _CLIMB_ERROR_MPS, 1)
        return climb

    def _share_climb(self, measurement: Measurement, climb_mps: float) -> None:
        """Use a stated climb in the other references, too: they differ by an offset."""
        used = {reference for reference, _, _ in measurement.altitudes}
        for reference, known in self._verticals.items():
            if reference not in used:
                fix = VerticalFix(measurement.time_s, 0.0, climb_mps, late_s=measurement.late_s)
                known.gate.estimate.observe_climb(fix)

    def _restart_altitude(self, reference: AltitudeReference, sigma_m: float) -> None:
        """Filter the last altitudes again, without the stated climbs that they contradict."""
        (first_s, first_m), *others = self._climbs[reference].places
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
