"""Tracks as arrays: the traffic that is predicted, with the volumes to keep clear of."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.geometry import Array, Mask
from companion.avoidance.trajectory import KERNEL_TIMES
from companion.compiled import kernels


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
