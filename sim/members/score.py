"""Scores of a formation: the distance of each pair, and the safety value over time (paper, eq. 3)."""

import itertools
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.avoidance.group.formation import FormationParams
from companion.model import Vec3

# Members nearer than this, in both, have lost their separation.
SMALLEST_M, SMALLEST_VERTICAL_M = FormationParams().smallest_m, FormationParams().smallest_vertical_m
_GRID_S = 0.05
_SAFETY_EVERY_S = 1.0


@dataclass(frozen=True, slots=True)
class Moment:
    """A member at a time since the start: its position, and whether it is in the air on its mission."""

    elapsed_s: float
    position_m: Vec3
    under_way: bool


@dataclass
class PairScore:
    """The smallest distances of two members while both are under way.

    `vertical_m` belongs to `min_horizontal_m`.
    """

    members: tuple[str, str]
    min_slant_m: float = math.inf
    min_slant_at_s: float = math.nan
    min_horizontal_m: float = math.inf
    vertical_m: float = math.inf
    separation_lost: bool = False

    def update(self, elapsed_s: float, one_m: Vec3, other_m: Vec3) -> float:
        """Update with both positions; returns their distance [m]."""
        horizontal_m = math.hypot(other_m[0] - one_m[0], other_m[1] - one_m[1])
        vertical_m = abs(other_m[2] - one_m[2])
        slant_m = math.hypot(horizontal_m, vertical_m)
        if slant_m < self.min_slant_m:
            self.min_slant_m, self.min_slant_at_s = slant_m, elapsed_s
        if horizontal_m < self.min_horizontal_m:
            self.min_horizontal_m, self.vertical_m = horizontal_m, vertical_m
        self.separation_lost |= horizontal_m < SMALLEST_M and vertical_m < SMALLEST_VERTICAL_M
        return slant_m

    def report(self) -> dict[str, object]:
        """The score for the JSON report."""
        return {
            "members": list(self.members),
            "min_slant_m": _rounded(self.min_slant_m),
            "min_slant_at_s": _rounded(self.min_slant_at_s),
            "min_horizontal_m": _rounded(self.min_horizontal_m),
            "vertical_m": _rounded(self.vertical_m),
            "separation_lost": self.separation_lost,
        }


@dataclass
class SafetyValue:
    """The mean distance between all pairs (eq. 3) [m], once a second while all members are under way."""

    values_m: list[float] = field(default_factory=list)

    def mean_m(self, seconds: int | None = None) -> float | None:
        """The mean, of the first seconds only if given; `None` without values."""
        values_m = self.values_m[:seconds]
        return sum(values_m) / len(values_m) if values_m else None


class FormationScore:
    """All pairs and the safety value; `add` takes each member's moments in the order of time.

    Members need not move at the same moments: distances are taken at common times, with straight motion
    between the moments of each.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.pairs = {pair: PairScore(pair) for pair in itertools.combinations(names, 2)}
        self.safety = SafetyValue()
        self._moments: dict[str, deque[Moment]] = {name: deque() for name in names}
        self._steps = 0

    @property
    def separation_lost(self) -> bool:
        """True if any two members came too near."""
        return any(pair.separation_lost for pair in self.pairs.values())

    def closest_of(self, name: str) -> PairScore:
        """The pair of this member that was nearest so far."""
        of_member = [pair for pair in self.pairs.values() if name in pair.members]
        return min(of_member, key=lambda pair: pair.min_slant_m)

    def add(self, name: str, moment: Moment) -> None:
        """Add a member's newest moment, and measure up to the time that all have reached."""
        self._moments[name].append(moment)
        while all(
            each and each[-1].elapsed_s >= self._steps * _GRID_S - 1e-6 for each in self._moments.values()
        ):
            self._measure(self._steps * _GRID_S)
            self._steps += 1

    def _measure(self, elapsed_s: float) -> None:
        now = {name: _at(elapsed_s, moments) for name, moments in self._moments.items()}
        slants_m = [
            pair.update(elapsed_s, now[one].position_m, now[other].position_m)
            for (one, other), pair in self.pairs.items()
            if now[one].under_way and now[other].under_way
        ]
        is_due = self._steps % round(_SAFETY_EVERY_S / _GRID_S) == 0
        if is_due and len(slants_m) == len(self.pairs):
            self.safety.values_m.append(sum(slants_m) / len(slants_m))


def _at(elapsed_s: float, moments: deque[Moment]) -> Moment:
    """The member at a time, from its moments around it; forgets those before."""
    while len(moments) > 1 and moments[1].elapsed_s <= elapsed_s:
        moments.popleft()
    before = moments[0]
    if len(moments) == 1 or before.elapsed_s >= elapsed_s:
        return before
    after = moments[1]
    share = (elapsed_s - before.elapsed_s) / (after.elapsed_s - before.elapsed_s)
    north_m, east_m, down_m = (
        a + share * (b - a) for a, b in zip(before.position_m, after.position_m, strict=True)
    )
    return Moment(elapsed_s, (north_m, east_m, down_m), before.under_way)


def _rounded(value: float) -> float | None:
    return round(value, 1) if math.isfinite(value) else None
