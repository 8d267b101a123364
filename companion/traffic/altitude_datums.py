"""Altitude datums: converts altitudes of different references, so that they can be compared with ours.

Traffic reports its altitude in the standard atmosphere, above the ellipsoid, or above mean sea level; our own
altitude is known in each of them as far as our autopilot reports it. A target keeps its altitude as reported.
It is converted only when it is compared with ours, with the offsets at our present position and altitude: two
barometers in the same air have the same error, so at our altitude the comparison is exact, even if our own
offset was different further down.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt

from companion.model import AltitudeReference

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


@dataclass(frozen=True, slots=True)
class HeightParams:
    """Error of an altitude (one sigma) whose offset from mean sea level is unknown or old."""

    # While our own pressure altitude is unknown, a pressure altitude is taken as height above the sea. The
    # pressure at sea level is often 8 hPa off the standard's 1013.25, and 1 hPa is 8.3 m at low altitude.
    pressure_unknown_m: Annotated[float, Ge(0)] = 60.0
    # Our own pressure altitude counts as current for this time: 1 Hz with losses. After that its error grows,
    # faster than with a passing front (3 hPa an hour: 0.007 m/s), because silence indicates a fault.
    pressure_fresh_s: Annotated[float, Gt(0)] = 5.0
    pressure_stale_mps: Annotated[float, Ge(0)] = 0.5
    # Air 20 K warmer or colder than standard stretches altitudes by 7 %: the error of an old offset for each
    # metre that we have climbed or descended since.
    pressure_stretch: Annotated[float, Ge(0)] = 0.07
    # The geoid lies between 106 m below and 85 m above the ellipsoid; within 50 m of it over most land.
    geoid_unknown_m: Annotated[float, Ge(0)] = 50.0


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
