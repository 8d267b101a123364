"""What the autopilot refused to fly lately: rows that ask for it again are left out for a while."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.avoidance.control import Control
from companion.avoidance.geometry import Array, wrap_pi
from companion.avoidance.trajectory import Commands
from companion.model import Guidance

# What makes an autopilot refuse (a limit, a mode, a fence of its own) may have changed after so long.
REFUSED_FOR_S = 30.0
# A value as near as this to a refused one would be refused too; the wire rounds, and rows move a little from
# one decision to the next.
_TOLERANCES = {Control.HEADING: math.radians(2.0), Control.SPEED: 0.5, Control.HEIGHT: 5.0}


@dataclass(frozen=True, slots=True)
class Refusal:
    """One value of one control [rad, m/s or m, as in `Guidance`], refused until `until_s`."""

    control: Control
    value: float
    until_s: float

    def matches(self, control: Control, values: Array) -> NDArray[np.bool_]:
        """Which values of a control would be refused too, shape of the values."""
        if control is not self.control:
            return np.zeros(len(values), dtype=bool)
        off = values - self.value
        if control is Control.HEADING:
            off = wrap_pi(off)
        same: NDArray[np.bool_] = np.abs(off) <= _TOLERANCES[control]
        return same


@dataclass(frozen=True, slots=True)
class Refusals:
    """All that was refused and is not forgotten."""

    refused: tuple[Refusal, ...] = ()

    def at(self, now_s: float) -> "Refusals":
        """Those that still count; where time ran backwards, none of what lies ahead."""
        if not self.refused:
            return self
        return Refusals(tuple(r for r in self.refused if now_s < r.until_s <= now_s + REFUSED_FOR_S))

    def noting(self, control: Control, value: float, now_s: float) -> "Refusals":
        """With one more."""
        return Refusals((*self.at(now_s).refused, Refusal(control, value, now_s + REFUSED_FOR_S)))

    def allow(self, guidance: Guidance) -> bool:
        """Whether nothing of a guidance was refused."""
        return not self.refused or len(self._kept(Commands.of([guidance]))) > 0

    def instead(self, held: Guidance, mission: Guidance, commands: Commands) -> Guidance | None:
        """What is held, with the mission's own value in the place of a refused one.

        `None` when that is refused as well, while there are rows that are not: they begin anew.
        """
        held = self.without(Commands.of([held]), mission).row(0)
        return held if self.allow(held) or not len(self._kept(commands)) else None

    def without(self, commands: Commands, mission: Guidance) -> Commands:
        """The rows that ask for nothing refused.

        When there is none, all of them, with the mission's own value in the place of each refused one: what
        the mission flies is the last thing that an autopilot should refuse, and silence would fly on blindly.
        """
        kept = self._kept(commands)
        if len(kept) > 0:
            return commands.only(kept)
        course, speed, height = self._hits(commands)
        return Commands(
            np.where(course, mission.course_rad, commands.course_rad),
            np.where(speed, mission.airspeed_mps, commands.airspeed_mps),
            np.where(height, mission.altitude_m, commands.altitude_m),
            commands.ground_of,
            commands.height_of,
        )

    def _kept(self, commands: Commands) -> NDArray[np.intp]:
        course, speed, height = self._hits(commands)
        return np.flatnonzero(~((course | speed)[commands.ground_of] | height[commands.height_of]))

    def _hits(self, commands: Commands) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
        return (
            self._hit(Control.HEADING, commands.course_rad),
            self._hit(Control.SPEED, commands.airspeed_mps),
            self._hit(Control.HEIGHT, commands.altitude_m),
        )

    def _hit(self, control: Control, values: Array) -> NDArray[np.bool_]:
        hit = np.zeros(len(values), dtype=bool)
        for refusal in self.refused:
            hit |= refusal.matches(control, values)
        return hit
