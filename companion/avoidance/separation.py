"""Separation: how clear of the predicted tracks rows of commands stay, and what that costs.

Rows come first, then tracks, then time: (K, N, T). Tracks keep their velocity, and their turns decay.
"""

from typing import NamedTuple, Protocol

from companion.avoidance.geometry import Array, Mask, RelativeMotion
from companion.avoidance.maneuvers import IntruderManeuvers
from companion.avoidance.tracks import Tracks
from companion.avoidance.trajectory import HORIZON_S, KERNEL_TIMES, Paths, count_until
from companion.compiled import kernels
from companion.model import Vec2

# Caps the crossing time at very low closure.
_LONGEST_CROSSING_S = 30.0
# In protected heights. Slightly more than 1, so that a row at this height costs nothing.
_ROOM = 1.02


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
