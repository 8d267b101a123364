"""Intruder maneuvers that cannot be predicted: begin a turn, end one, climb, sink or level off.

Each row is priced against every maneuver, weighted by its probability. So of two rows that stay clear of the
predicted flight, the one that also stays clear of likely maneuvers is cheaper: for example, ninety metres
higher instead of along the edge of a volume for a minute.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from companion.avoidance.geometry import Array
from companion.avoidance.tracks import Tracks

# Slower turns and climbs count as straight and level.
_STRAIGHT_RADPS = math.radians(0.2)
_LEVEL_MPS = 0.5
# A track that turns or climbs already may do so this many times as fast.
_TIGHTER = 1.5


@dataclass(frozen=True)
class ManeuverParams:
    """How probable unpredicted maneuvers of intruders are, to each side, and their rates.

    In the encounter models of MIT Lincoln Laboratory 8 % of the aircraft that fly straight have turned by
    more than 20 degrees half a minute later, 11 % after 40 s, and 30 % climb or sink at any time.
    """

    turn_share: Annotated[float, Ge(0), Le(0.2)] = 0.03
    turn_radps: Annotated[float, Ge(0), Le(0.5)] = math.radians(3.0)
    climb_share: Annotated[float, Ge(0), Le(0.2)] = 0.03
    climb_mps: Annotated[float, Ge(0), Le(50)] = 2.5
    # Maneuvers are considered for this many tracks, the most urgent first; the others are only predicted.
    tracks: Annotated[int, Ge(1), Le(50)] = 4
    # The effect of a maneuver counts until this time; later effects can be answered once it has begun.
    within_s: Annotated[float, Ge(0), Le(90)] = 40.0

    @property
    def enabled(self) -> bool:
        """Whether any maneuver is considered."""
        return self.turn_share > 0.0 or self.climb_share > 0.0


NO_MANEUVERS = ManeuverParams(turn_share=0.0, climb_share=0.0)


class IntruderManeuvers(NamedTuple):
    """Possible maneuvers of tracks, (M,) each.

    `of` is the index of the track. `turn_radps` is positive to the right, `sink_mps` positive down. `likely`
    is the probability.
    """

    of: NDArray[np.intp]
    turn_radps: Array
    sink_mps: Array
    likely: Array


def enumerate_maneuvers(tracks: Tracks, params: ManeuverParams) -> IntruderManeuvers:
    """All maneuvers of the first tracks: right turns, left turns, climbs, then descents, each for all."""
    count = min(len(tracks), params.tracks) if params.enabled else 0
    turns, sinks = tracks.turn_radps[:count].tolist(), tracks.velocity_mps[:count, 2].tolist()
    right = [params.turn_radps if abs(turn) < _STRAIGHT_RADPS else 0.0 for turn in turns]
    left = [-params.turn_radps if abs(turn) < _STRAIGHT_RADPS else _TIGHTER * turn for turn in turns]
    up = [-params.climb_mps if abs(sink) < _LEVEL_MPS else 0.0 for sink in sinks]
    down = [params.climb_mps if abs(sink) < _LEVEL_MPS else _TIGHTER * sink for sink in sinks]
    flies = tuple(0.0 if grounded else 1.0 for grounded in tracks.grounded[:count].tolist())
    return IntruderManeuvers(
        _indices_four_times(count),
        np.array([*right, *left, *turns, *turns]),
        np.array([*sinks, *sinks, *up, *down]),
        _probabilities(flies, params),
    )


@lru_cache(maxsize=64)
def _indices_four_times(count: int) -> NDArray[np.intp]:
    return np.tile(np.arange(count), 4)


@lru_cache(maxsize=64)
def _probabilities(flies: tuple[float, ...], params: ManeuverParams) -> Array:
    """Probability of each maneuver, (M,); 0 for grounded tracks."""
    turn, climb = params.turn_share * np.array(flies), params.climb_share * np.array(flies)
    likely = np.concatenate([turn, turn, climb, climb])
    likely.setflags(write=False)  # shared by the cache
    return likely
