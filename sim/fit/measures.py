"""How well a fake's flight fits a recorded one: shares of the time within limits, and 95 % quantiles."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.geodesy import LocalFrame
from sim.fit.flown import Flown, fly
from sim.fit.recording import Numbers, Recording, Steps
from sim.fit.segments import Segment

COURSE_RAD = math.radians(6.0)
HEIGHT_M = 8.0
AIRSPEED_MPS = 1.5
# Modes and items agree if the recording shows the fake's within this time: heartbeats may come once a second.
SHOWN_WITHIN_S = 1.0


@dataclass(frozen=True, slots=True)
class Errors:
    """Differences of the fake from the recording, one row for each recorded position.

    `aside_m` is the horizontal distance between the two aircraft.
    """

    course_rad: Numbers
    height_m: Numbers
    airspeed_mps: Numbers
    aside_m: Numbers
    mode_agrees: NDArray[np.bool_]
    item_agrees: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Fit:
    """The fit of some flights: shares of the time within the limits, and what 95 % of the time is within."""

    name: str
    duration_s: float
    course: float
    height: float
    airspeed: float
    mode: float
    item: float
    course_rad: float
    height_m: float
    airspeed_mps: float
    aside_m: float


def errors_of(recording: Recording, flown: Flown) -> Errors:
    """The differences between a recording and the fake's flight of a segment."""
    track, fake = recording.track, flown.track
    first = track.index(float(fake.time_s[0]))
    rows = slice(first, first + len(fake.time_s))
    north_m_per_deg, east_m_per_deg = LocalFrame(*track.place(first)[:2]).metres_per_degree
    north_m = (fake.lat_deg - track.lat_deg[rows]) * north_m_per_deg
    east_m = (fake.lon_deg - track.lon_deg[rows]) * east_m_per_deg
    turned = fake.course_rad - track.course_rad[rows]
    return Errors(
        np.abs((turned + math.pi) % math.tau - math.pi),
        np.abs(fake.altitude_m - track.altitude_m[rows]),
        np.abs(fake.airspeed_mps - track.airspeed_mps[rows]),
        np.hypot(north_m, east_m),
        _agree(fake.time_s, flown.modes, recording.modes),
        _agree(fake.time_s, flown.sequences, recording.sequences),
    )


def _agree(times_s: Numbers, fake: Steps, recorded: Steps) -> NDArray[np.bool_]:
    return np.array(
        [
            fake.at(time_s) in recorded.during(time_s - SHOWN_WITHIN_S, time_s + SHOWN_WITHIN_S)
            for time_s in times_s
        ]
    )


def fit_of(name: str, errors: Iterable[Errors]) -> Fit:
    """The fit over all rows of some segments."""
    parts = list(errors)
    course_rad = np.concatenate([part.course_rad for part in parts])
    height_m = np.concatenate([part.height_m for part in parts])
    airspeed_mps = np.concatenate([part.airspeed_mps for part in parts])
    return Fit(
        name,
        len(course_rad) * 0.1,
        float(np.mean(course_rad <= COURSE_RAD)),
        float(np.mean(height_m <= HEIGHT_M)),
        float(np.mean(airspeed_mps <= AIRSPEED_MPS)),
        float(np.mean(np.concatenate([part.mode_agrees for part in parts]))),
        float(np.mean(np.concatenate([part.item_agrees for part in parts]))),
        float(np.quantile(course_rad, 0.95)),
        float(np.quantile(height_m, 0.95)),
        float(np.quantile(airspeed_mps, 0.95)),
        float(np.quantile(np.concatenate([part.aside_m for part in parts]), 0.95)),
    )


def measure(recording: Recording, segments: Iterable[Segment]) -> dict[str, Errors]:
    """The differences in each segment, by its name."""
    return {segment.name: errors_of(recording, fly(recording, segment)) for segment in segments}


def table(fits: Iterable[Fit]) -> list[str]:
    """Lines for people: shares in percent, then the 95 % quantiles."""
    head = f"{'':42} {'s':>5} {'course':>7} {'height':>7} {'speed':>7} {'mode':>7} {'item':>7}"
    lines = [head + f" {'95 %:':>6} {'deg':>6} {'m':>6} {'m/s':>6} {'aside':>6}"]
    for fit in fits:
        shares = (fit.course, fit.height, fit.airspeed, fit.mode, fit.item)
        percents = " ".join(f"{100.0 * share:6.1f}%" for share in shares)
        angle = f"{math.degrees(fit.course_rad):6.1f}"
        quantiles = f"{angle} {fit.height_m:6.1f} {fit.airspeed_mps:6.2f} {fit.aside_m:6.0f}"
        lines.append(f"{fit.name:42} {fit.duration_s:5.0f} {percents} {'':>6} {quantiles}")
    return lines
