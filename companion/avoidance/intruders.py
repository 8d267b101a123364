"""Intruders: traffic as arrays, its motion relative to us, its maneuvers, and how clear of it rows stay.

Rows come first, then tracks, then time: (K, N, T). Positions and velocities are north-east(-down), (N, 2) or
(N, 3); "relative" means other minus own unless a docstring says otherwise. Tracks keep their velocity, and
their turns decay.

An obstacle of radius R_o + R_u at distance d subtends the half angle beta1 = asin((R_o + R_u) / d). There is
a conflict while the relative velocity points into this cone, abs(alpha) <= beta1 (paper §3.1, figures 2 and
3). Once inside, the cone widens to beta2 = beta1 + dbeta until abs(alpha) > beta2. Without that memory a
small turn would leave the cone, the goal would pull the course back into it, and the aircraft would chatter
along its edge.

Each row is also priced against maneuvers that cannot be predicted (begin a turn, end one, climb, sink or
level off), weighted by their probability. So of two rows that stay clear of the predicted flight, the one
that also stays clear of likely maneuvers is cheaper: for example, ninety metres higher instead of along the
edge of a volume for a minute.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import compress
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from companion.avoidance.trajectory import HORIZON_S, KERNEL_TIMES, Array, Mask, Paths, count_until
from companion.compiled import kernels
from companion.model import Vec2, Vec3

# Below this relative speed nothing comes closer within any horizon of interest.
STILL_MPS = 1e-6
# Slower turns and climbs count as straight and level.
_STRAIGHT_RADPS = math.radians(0.2)
_LEVEL_MPS = 0.5
# A track that turns or climbs already may do so this many times as fast.
_TIGHTER = 1.5
# Caps the crossing time at very low closure.
_LONGEST_CROSSING_S = 30.0
# In protected heights. Slightly more than 1, so that a row at this height costs nothing.
_ROOM = 1.02


class RelativeMotion(NamedTuple):
    """Tracks relative to ownship, all flying straight: positions and velocities (N, 3), the rest (N,).

    Positions are other minus own, velocities own minus other. `distance_m` is horizontal. `closing_mps` is
    the rate at which the distance shrinks, 0 where it grows. `time_to_closest_s` counts to the horizontal
    closest approach: negative once past, inf without relative motion. `approach_rad` is the angle alpha of
    the cone (`approach_angle_rad`).
    """

    position_m: Array
    own_velocity_mps: Array
    distance_m: Array
    closing_mps: Array
    time_to_closest_s: Array
    approach_rad: Array


def relative_motion(
    position_m: Array, velocity_mps: Array, own_position_m: Vec3, own_velocity_mps: Vec3
) -> RelativeMotion:
    """Motion of tracks, (N, 3) each, relative to ownship."""
    positions, velocities, columns = kernels.relative_motion(
        position_m, velocity_mps, *own_position_m, *own_velocity_mps, STILL_MPS
    )
    return RelativeMotion(positions, velocities, *columns)


def half_angle_rad(distance_m: Array, radius_m: Array) -> Array:
    """beta1 = asin(radius / distance), (N,); pi within the radius, where every direction collides."""
    beta1: Array = kernels.half_angles(distance_m, radius_m)
    return beta1


def approach_angle_rad(rel_position_m: Array, own_rel_velocity_mps: Array) -> Array:
    """alpha: angle from the line of sight to our velocity relative to the obstacle, in [-pi, pi], (N,).

    `rel_position_m` is obstacle minus own, `own_rel_velocity_mps` own minus obstacle, both (N, 2+). Positive
    is to the left as the pilot sees it: anticlockwise from above, with x north and y east (paper §3.1, fig.
    2). Without relative motion nothing approaches, and alpha is pi.
    """
    alpha: Array = kernels.approach_angles(rel_position_m, own_rel_velocity_mps, STILL_MPS)
    return alpha


class TransitionDomain:
    """The memory of the cones: obstacles whose cone we have entered are judged by beta2 instead of beta1.

    `delta_beta_rad`, by how much beta2 is wider, may be changed at any time.
    """

    def __init__(self, delta_beta_rad: float) -> None:
        self.delta_beta_rad = delta_beta_rad
        self._inside: frozenset[str] = frozenset()

    def wider_rad(self, track_id: str) -> float:
        """By how much the cone of this obstacle is wider than beta1."""
        return self.delta_beta_rad if track_id in self._inside else 0.0

    def covers(self, ids: Sequence[str], alpha_rad: Array, beta1_rad: Array) -> Mask:
        """The obstacles whose cone we are in, (N,); for those entered before, the wider cone."""
        if self._inside:
            beta1_rad = beta1_rad + [self.wider_rad(track_id) for track_id in ids]
        covered: Mask = np.abs(alpha_rad) <= beta1_rad
        return covered

    def keep(self, ids: Sequence[str], inside: Mask) -> None:
        """Remember these obstacles, (N,), as entered, and no others.

        Pass those covered and within reach: def. 3 has conflicts only by distance, so that the domain is
        entered and kept only there.
        """
        self._inside = frozenset(compress(ids, inside.tolist()))

    def reset(self) -> None:
        """Forget all obstacles."""
        self._inside = frozenset()


@dataclass(frozen=True, slots=True)
class Tracks:
    """The predicted traffic: positions and velocities (N, 3) now, all else (N,).

    A protected volume is an upright cylinder around a track, margin included; that of a grounded track
    reaches down to the ground. `buffer_m` is a further distance around the volume, to be kept where possible;
    0 without one. `turn_radps` is positive to the right. `ValueError` for arrays of different lengths.
    """

    ids: tuple[str, ...]
    position_m: Array
    velocity_mps: Array
    protected_horizontal_m: Array
    protected_vertical_m: Array
    grounded: Mask
    buffer_m: Array
    turn_radps: Array
    others: kernels.Others = field(init=False, repr=False, compare=False)  # the same, for the kernels

    def __post_init__(self) -> None:
        object.__setattr__(self, "others", kernels.Others(self))

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def none(cls) -> "Tracks":
        """No traffic."""
        vectors, values = np.zeros((0, 3)), np.zeros(0)
        return cls((), vectors, vectors, values, values, np.zeros(0, dtype=bool), values, values)

    def subset(self, indices: NDArray[np.intp]) -> "Tracks":
        """The tracks at the given indices, in that order."""
        return Tracks(
            tuple(self.ids[i] for i in indices.tolist()),
            self.position_m[indices],
            self.velocity_mps[indices],
            self.protected_horizontal_m[indices],
            self.protected_vertical_m[indices],
            self.grounded[indices],
            self.buffer_m[indices],
            self.turn_radps[indices],
        )

    def velocity_until_closest_mps(self, path_m: Array) -> Array:
        """Mean velocities until the closest approach to a ground path (T, 2), (N, 3).

        For a track that does not turn this is its velocity.
        """
        velocity_mps: Array = kernels.velocities_until_closest(self, path_m, KERNEL_TIMES)
        return velocity_mps

    def ground_m(self) -> Array:
        """Positions at the times of the prediction, north and east, (N, T, 2)."""
        ahead_m: Array = kernels.tracks_ahead(self, KERNEL_TIMES)
        return ahead_m


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
    within_s: Annotated[float, Ge(0), Le(90)] = 30.0

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


class SeparationWeights(Protocol):
    """The cost of coming near."""

    @property
    def margin(self) -> float:
        """Times the penetration of the margin, 0 at its edge."""

    @property
    def loss(self) -> float:
        """Flat, for entering the bare volume."""

    @property
    def depth(self) -> float:
        """Times the deepest penetration of the bare volume."""

    @property
    def exposure(self) -> float:
        """Times the mean penetration over time."""


class Separation(NamedTuple):
    """How clear rows stay of tracks, (K, N) each. 1 is the edge of the protected volume, margin included.

    `closest` is the smallest over time of max(horizontal / protected, vertical / protected). `exposure` is
    the mean over time of the depth within the volume; it distinguishes rows that begin inside. `nearness` is
    the mean over time of the depth within the buffer around the volume, 1 within the volume. `entered_s` is
    the first time within the volume [s], inf for none.
    """

    closest: Array
    exposure: Array
    nearness: Array
    entered_s: Array


def separation(
    paths: Paths, tracks: Tracks, *, horizon_s: float = HORIZON_S, buffers: bool = False
) -> Separation:
    """Separation of rows from the tracks within `horizon_s`, with `nearness` only if `buffers` count."""
    return Separation(*kernels.separation(paths, tracks, KERNEL_TIMES, count_until(horizon_s), buffers))


def losses(
    paths: Paths,
    tracks: Tracks,
    maneuvers: IntruderManeuvers,
    weights: SeparationWeights,
    breach_ratio: float,
    *,
    horizon_s: float,
    soon_s: float,
) -> tuple[Array, Array]:
    """The cost of lost separation, (K,), and the closest separation from tracks that fly on, (K,).

    Tracks that fly on count within `horizon_s`. Each maneuver counts within `soon_s`, with its probability.
    `breach_ratio` is the separation below which the bare volume counts as entered.
    """
    cost, closest = kernels.losses(
        paths,
        tracks,
        maneuvers,
        weights,
        breach_ratio,
        KERNEL_TIMES,
        count_until(horizon_s),
        count_until(soon_s),
    )
    return cost, closest


def heights_to_pass(tracks: Tracks, motion: RelativeMotion, conflict: Mask) -> tuple[float, float, float]:
    """Heights that pass over and under all tracks in conflict, (N,) [m], and when all are passed [s].

    The height of a track matters while it is within the horizontal volume, around the closest approach.
    """
    over_m, under_m, passed_s = kernels.heights_to_pass(
        tracks,
        motion.own_velocity_mps,
        motion.time_to_closest_s,
        conflict,
        _LONGEST_CROSSING_S,
        HORIZON_S,
        _ROOM,
    )
    return over_m, under_m, min(passed_s, HORIZON_S)


def outcomes(
    paths: Paths,
    tracks: Tracks,
    index: int,
    mission_m: Array,
    onward_mps: Vec2,
    altitude_m: float,
    *,
    aside: float,
    unresolved: float,
) -> Array:
    """The cost of the situations that ground paths lead to at one time of the prediction, (H,).

    `aside` is the price of each metre from `mission_m`, the place of the mission at that time, (2,).
    `unresolved` is the price of entering the worst volume through its middle when flying straight on from
    there with `onward_mps` at `altitude_m`.
    """
    cost: Array = kernels.outcomes(
        paths, tracks, index, mission_m, aside, unresolved, *onward_mps, altitude_m, KERNEL_TIMES
    )
    return cost
