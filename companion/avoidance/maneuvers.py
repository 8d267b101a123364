"""What others may do that nobody can predict: begin a turn, end one, climb, sink or level off.

A flight is priced against each of these with the share of the time that it comes true. So of two flights
that keep clear of what is predicted, the one wins that also keeps clear of what is merely likely: rather
ninety metres higher than along the very edge of the volume for a minute.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from companion.avoidance.geometry import Array
from companion.avoidance.trajectory import Surprises, Tracks

# Slower turns and climbs than these are none.
_STRAIGHT_RADPS = math.radians(0.2)
_LEVEL_MPS = 0.5
# Who is in a turn or a climb already may also make more of it.
_TIGHTER = 1.5


@dataclass(frozen=True)
class SurpriseParams:
    """How likely surprises are, each of the two ways, and what they are.

    In the encounter models of MIT Lincoln Laboratory 8 % of the aircraft that fly straight have turned by
    more than 20 degrees half a minute later, 11 % after 40 s, and 30 % climb or sink at any time.
    """

    turn_share: Annotated[float, Ge(0), Le(0.2)] = 0.03
    turn_radps: Annotated[float, Ge(0), Le(0.5)] = math.radians(3.0)
    climb_share: Annotated[float, Ge(0), Le(0.2)] = 0.03
    climb_mps: Annotated[float, Ge(0), Le(50)] = 2.5
    # Of so many tracks, those that press most: in a crowd the others are predicted and no more.
    tracks: Annotated[int, Ge(1), Le(50)] = 4
    # What would come of a surprise later than this can be seen to when it has happened.
    within_s: Annotated[float, Ge(0), Le(90)] = 40.0

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return self.turn_share > 0.0 or self.climb_share > 0.0


NO_SURPRISES = SurpriseParams(turn_share=0.0, climb_share=0.0)


def foreseen(tracks: Tracks, params: SurpriseParams) -> Surprises:
    """All that the first of the tracks may do instead: turn right, left, climb and sink, each for all."""
    count = min(len(tracks), params.tracks) if params.any else 0
    turns, sinks = tracks.turn_radps[:count].tolist(), tracks.velocity_mps[:count, 2].tolist()
    right = [params.turn_radps if abs(turn) < _STRAIGHT_RADPS else 0.0 for turn in turns]
    left = [-params.turn_radps if abs(turn) < _STRAIGHT_RADPS else _TIGHTER * turn for turn in turns]
    up = [-params.climb_mps if abs(sink) < _LEVEL_MPS else 0.0 for sink in sinks]
    down = [params.climb_mps if abs(sink) < _LEVEL_MPS else _TIGHTER * sink for sink in sinks]
    flies = tuple(0.0 if grounded else 1.0 for grounded in tracks.grounded[:count].tolist())
    return Surprises(
        _four_times(count),
        np.array([*right, *left, *turns, *turns]),
        np.array([*sinks, *sinks, *up, *down]),
        _likely(flies, params),
    )


@lru_cache(maxsize=64)
def _four_times(count: int) -> NDArray[np.intp]:
    """Places of the first tracks, four times."""
    return np.tile(np.arange(count), 4)


@lru_cache(maxsize=64)
def _likely(flies: tuple[float, ...], params: SurpriseParams) -> Array:
    """How likely each of them is: what stands on the ground stays there."""
    turn, climb = params.turn_share * np.array(flies), params.climb_share * np.array(flies)
    likely = np.concatenate([turn, turn, climb, climb])
    likely.setflags(write=False)  # it is handed out again
    return likely
