"""The encounters of a flight: the aircraft that came near, how near, and how we avoided them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from companion.report.flight import LAYERS, Bools, Flight, Floats, TrackHistory
from companion.units import (
    NMAC_HORIZONTAL_M,
    NMAC_VERTICAL_M,
    WELL_CLEAR_HORIZONTAL_M,
    WELL_CLEAR_VERTICAL_M,
)

# An aircraft is near in a conflict, or within this multiple of well clear, horizontally and vertically.
_NEAR = 2.0
# After this time without a track, another encounter begins.
_APART_S = 60.0

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Encounter:
    """One encounter with one aircraft; its closest point is that of the shortest slant distance.

    `acted_s` is when the avoidance was first flown, `advised_s` when it was first decided, both in seconds
    before the closest point. `aside_m` and `height_m` are the largest deviations while the companion flew
    because of this aircraft: from the mission (or the straight course if it is unknown), and from the height
    at the first action.
    """

    history: TrackHistory
    at: Indices  # rows of the flight
    horizontal_m: Floats
    vertical_m: Floats
    closest: int  # index into the three above
    layer: str
    well_clear: bool
    nmac: bool
    acted_s: float | None
    advised_s: float | None
    aside_m: float | None
    height_m: float | None

    @property
    def name(self) -> str:
        """The name of the aircraft."""
        return self.history.name

    @property
    def closest_at(self) -> int:
        """The row of the closest point in the flight's columns."""
        return int(self.at[self.closest])

    @property
    def closest_horizontal_m(self) -> float:
        """Horizontal distance at the closest point [m]."""
        return float(self.horizontal_m[self.closest])

    @property
    def closest_vertical_m(self) -> float:
        """Vertical distance at the closest point [m]; positive if the other was above us."""
        return float(self.vertical_m[self.closest])

    @property
    def closest_slant_m(self) -> float:
        """Slant distance at the closest point [m]."""
        return math.hypot(self.closest_horizontal_m, self.closest_vertical_m)


def encounters_of(flight: Flight) -> list[Encounter]:
    """All encounters, in the order of their closest points."""
    found = [one for history in flight.tracks.values() for one in _of_track(flight, history)]
    return sorted(found, key=lambda one: one.closest_at)


def _of_track(flight: Flight, history: TrackHistory) -> Iterator[Encounter]:
    at, (north_m, east_m) = history.at, history.relative_m
    horizontal_m = np.hypot(north_m, east_m)
    vertical_m = history.altitude_m - flight.column("altitude_m")[at]
    breaks = np.flatnonzero(np.diff(flight.time_s[at]) > _APART_S) + 1
    for part in np.split(np.arange(len(at)), breaks):
        threat = np.isin(at[part], history.threat_at)
        near = (horizontal_m[part] < _NEAR * WELL_CLEAR_HORIZONTAL_M) & (
            np.abs(vertical_m[part]) < _NEAR * WELL_CLEAR_VERTICAL_M
        )
        if threat.any() or near.any():
            yield _encounter(flight, history, at[part], horizontal_m[part], vertical_m[part], threat)


def _encounter(
    flight: Flight,
    history: TrackHistory,
    at: Indices,
    horizontal_m: Floats,
    vertical_m: Floats,
    threat: Bools,
) -> Encounter:
    closest = int(np.argmin(np.hypot(horizontal_m, vertical_m)))
    guided = np.isfinite(flight.column("commanded_course_deg"))[at] & threat
    advised, acted = at[guided], at[guided & flight.flying[at]]
    closest_s = flight.time_s[at[closest]]

    def before_s(rows: Indices) -> float | None:
        return float(closest_s - flight.time_s[rows[0]]) if rows.size else None

    aside_m, height_m = _deviation(flight, int(acted[0])) if acted.size else (None, None)
    return Encounter(
        history=history,
        at=at,
        horizontal_m=horizontal_m,
        vertical_m=vertical_m,
        closest=closest,
        layer=LAYERS[int(flight.column("layer")[at[threat]].max())] if threat.any() else LAYERS[0],
        well_clear=not _within(horizontal_m, vertical_m, WELL_CLEAR_HORIZONTAL_M, WELL_CLEAR_VERTICAL_M),
        nmac=_within(horizontal_m, vertical_m, NMAC_HORIZONTAL_M, NMAC_VERTICAL_M),
        acted_s=before_s(acted),
        advised_s=before_s(advised),
        aside_m=aside_m,
        height_m=height_m,
    )


def _within(horizontal_m: Floats, vertical_m: Floats, radius_m: float, half_height_m: float) -> bool:
    return bool(((horizontal_m < radius_m) & (np.abs(vertical_m) < half_height_m)).any())


def _deviation(flight: Flight, first: int) -> tuple[float, float]:
    """The largest deviations, sideways and in height, from the first action until the release."""
    not_ours = np.flatnonzero(~flight.flying[first:])
    end = first + int(not_ours[0]) if not_ours.size else len(flight)
    north_m, east_m = flight.column("north_m")[first:end], flight.column("east_m")[first:end]
    heights_m = flight.column("altitude_m")[first:end]
    legs_m = flight.legs_m
    if len(legs_m) > 0:
        # The first leg begins where the flight begins.
        start_m = np.array([[flight.column("north_m")[0], flight.column("east_m")[0]]])
        legs_m = np.vstack([start_m, legs_m])
    else:
        course_rad = math.radians(flight.column("course_deg")[first])
        begin = np.array([north_m[0], east_m[0]])
        legs_m = np.array([begin, begin + 1e6 * np.array([math.cos(course_rad), math.sin(course_rad)])])
    aside_m = _distance_m(np.column_stack([north_m, east_m]), legs_m)
    return float(aside_m.max()), float(np.abs(heights_m - heights_m[0]).max())


def _distance_m(positions_m: Floats, legs_m: Floats) -> Floats:
    """The distance of each position from the nearest leg."""
    nearest_m = np.full(len(positions_m), np.inf)
    for begin, end in pairwise(legs_m):
        along = end - begin
        squared = float(along @ along)
        share = np.clip((positions_m - begin) @ along / (squared or 1.0), 0.0, 1.0)
        off_m = positions_m - begin - share[:, None] * along
        nearest_m = np.minimum(nearest_m, np.hypot(off_m[:, 0], off_m[:, 1]))
    return nearest_m
