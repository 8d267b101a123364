"""What is known of one aircraft from its messages, of which each says a part, and its traffic report."""

import math
from dataclasses import dataclass, field
from typing import Final

from companion.model import AltitudeReference, LatLon, TrafficKind, TrafficReport, TrafficSource
from companion.sources.adsb_accuracy import StatedAccuracy
from companion.sources.cpr import CprPositions

# Position and velocity are sent twice a second each: older ones are not of the same moment.
_JOINED_S: Final = 3.0
# The difference of the two altitudes changes with the weather and the height.
_DIFFERENCE_S: Final = 30.0
# An aircraft without a position for this long is one of which only the altitude is known.
_NO_POSITION_S: Final = 10.0
_ALTITUDE_INTERVAL_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Altitudes:
    """The altitude in one message [m]: barometric or above the ellipsoid."""

    barometric_m: float | None = None
    geometric_m: float | None = None


@dataclass(slots=True)
class AdsbState:
    """The parts that were received, with the times of those that change quickly."""

    positions: CprPositions = field(default_factory=CprPositions)
    stated: StatedAccuracy = field(default_factory=StatedAccuracy)
    callsign: str | None = None
    squawk: int | None = None
    kind: TrafficKind = TrafficKind.AIRCRAFT
    speed_mps: float | None = None
    course_rad: float | None = None
    velocity_s: float = -math.inf
    climb_mps: float | None = None
    climb_s: float = -math.inf
    geometric_minus_barometric_m: float | None = None
    difference_s: float = -math.inf
    position_s: float = -math.inf
    altitude_s: float = -math.inf

    def take_velocity(self, now_s: float, speed_mps: float | None, course_rad: float | None) -> None:
        """Note a velocity over ground; `None` if it is not known any more."""
        self.speed_mps, self.course_rad, self.velocity_s = speed_mps, course_rad, now_s

    def take_climb(self, now_s: float, climb_mps: float | None) -> None:
        """Note a rate of climb."""
        self.climb_mps, self.climb_s = climb_mps, now_s

    def take_difference(self, now_s: float, geometric_minus_barometric_m: float | None) -> None:
        """Note the difference of the two altitudes; a message without it changes nothing."""
        if geometric_minus_barometric_m is not None:
            self.geometric_minus_barometric_m = geometric_minus_barometric_m
            self.difference_s = now_s

    def is_altitude_due(self, now_s: float) -> bool:
        """Whether an altitude is worth a report: no position a moment ago, and no such report."""
        return now_s - self.position_s > _NO_POSITION_S and now_s - self.altitude_s >= _ALTITUDE_INTERVAL_S

    def position_report(
        self, source: TrafficSource, now_s: float, place: LatLon, altitudes: Altitudes, *, airborne: bool
    ) -> TrafficReport:
        """A report of a position, with what is true of the same moment."""
        self.position_s = now_s
        # The velocity of one of two aircraft with the same address may be that of the other.
        is_joined = now_s - self.velocity_s <= _JOINED_S and not self.positions.is_shared(now_s)
        is_barometric = altitudes.barometric_m is not None
        return TrafficReport(
            source=source,
            key="",
            time_s=now_s,
            lat_deg=place[0],
            lon_deg=place[1],
            altitude_m=altitudes.barometric_m if is_barometric else altitudes.geometric_m,
            altitude_reference=(
                AltitudeReference.BAROMETRIC if is_barometric else AltitudeReference.GEOMETRIC
            ),
            geometric_altitude_m=self._geometric_m(altitudes, now_s),
            course_rad=self.course_rad if is_joined else None,
            ground_speed_mps=self.speed_mps if is_joined else None,
            climb_mps=self._climb_mps(now_s),
            callsign=self.callsign,
            squawk=self.squawk,
            kind=self.kind,
            airborne=airborne,
            position_sigma_m=self.stated.position_sigma_m(now_s),
            altitude_sigma_m=None if is_barometric else self.stated.altitude_sigma_m(now_s),
            velocity_sigma_mps=self.stated.velocity_sigma_mps(now_s),
            containment_m=self.stated.containment_m(),
            sil=self.stated.integrity(now_s),
        )

    def altitude_report(self, now_s: float, altitude_m: float, *, airborne: bool) -> TrafficReport:
        """A report of a barometric altitude without a position."""
        self.altitude_s = now_s
        altitudes = Altitudes(barometric_m=altitude_m)
        return TrafficReport(
            source=TrafficSource.MODE_S,
            key="",
            time_s=now_s,
            altitude_m=altitude_m,
            altitude_reference=AltitudeReference.BAROMETRIC,
            geometric_altitude_m=self._geometric_m(altitudes, now_s),
            climb_mps=self._climb_mps(now_s),
            callsign=self.callsign,
            squawk=self.squawk,
            kind=self.kind,
            airborne=airborne,
        )

    def _climb_mps(self, now_s: float) -> float | None:
        is_joined = now_s - self.climb_s <= _JOINED_S and not self.positions.is_shared(now_s)
        return self.climb_mps if is_joined else None

    def _geometric_m(self, altitudes: Altitudes, now_s: float) -> float | None:
        """The geometric altitude beside a barometric one."""
        difference_m = self.geometric_minus_barometric_m
        if altitudes.barometric_m is None or difference_m is None:
            return None
        return altitudes.barometric_m + difference_m if now_s - self.difference_s <= _DIFFERENCE_S else None
