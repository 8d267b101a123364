"""Positions of ADS-B from compact position reports: pairs of even and odd frames, then single frames.

Source: RTCA DO-260B A.1.7 (compact position reporting), decoded by pyModeS.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from pyModeS.position import (
    airborne_position_pair,
    airborne_position_with_ref,
    surface_position_pair,
    surface_position_with_ref,
)

from companion.model import LatLon
from companion.sources.quantities import LATITUDE_DEG

# A frame is decoded relative to the last position of its aircraft, which must be within 180 NM in the air and
# 45 NM on the ground; in this time nothing flies that far.
_TRAIL_S: Final = 60.0
# Frames of a pair are at most this far apart (A.1.7.7); on the ground one is sent every 5 s.
_PAIR_S: Final = {False: 10.0, True: 25.0}
# How far an aircraft moves between two frames: its speed at most, and a piece of a stream that was held back.
_MAX_SPEED_MPS: Final = 400.0
_MARGIN_M: Final = 500.0
# The two kinds of frames divide the globe differently: both fit the true position only.
_ONE_KIND_S: Final = 20.0
_CONFIRMED_FRAMES: Final = 2
_MAX_TRAILS: Final = 4
_MAX_UNMATCHED: Final = 4
_METRES_PER_DEGREE: Final = 60.0 * 1852.0


class CprFrame(NamedTuple):
    """The compact position in one message."""

    is_odd: bool
    lat: int
    lon: int
    is_surface: bool
    time_s: float


@dataclass(slots=True)
class _Trail:
    """The newest position of one aircraft; the last times and the numbers of its even and odd frames."""

    place: LatLon
    time_s: float
    fitted_s: list[float]
    frames: list[int]

    @property
    def is_confirmed(self) -> bool:
        return min(self.frames) >= _CONFIRMED_FRAMES

    def is_alive(self, now_s: float) -> bool:
        even_s, odd_s = self.fitted_s
        return now_s - self.time_s <= _TRAIL_S and abs(even_s - odd_s) <= _ONE_KIND_S

    def take(self, frame: CprFrame) -> LatLon | None:
        """The position of a frame that fits this trail; `None` if it does not."""
        place = _near(frame, self.place)
        if place is None or _distance_m(self.place, place) > _reach_m(frame.time_s - self.time_s):
            return None
        self.place, self.time_s = place, frame.time_s
        self.fitted_s[frame.is_odd] = frame.time_s
        self.frames[frame.is_odd] += 1
        return place


class CprPositions:
    """The positions of one address.

    The first pair of frames is a candidate only: another frame of each kind must fit it. A frame that does
    not fit the last position is no position of this aircraft, until two such pairs make another trail: two
    aircraft with one address are followed both.
    """

    def __init__(self) -> None:
        self._trails: list[_Trail] = []
        self._unmatched: deque[CprFrame] = deque(maxlen=_MAX_UNMATCHED)

    def is_shared(self, now_s: float) -> bool:
        """Whether more than one aircraft has this address."""
        return sum(trail.is_confirmed and now_s - trail.time_s <= _ONE_KIND_S for trail in self._trails) > 1

    def positions(self, frame: CprFrame, reference: LatLon | None) -> list[LatLon]:
        """The positions that a frame stands for: one, or none while that is not certain.

        Several if aircraft share the address and it is not certain which one sent the frame. `reference` is
        any position within some 2000 km: a pair of frames on the ground is the same in eight places.
        """
        self._trails = [trail for trail in self._trails if trail.is_alive(frame.time_s)]
        fitting = [(trail, place) for trail in self._trails if (place := trail.take(frame)) is not None]
        if not fitting:
            self._pair(frame, reference)
        self._trails = _distinct(self._trails)
        return list(dict.fromkeys(place for trail, place in fitting if trail.is_confirmed))

    def _pair(self, frame: CprFrame, reference: LatLon | None) -> None:
        """Begin a trail with each unmatched frame of the other kind."""
        for other in self._unmatched:
            is_pair = other.is_odd != frame.is_odd and other.is_surface == frame.is_surface
            if not is_pair or frame.time_s - other.time_s > _PAIR_S[frame.is_surface]:
                continue
            place = _global(frame, other, self._reference(reference))
            if place is not None and len(self._trails) < _MAX_TRAILS:
                fitted_s = sorted((other.time_s, frame.time_s), reverse=not frame.is_odd)
                self._trails.append(_Trail(place, frame.time_s, fitted_s, [1, 1]))
        self._unmatched.append(frame)

    def _reference(self, other: LatLon | None) -> LatLon | None:
        """The place of this aircraft, otherwise that of another."""
        return next((trail.place for trail in self._trails if trail.is_confirmed), other)


def _distinct(trails: list[_Trail]) -> list[_Trail]:
    """One trail for each place, the best known: two aircraft with the same address may have met there."""
    best: dict[LatLon, _Trail] = {}
    for trail in sorted(trails, key=lambda trail: min(trail.frames)):
        best[trail.place] = trail
    return list(best.values())


def _near(frame: CprFrame, place: LatLon) -> LatLon | None:
    """The position of a frame that is nearest to a place; `None` beyond a pole."""
    decode = surface_position_with_ref if frame.is_surface else airborne_position_with_ref
    return _on_globe(decode(int(frame.is_odd), frame.lat, frame.lon, *place))


def _global(frame: CprFrame, other: CprFrame, reference: LatLon | None) -> LatLon | None:
    """The position of a frame from the pair with another; `None` if the two are of different zones."""
    even, odd = (other, frame) if frame.is_odd else (frame, other)
    pair = (even.lat, even.lon, odd.lat, odd.lon)
    if not frame.is_surface:
        return _on_globe(airborne_position_pair(*pair, even_is_newer=not frame.is_odd))
    if reference is None:
        return None
    lat_deg, lon_deg = reference
    return _on_globe(
        surface_position_pair(*pair, lat_ref=lat_deg, lon_ref=lon_deg, even_is_newer=not frame.is_odd)
    )


def _on_globe(place: LatLon | None) -> LatLon | None:
    if place is None or not LATITUDE_DEG.has(place[0]):
        return None
    return place[0], (place[1] + 180.0) % 360.0 - 180.0


def _distance_m(first: LatLon, second: LatLon) -> float:
    """About the distance [m]: on a sphere, as for short ones."""
    turn_deg = (second[1] - first[1] + 180.0) % 360.0 - 180.0
    north_m = (second[0] - first[0]) * _METRES_PER_DEGREE
    return math.hypot(north_m, turn_deg * _METRES_PER_DEGREE * math.cos(math.radians(second[0])))


def _reach_m(elapsed_s: float) -> float:
    """How far an aircraft gets in a time [m]."""
    return _MARGIN_M + _MAX_SPEED_MPS * max(0.0, elapsed_s)
