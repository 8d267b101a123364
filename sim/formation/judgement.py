"""The measures of a flown crossing: separation of the members, arrival, safety value, way, the stranger."""

from dataclasses import asdict, dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from sim.campaign.flight import STEP_S, closest_approach
from sim.encounters import Encounter
from sim.formation.crossing import Crossing
from sim.formation.engines import Separation
from sim.formation.flight import FormationFlight

Array = NDArray[np.floating]

# The safety value around the meeting is that of this time before and after it.
_AROUND_S = 20.0


@dataclass(frozen=True, slots=True)
class Judgement:
    """The measures of one flight. Pairs are judged while both members are under way.

    `smallest_m` is the smallest distance in space of any pair; `pairs_lost` counts pairs that were within the
    separation both horizontally and in height, `pairs_near` those within it in space. `safety_value_m` is the
    paper's eq. 3, the mean distance of all pairs, averaged over the time in which all are under way without
    avoidance, so that it is the same time for each avoider; `safety_value_near_m` around the meeting.
    `path_ratio` is flown length over the mission's, of the members that arrived. `nmac` and `lowc` count the
    members that lost these volumes to the stranger; `None` without one.
    """

    pairs: int
    smallest_m: float
    pairs_lost: int
    pairs_near: int
    arrived: int
    safety_value_m: float
    safety_value_near_m: float
    path_ratio: float | None
    nmac: int | None
    lowc: int | None

    def line(self) -> dict[str, object]:
        """The measures for JSON."""
        return {k: round(v, 4) if isinstance(v, float) else v for k, v in asdict(self).items()}


def judge(flight: FormationFlight, separation: Separation) -> Judgement:
    """The measures of a flight."""
    crossing, count = flight.crossing, len(flight.crossing.missions)
    pairs = [_offsets(flight, *pair) for pair in combinations(range(count), 2)]
    smallest_m = [float(np.linalg.norm(off_m, axis=1).min()) for off_m in pairs]
    stranger = _against_stranger(flight)
    return Judgement(
        pairs=len(pairs),
        smallest_m=min(smallest_m),
        pairs_lost=sum(_is_lost(off_m, separation) for off_m in pairs),
        pairs_near=sum(one < separation.smallest_m for one in smallest_m),
        arrived=sum(arrived_s is not None for arrived_s in flight.arrived_s),
        safety_value_m=_safety_value(flight, 0.0, crossing.common_s),
        safety_value_near_m=_safety_value(
            flight, crossing.meets_s - _AROUND_S, min(crossing.meets_s + _AROUND_S, crossing.common_s)
        ),
        path_ratio=_path_ratio(flight),
        nmac=None if stranger is None else stranger[0],
        lowc=None if stranger is None else stranger[1],
    )


def _offsets(flight: FormationFlight, one: int, other: int) -> Array:
    """Vectors between two members while both are under way, (T, 3)."""
    ends_s = [flight.arrived_s[one], flight.arrived_s[other]]
    known_s = [end_s for end_s in ends_s if end_s is not None]
    count = round(min(known_s) / STEP_S) + 1 if known_s else len(flight.position_m)
    return flight.position_m[:count, other] - flight.position_m[:count, one]


def _is_lost(off_m: Array, separation: Separation) -> bool:
    across_m, above_m = np.hypot(off_m[:, 0], off_m[:, 1]), np.abs(off_m[:, 2])
    return bool(((across_m < separation.smallest_m) & (above_m < separation.smallest_vertical_m)).any())


def _safety_value(flight: FormationFlight, from_s: float, to_s: float) -> float:
    """Eq. 3 averaged from one time to another: the mean distance between all pairs [m]."""
    place_m = flight.position_m[round(from_s / STEP_S) : round(to_s / STEP_S) + 1]
    count = place_m.shape[1]
    apart_m = [
        np.linalg.norm(place_m[:, one] - place_m[:, other], axis=1)
        for one, other in combinations(range(count), 2)
    ]
    return float(np.mean(apart_m))


def _path_ratio(flight: FormationFlight) -> float | None:
    arrived = [
        (_flown_m(flight, index, arrived_s), mission.length_m)
        for index, (mission, arrived_s) in enumerate(
            zip(flight.crossing.missions, flight.arrived_s, strict=True)
        )
        if arrived_s is not None
    ]
    if not arrived:
        return None
    flown_m, shortest_m = map(sum, zip(*arrived, strict=True))
    return float(flown_m / shortest_m)


def _flown_m(flight: FormationFlight, index: int, arrived_s: float) -> float:
    """Length over ground until the arrival, and on to the waypoint itself."""
    way_m = np.diff(flight.position_m[: round(arrived_s / STEP_S) + 1, index, :2], axis=0)
    last_m = flight.position_m[round(arrived_s / STEP_S), index, :2]
    left_m = float(np.hypot(*(last_m - flight.crossing.missions[index].end_m[:2])))
    return float(np.hypot(way_m[:, 0], way_m[:, 1]).sum()) + left_m


def _against_stranger(flight: FormationFlight) -> tuple[int, int] | None:
    """How many members had a near mid-air collision with the stranger, and lost well clear of it."""
    crossing: Crossing = flight.crossing
    if crossing.stranger is None:
        return None
    nmac = lowc = 0
    for index, mission in enumerate(crossing.missions):
        duration_s = (len(flight.position_m) - 1) * STEP_S
        seen = Encounter(
            "", mission.start_m, 0.0, mission.airspeed_mps, (crossing.stranger,), duration_s=duration_s
        )
        nearest = closest_approach(flight.position_m[:, index], seen)
        nmac += nearest.nmac
        lowc += nearest.lowc
    return nmac, lowc
