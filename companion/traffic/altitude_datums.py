"""Heights of different references made comparable: barometer with barometer, satellites with satellites.

Traffic reports its height in the standard atmosphere, above the ellipsoid, or above mean sea level; our own
is known in all three as far as our autopilot tells. A track keeps the height that was reported, compared with
ours at the moment of asking, with the offsets that hold where we are then: two barometers in the same air err
alike, so at our height the comparison is right, whatever our offset was further down.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt

from companion.model import AltitudeReference

# How fast an old height becomes wrong, and in what steps that counts: so that two references heard in turn,
# once a second each, do not take turns as the better one.
_AGEING_MPS = 3.0
_AGE_STEP_S, _UNCERTAINTY_STEP_M = 5.0, 5.0
# Of equally certain ones: as our autopilot gives its own; then barometers, as transponders state satellite
# heights to 45 m or worse (DO-260B, geometric vertical accuracy).
_PREFERENCE = {
    AltitudeReference.SEA_LEVEL: 0,
    AltitudeReference.BAROMETRIC: 1,
    AltitudeReference.GEOMETRIC: 2,
}


@dataclass(frozen=True, slots=True)
class HeightParams:
    """How wrong a height may be when what it should be compared with is not known; each about one sigma."""

    # Without our own pressure, a pressure altitude is taken as height above the sea. A sea-level pressure
    # 8 hPa off the standard's 1013.25 is common weather, and 1 hPa is 8.3 m at low heights.
    pressure_unknown_m: Annotated[float, Ge(0)] = 60.0
    # Our own pressure counts as present for so long, at 1 Hz with losses; then its offset is worth less every
    # second, by what a front brings at worst (3 hPa an hour: 0.007 m/s) and more, as silence means a fault.
    pressure_fresh_s: Annotated[float, Gt(0)] = 5.0
    pressure_stale_mps: Annotated[float, Ge(0)] = 0.5
    # Air 20 K warmer or colder than standard stretches heights by 7 %: what a stale offset is off by for each
    # metre that we have climbed or sunk since.
    pressure_stretch: Annotated[float, Ge(0)] = 0.07
    # The geoid lies between 106 m below and 85 m above the ellipsoid; within 50 m of it over most land.
    geoid_unknown_m: Annotated[float, Ge(0)] = 50.0


class Datum(NamedTuple):
    """What to add to heights of one reference to have them above mean sea level; how wrong that may be."""

    offset_m: float = 0.0
    uncertainty_m: float = 0.0


Datums = Mapping[AltitudeReference, Datum]
_SAME = Datum()
AS_REPORTED: Datums = dict.fromkeys(AltitudeReference, _SAME)


class Height(NamedTuple):
    """A height as estimated at `at_s` in its own reference, worth something until `until_s`.

    `climb_mps` is positive up; `sigma_m` is what its sender states of its accuracy, 0 if nothing.
    """

    reference: AltitudeReference
    altitude_m: float
    at_s: float
    climb_mps: float
    until_s: float
    sigma_m: float


class Compared(NamedTuple):
    """A height above mean sea level (as we have it) now [m], climb positive up, and how wrong it may be."""

    altitude_m: float
    climb_mps: float
    uncertainty_m: float


class OwnHeights:
    """Our own height in all references, and what follows for those of others."""

    def __init__(self, params: HeightParams | None = None) -> None:
        self._params = params or HeightParams()
        self._altitude_m: float | None = None
        self._pressure: Datum | None = None
        self._pressure_s = -math.inf
        self._pressure_at_m = 0.0
        self._geoid = Datum(0.0, self._params.geoid_unknown_m)

    def learn_altitude(self, altitude_m: float) -> None:
        """Our height above mean sea level."""
        self._altitude_m = altitude_m

    def learn_pressure(self, pressure_altitude_m: float, now_s: float) -> None:
        """Our height in the standard atmosphere; it means something beside a height above the sea."""
        if self._altitude_m is not None:
            self._pressure = Datum(self._altitude_m - pressure_altitude_m, 0.0)
            self._pressure_s, self._pressure_at_m = now_s, self._altitude_m

    def learn_separation(self, separation_m: float) -> None:
        """How far the geoid lies above the ellipsoid here; it changes by a metre in ten kilometres or so."""
        self._geoid = Datum(-separation_m, 0.0)

    def datums(self, now_s: float) -> Datums:
        """How to compare heights of each reference with ours."""
        return {
            AltitudeReference.BAROMETRIC: self._barometric(now_s),
            AltitudeReference.GEOMETRIC: self._geoid,
            AltitudeReference.SEA_LEVEL: _SAME,
        }

    def _barometric(self, now_s: float) -> Datum:
        params = self._params
        if self._pressure is None or self._altitude_m is None:
            return Datum(0.0, params.pressure_unknown_m)
        silent_s = now_s - self._pressure_s - params.pressure_fresh_s
        if silent_s <= 0.0:
            return self._pressure
        moved_m = abs(self._altitude_m - self._pressure_at_m)
        grown_m = silent_s * params.pressure_stale_mps + moved_m * params.pressure_stretch
        return Datum(self._pressure.offset_m, min(grown_m, params.pressure_unknown_m))


def compare(heights: Sequence[Height], datums: Datums, now_s: float) -> Compared | None:
    """The height that compares best, flown on to `now_s`; `None` when there is none worth anything."""
    best = heights[0] if len(heights) == 1 else _best(heights, datums, now_s)
    if best is None or now_s > best.until_s:
        return None
    reference, altitude_m, at_s, climb_mps, _, sigma_m = best
    offset_m, uncertainty_m = datums[reference]
    if sigma_m:
        uncertainty_m = math.hypot(uncertainty_m, sigma_m)
    return Compared(altitude_m + climb_mps * (now_s - at_s) + offset_m, climb_mps, uncertainty_m)


def _best(heights: Iterable[Height], datums: Datums, now_s: float) -> Height | None:
    def badness(height: Height) -> tuple[float, int]:
        off_m = math.hypot(datums[height.reference].uncertainty_m, height.sigma_m)
        aged_m = _AGEING_MPS * _AGE_STEP_S * ((now_s - height.at_s) // _AGE_STEP_S)
        return (off_m + aged_m) // _UNCERTAINTY_STEP_M, _PREFERENCE[height.reference]

    return min((height for height in heights if now_s <= height.until_s), key=badness, default=None)
