"""Consistency of the tracks: their errors against the truth, in units of the accuracy that they claim.

NEES, the normalized estimation error squared (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to
Tracking and Navigation, 2001, 5.4.2), divided by its degrees of freedom: 1 for a filter whose errors are as
large as it says, more for one that is too sure of itself. Tracks give a sigma for each horizontal axis, for
position and velocity, so that there are two degrees of freedom each. A latency that receivers do not report
moves a track along its path, which no filter can know: NEES is given with and without that shift.
"""

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from companion.mavlink.facts import OwnPosition, PressureAltitude
from companion.model import Track, Vec3
from companion.traffic import TrafficParams, TrafficPicture
from sim.campaign.flight import FIRST_ICAO, as_report
from sim.campaign.plan import Plan
from sim.campaign.plane import AUTOPILOT, FRAME
from sim.campaign.results import ResultLine
from sim.encounters import Encounter, Observer, surveillance_of
from sim.evidence.statistics import chi2_interval

# The results' name for tracks, where flights have their avoider.
TRACKS = "tracks"
_START_S = 1_700_000_000.0
# Decisions with a track until its filter has settled.
_SETTLES = 8
# Sums over the decisions of one encounter.
SUMS = (
    "count", "position_nees", "velocity_nees", "shifted_position_nees", "shifted_velocity_nees",
    "position_m2", "velocity_mps2", "height_m2", "climb_mps2",
)  # fmt: skip
_ERRORS = ("position_m", "velocity_mps", "height_m", "climb_mps")


def follow(encounter: Encounter, preset: str, number: int, seed: int) -> ResultLine:
    """Follow the intruders of an encounter with the traffic picture; sums of the squared errors."""
    how = surveillance_of(preset)
    observer, picture = Observer(encounter, how, seed + number), TrafficPicture(TrafficParams())
    unreported_s = 0.0 if how.age_reported else how.latency_s
    sums, seen = dict.fromkeys(SUMS, 0.0), [0] * len(encounter.intruders)
    for second in range(round(encounter.duration_s)):
        now_s = _START_S + second
        _observe_ourselves(picture, encounter, float(second), now_s)
        for heard in observer.reports(float(second)):
            report = as_report(heard, now_s, observer.stated_sigma_m)
            picture.tracker.receive(report, now_s, AUTOPILOT)
        for index, track in _intruders(picture.tracker.tracks(now_s, FRAME), len(seen)):
            seen[index] += 1
            if seen[index] > _SETTLES:
                path = encounter.intruders[index]
                truths = path.states_at(np.array([second, second - unreported_s], dtype=float))
                _add(sums, track, truths[0], truths[1])
    return {"avoider": TRACKS, "surveillance": preset, "number": number} | sums


def follow_task(
    task: tuple[Plan, str, tuple[int, ...]], source: Callable[[int], Encounter] | None = None
) -> list[ResultLine]:
    """Follow some encounters of a plan with a preset."""
    plan, preset, numbers = task
    source = source or plan.source()
    return [follow(source(number), preset, number, plan.seed) for number in numbers]


def consistency_of(lines: Iterable[ResultLine]) -> dict[str, object]:
    """Mean NEES over encounters with its 95 % chi-square interval, and RMS errors.

    The interval is that of as many independent numbers as there are encounters, as the decisions of one
    encounter depend on each other.
    """
    rows = np.array([[line[name] for name in SUMS] for line in lines if line["count"] > 0.0])
    if not len(rows):
        return {"encounters": 0}
    count, squares = rows[:, 0], rows[:, 5:].sum(0) / rows[:, 0].sum()
    means = (rows[:, 1:5] / count[:, None]).mean(0)
    return {
        "encounters": len(rows),
        "decisions": int(count.sum()),
        "interval": [round(edge, 3) for edge in chi2_interval(2, len(rows))],
        **{name: round(float(mean), 3) for name, mean in zip(SUMS[1:5], means, strict=True)},
        **{name: round(math.sqrt(square), 2) for name, square in zip(_ERRORS, squares, strict=True)},
    }


def _observe_ourselves(picture: TrafficPicture, encounter: Encounter, time_s: float, now_s: float) -> None:
    velocity_mps = encounter.own_velocity_mps
    north_m, east_m, down_m = (
        place + speed * time_s for place, speed in zip(encounter.own_position_m, velocity_mps, strict=True)
    )
    here = FRAME.to_geo(north_m, east_m, down_m)
    course_rad, height_m = encounter.own_course_rad, here.altitude_m
    picture.observe_ownship(PressureAltitude(AUTOPILOT, height_m), now_s)
    place = here.lat_deg, here.lon_deg, height_m, height_m
    picture.observe_ownship(OwnPosition(AUTOPILOT, now_s, *place, velocity_mps, course_rad), now_s)


def _intruders(tracks: Iterable[Track], count: int) -> Iterator[tuple[int, Track]]:
    """The tracks of the intruders, with their numbers."""
    for track in tracks:
        index = -1 if track.icao is None else track.icao - FIRST_ICAO
        if 0 <= index < count and track.position_sigma_m and track.velocity_sigma_mps:
            yield index, track


def _add(sums: dict[str, float], track: Track, truth: tuple[Vec3, Vec3], shifted: tuple[Vec3, Vec3]) -> None:
    """Add the errors of one track, also against the truth as old as the reports."""
    assert track.position_sigma_m
    assert track.velocity_sigma_mps
    position_m, velocity_mps = track.position_m, track.velocity_mps
    variances = track.position_sigma_m**2, track.velocity_sigma_mps**2
    for name, (at_m, at_mps) in (("", truth), ("shifted_", shifted)):
        off_m2, off_mps2 = _across(position_m, at_m), _across(velocity_mps, at_mps)
        sums[f"{name}position_nees"] += off_m2 / variances[0] / 2.0
        sums[f"{name}velocity_nees"] += off_mps2 / variances[1] / 2.0
    sums["count"] += 1.0
    sums["position_m2"] += _across(position_m, truth[0])
    sums["velocity_mps2"] += _across(velocity_mps, truth[1])
    sums["height_m2"] += (position_m[2] - truth[0][2]) ** 2
    sums["climb_mps2"] += (velocity_mps[2] - truth[1][2]) ** 2


def _across(one: Vec3, other: Vec3) -> float:
    """The squared horizontal distance."""
    return (one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2
