"""Scores of a flight: closest approaches by the standards' definitions, and deviation from the path."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.model import Threat, Vec2, Vec3
from companion.units import (
    NMAC_HORIZONTAL_M,
    NMAC_VERTICAL_M,
    WELL_CLEAR_HORIZONTAL_M,
    WELL_CLEAR_VERTICAL_M,
)
from sim.path import Polyline, thinned_path
from sim.scenario import Scenario
from sim.traffic import Intruder
from sim.vehicle import Truth
from sim.world import World, undisturbed

_ROUNDING_M = 1e-6


@dataclass
class EncounterScore:
    """One intruder's closest approach so far; `vertical_m` belongs to `min_horizontal_m`."""

    icao: int
    callsign: str
    min_slant_m: float = math.inf
    min_slant_time_s: float = math.nan
    min_horizontal_m: float = math.inf
    vertical_m: float = math.inf
    nmac: bool = False
    lowc: bool = False
    first_action_s: float | None = None

    def update(self, time_s: float, own_m: Vec3, other_m: Vec3) -> None:
        """Update with both positions, north-east-down [m]."""
        horizontal_m = math.hypot(other_m[0] - own_m[0], other_m[1] - own_m[1])
        vertical_m = abs(other_m[2] - own_m[2])
        slant_m = math.hypot(horizontal_m, vertical_m)
        if slant_m < self.min_slant_m:
            self.min_slant_m, self.min_slant_time_s = slant_m, time_s
        if horizontal_m < self.min_horizontal_m:
            self.min_horizontal_m, self.vertical_m = horizontal_m, vertical_m
        self.nmac |= horizontal_m < NMAC_HORIZONTAL_M and vertical_m < NMAC_VERTICAL_M
        self.lowc |= horizontal_m < WELL_CLEAR_HORIZONTAL_M and vertical_m < WELL_CLEAR_VERTICAL_M

    def report(self) -> dict[str, object]:
        """The score for the JSON report; `first_action_s` counts from the start of the scenario."""
        return {
            "icao": f"{self.icao:06X}",
            "callsign": self.callsign,
            "min_slant_m": _rounded(self.min_slant_m),
            "min_horizontal_m": _rounded(self.min_horizontal_m),
            "vertical_m": _rounded(self.vertical_m),
            "nmac": self.nmac,
            "lowc": self.lowc,
            "first_action_s": None if self.first_action_s is None else round(self.first_action_s, 1),
        }


def _rounded(length_m: float) -> float | None:
    return round(length_m, 1) if math.isfinite(length_m) else None


@dataclass
class FlightScore:
    """The scores of one flight: its encounters, and its largest deviation from the planned path.

    `planned` is the path without avoidance, north-east [m]; `start_s` is the start of the scenario.
    """

    intruders: Sequence[Intruder]
    planned: Sequence[Vec2]
    start_s: float
    max_deviation_m: float = 0.0
    encounters: dict[str, EncounterScore] = field(init=False)

    def __post_init__(self) -> None:
        self.encounters = {f"{i.icao:06X}": EncounterScore(i.icao, i.callsign) for i in self.intruders}
        self._path = Polyline(self.planned)
        self._measured_at_m: Vec2 = (math.inf, math.inf)
        self._measured_m = 0.0

    def update(self, time_s: float, own_m: Vec3) -> None:
        """Update with our present position, north-east-down [m]."""
        for intruder in self.intruders:
            if intruder.appears_s <= time_s <= intruder.disappears_s:
                position_m, _ = intruder.state_at(time_s)
                self.encounters[f"{intruder.icao:06X}"].update(time_s, own_m, position_m)
        self._measure_deviation(own_m[:2])

    def _measure_deviation(self, own_m: Vec2) -> None:
        """Update the largest deviation, if it can have grown on the way since the last measurement."""
        if self._measured_m + math.dist(own_m, self._measured_at_m) < self.max_deviation_m - _ROUNDING_M:
            return
        self._measured_at_m, self._measured_m = own_m, self._path.distance_m(own_m)
        self.max_deviation_m = max(self.max_deviation_m, self._measured_m)

    def note_action(self, time_s: float, threats: Sequence[Threat]) -> None:
        """Record that avoidance of these is flown."""
        for threat in threats:
            encounter = self.encounter_of(threat)
            if encounter is not None and encounter.first_action_s is None:
                encounter.first_action_s = time_s - self.start_s

    def encounter_of(self, threat: Threat) -> EncounterScore | None:
        """The encounter with a threat, by its address, or by its callsign if it was heard without one."""
        by_address = self.encounters.get(threat.track_id)
        if by_address is not None:
            return by_address
        return next((each for each in self.encounters.values() if each.callsign == threat.name), None)


def score_of(scenario: Scenario, world: World) -> FlightScore:
    """An empty score for a flight of this scenario, against its path without avoidance."""
    return score_against(undisturbed(scenario, world.start_s, 1.0), world)


def score_against(planned: Sequence[Truth], world: World) -> FlightScore:
    """An empty score for a flight in this world, against the path of these states."""
    places = [(truth.position_m[0], truth.position_m[1]) for truth in planned]
    return FlightScore(world.intruders, thinned_path(places), world.start_s)
