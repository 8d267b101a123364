"""The same flight with each layer alone, in lockstep and beside each other, for comparison."""

import asyncio
import signal
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing import get_context

from companion.avoidance.params import Layers
from sim.members.loop import fly_formation
from sim.members.scenario import FormationScenario
from sim.members.score import FormationScore, SafetyValue

ALONE = (Layers.OUTER, Layers.INNER)
_LOOKED_EVERY_S = 0.1


@dataclass(frozen=True, slots=True)
class Compared:
    """What is compared of a flight; `smallest_m` is the smallest distance of any pair [m]."""

    mission_completed: bool
    smallest_m: float
    separation_lost: bool
    safety: SafetyValue

    @classmethod
    def of(cls, score: FormationScore, *, mission_completed: bool) -> "Compared":
        """The figures of a flight by its score."""
        smallest_m = min(pair.min_slant_m for pair in score.pairs.values())
        return cls(mission_completed, smallest_m, score.separation_lost, score.safety)


async def fly_alone(scenario: FormationScenario, seed: int) -> dict[str, Compared]:
    """The flights with each layer alone, by its name; each is flown by a process of its own."""
    with get_context("spawn").Pool(len(ALONE), _ignore_interrupts) as pool:  # its end ends the processes
        flights = {str(layers): pool.apply_async(_fly, (scenario, layers, seed)) for layers in ALONE}
        while not all(flight.ready() for flight in flights.values()):  # noqa: ASYNC110 - of other processes
            await asyncio.sleep(_LOOKED_EVERY_S)
        return {name: flight.get() for name, flight in flights.items()}


def _ignore_interrupts() -> None:
    """Leave Ctrl-C to the process that waits for this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _fly(scenario: FormationScenario, layers: Layers, seed: int) -> Compared:
    flight = fly_formation(scenario, layers=layers, seed=seed)
    return Compared.of(flight.score, mission_completed=flight.mission_completed)


def safety_report(flights: Mapping[str, Compared]) -> dict[str, object]:
    """The safety values for the JSON report.

    Flying apart or around for longer raises the mean: `common_mean_m` is that of the seconds in which all
    compared flights have all members under way.
    """
    common_s = min(len(flight.safety.values_m) for flight in flights.values())
    return {
        name: {
            "mean_m": _rounded(flight.safety.mean_m()),
            "common_mean_m": _rounded(flight.safety.mean_m(common_s)),
            "mission_completed": flight.mission_completed,
            "min_slant_m": round(flight.smallest_m, 1),
            "separation_lost": flight.separation_lost,
            "each_second_m": [round(value_m, 1) for value_m in flight.safety.values_m],
        }
        for name, flight in flights.items()
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 1)
