"""Constraints: what may be flown, by the fence and by the autopilot's refusals. Mostly there is neither."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.fence import Fence
from companion.avoidance.trajectory import (
    HORIZON_S,
    Array,
    Commands,
    Control,
    Envelope,
    Mask,
    OwnState,
    fly_ahead,
    turn_around_s,
)
from companion.model import Guidance

# After this time the reason for a refusal (a limit, a mode, a fence of the autopilot) may have changed.
REFUSED_FOR_S = 30.0
# Values this near to a refused one would be refused too: values are rounded on the wire, and rows change a
# little from one decision to the next.
_TOLERANCES = {Control.HEADING: math.radians(2.0), Control.SPEED: 0.5, Control.HEIGHT: 5.0}


@dataclass(frozen=True, slots=True)
class Refusal:
    """One value of one control [rad, m/s or m, as in `Guidance`], refused until `until_s`."""

    control: Control
    value: float
    until_s: float

    def matches(self, control: Control, values: Array) -> Mask:
        """Which values of a control would be refused too, shape of the values."""
        if control is not self.control:
            return np.zeros(len(values), dtype=bool)
        off = values - self.value
        if control is Control.HEADING:
            off = _wrap_pi(off)
        same: Mask = np.abs(off) <= _TOLERANCES[control]
        return same


@dataclass(frozen=True, slots=True)
class Refusals:
    """All refusals that still count."""

    refused: tuple[Refusal, ...] = ()

    def at(self, now_s: float) -> "Refusals":
        """Those that count at `now_s`; after a step back of time, refusals from later times do not."""
        if not self.refused:
            return self
        return Refusals(tuple(r for r in self.refused if now_s < r.until_s <= now_s + REFUSED_FOR_S))

    def adding(self, control: Control, value: float, now_s: float) -> "Refusals":
        """These refusals and one more."""
        return Refusals((*self.at(now_s).refused, Refusal(control, value, now_s + REFUSED_FOR_S)))

    def allow(self, guidance: Guidance) -> bool:
        """Whether no value of a guidance has been refused."""
        return not self.refused or len(self._allowed(Commands.of([guidance]))) > 0

    def substitute(self, present: Guidance, mission: Guidance, commands: Commands) -> Guidance | None:
        """The present guidance, with the mission's value in place of each refused one.

        `None` if that is refused as well but some of the commands are not: then one of them is chosen as if
        there had been no guidance before.
        """
        present = self.remove_from(Commands.of([present]), mission).row(0)
        return present if self.allow(present) or not len(self._allowed(commands)) else None

    def remove_from(self, commands: Commands, mission: Guidance) -> Commands:
        """The rows without a refused value.

        If no row is left: all rows, with the mission's value in place of each refused one. The mission's
        values are the least likely to be refused, and without a command the aircraft would fly on blindly.
        """
        allowed = self._allowed(commands)
        if len(allowed) > 0:
            return commands.subset(allowed)
        course, speed, height = self._refused_values(commands)
        return Commands(
            np.where(course, mission.course_rad, commands.course_rad),
            np.where(speed, mission.airspeed_mps, commands.airspeed_mps),
            np.where(height, mission.altitude_m, commands.altitude_m),
            commands.ground_of,
            commands.height_of,
        )

    def _allowed(self, commands: Commands) -> NDArray[np.intp]:
        """Indices of the rows without a refused value."""
        course, speed, height = self._refused_values(commands)
        return np.flatnonzero(~((course | speed)[commands.ground_of] | height[commands.height_of]))

    def _refused_values(self, commands: Commands) -> tuple[Mask, Mask, Mask]:
        """Which courses, (H,), airspeeds, (H,), and heights, (Z,), are refused."""
        return (
            self._match_any(Control.HEADING, commands.course_rad),
            self._match_any(Control.SPEED, commands.airspeed_mps),
            self._match_any(Control.HEIGHT, commands.altitude_m),
        )

    def _match_any(self, control: Control, values: Array) -> Mask:
        matched = np.zeros(len(values), dtype=bool)
        for refusal in self.refused:
            matched |= refusal.matches(control, values)
        return matched


class Constraints(NamedTuple):
    """All that limits a guidance. `look_ahead_turns` is the fence's look-ahead, in times to turn around."""

    envelope: Envelope
    fence: Fence | None
    refusals: Refusals
    look_ahead_turns: float

    def allow(self, guidance: Guidance, state: OwnState) -> bool:
        """Whether a guidance stays within the fence and the autopilot has not refused it."""
        return self.refusals.allow(guidance) and self.keeps_fence(
            guidance, state, self.fence_look_ahead_s(state)
        )

    def keeps_fence(self, guidance: Guidance, state: OwnState, until_s: float) -> bool:
        """Whether a guidance stays within the fence until `until_s` from now."""
        if self.fence is None:
            return True
        paths = fly_ahead(state, Commands.of([guidance]), self.envelope)
        return not self.fence.breach(paths, until_s, until_s).deepest_m.any()

    def fence_look_ahead_s(self, state: OwnState) -> float:
        """How far ahead no row may leave the fence; 0 without one [s]."""
        if self.fence is None:
            return 0.0
        return min(self.look_ahead_turns * turn_around_s(state, self.envelope), HORIZON_S)


def _wrap_pi(angle_rad: Array) -> Array:
    """The same angles in [-pi, pi)."""
    wrapped: Array = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
