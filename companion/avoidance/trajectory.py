"""Trajectories: where rows of commands lead.

The motion is the paper's (§2.1, eq. 1-2; its print has the cosine twice, y takes the sine): a point that
moves where its nose points, here with the limits of §3.2.3 and a response time. The aircraft answers a
command after `response_s`, turns at its bank limit, climbs and sinks at its limits, and holds what it has
reached. The wind carries it along. A command's course is over ground, and holding it takes a crab angle.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.envelope import Envelope
from companion.avoidance.geometry import Array
from companion.avoidance.own_flight import OwnState
from companion.avoidance.prediction_times import KERNEL_TIMES
from companion.compiled import kernels
from companion.model import Guidance
from companion.units import wrap_two_pi


@dataclass(frozen=True, slots=True)
class Commands:
    """Rows of commands. Ground paths and heights that rows share are stored, and flown ahead, once.

    Ground paths are `course_rad` over ground and `airspeed_mps`, (H,). Heights are `altitude_m`, (Z,). Row k
    is the ground path at index `ground_of[k]` and the height at index `height_of[k]`, (K,) both.
    """

    course_rad: Array
    airspeed_mps: Array
    altitude_m: Array
    ground_of: NDArray[np.intp]
    height_of: NDArray[np.intp]

    @classmethod
    def of(cls, rows: Sequence[Guidance]) -> "Commands":
        """One ground path and one height for each row."""
        indices = _indices(len(rows))
        return cls(
            np.array([row.course_rad for row in rows]),
            np.array([row.airspeed_mps for row in rows]),
            np.array([row.altitude_m for row in rows]),
            indices,
            indices,
        )

    def __len__(self) -> int:
        return len(self.ground_of)

    def row(self, index: int) -> Guidance:
        """One row as a guidance."""
        ground, height = self.ground_of[index], self.height_of[index]
        return Guidance(
            wrap_two_pi(float(self.course_rad[ground])),
            float(self.airspeed_mps[ground]),
            float(self.altitude_m[height]),
        )

    def subset(self, indices: NDArray[np.intp]) -> "Commands":
        """The rows at the given indices, in that order."""
        return Commands(
            self.course_rad,
            self.airspeed_mps,
            self.altitude_m,
            self.ground_of[indices],
            self.height_of[indices],
        )

    def preceded_by(self, first: Guidance) -> "Commands":
        """The same rows after one more, which becomes row 0."""
        return Commands(
            np.concatenate([self.course_rad, [first.course_rad]]),
            np.concatenate([self.airspeed_mps, [first.airspeed_mps]]),
            np.concatenate([self.altitude_m, [first.altitude_m]]),
            np.concatenate([[len(self.course_rad)], self.ground_of]),
            np.concatenate([[len(self.altitude_m)], self.height_of]),
        )


@cache
def _indices(count: int) -> NDArray[np.intp]:
    indices = np.arange(count)
    indices.setflags(write=False)
    return indices


class Paths(NamedTuple):
    """Rows flown ahead: `ground_m` (H, T, 2) north and east, `altitude_m` (Z, T), rows as in `Commands`."""

    ground_m: Array
    altitude_m: Array
    ground_of: NDArray[np.intp]
    height_of: NDArray[np.intp]

    def row_m(self, row: int) -> Array:
        """Positions north-east-down along one row, (T, 3)."""
        ground, altitude = self.ground_m[self.ground_of[row]], self.altitude_m[self.height_of[row]]
        return np.column_stack([ground, -altitude])


def fly_ahead(own: OwnState, commands: Commands, envelope: Envelope) -> Paths:
    """Paths of all rows at the times of the prediction."""
    return Paths(
        _ground_m(own, commands.course_rad, commands.airspeed_mps, envelope),
        _altitude_m(own, commands.altitude_m, envelope),
        commands.ground_of,
        commands.height_of,
    )


def _ground_m(own: OwnState, target_rad: Array, target_mps: Array, envelope: Envelope) -> Array:
    """Ground paths by eq. 2, (H, T, 2): turn at the bank limit, change speed, hold.

    The nose turns the way round that is short for the course, as autopilots do.
    """
    path_m: Array = kernels.ground_paths(
        own.position_m[0],
        own.position_m[1],
        own.course_rad,
        own.crab_rad,
        own.airspeed_mps,
        own.wind_mps[0],
        own.wind_mps[1],
        target_rad,
        target_mps,
        envelope.turn_acceleration_mps2,
        envelope.max_turn_rate_radps,
        envelope.response_s,
        envelope.max_acceleration_mps2,
        KERNEL_TIMES,
    )
    return path_m


def _altitude_m(own: OwnState, target_m: Array, envelope: Envelope) -> Array:
    """Heights, (Z, T): the present climb during the response time, then the limit, then the target."""
    now_m = -own.position_m[2]
    climb_mps = min(max(own.climb_mps, -2.0 * envelope.max_sink_mps), 2.0 * envelope.max_climb_mps)
    altitude_m: Array = kernels.altitudes(
        now_m,
        climb_mps,
        target_m,
        envelope.response_s,
        envelope.max_sink_mps,
        envelope.max_climb_mps,
        KERNEL_TIMES,
    )
    return altitude_m


def turn_around_s(own: OwnState, envelope: Envelope) -> float:
    """Time to reach the opposite course at the present airspeed [s].

    In a crosswind the nose turns by more than half a circle: by twice the largest crab angle more.
    """
    wind = min(math.hypot(*own.wind_mps) / own.airspeed_mps, 1.0)
    turn_rad = math.pi + 2.0 * math.asin(wind)
    return envelope.response_s + turn_rad / envelope.turn_rate_radps(own.airspeed_mps)
