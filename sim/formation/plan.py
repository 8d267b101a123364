"""The plan of a formation campaign: how many members, which crossings, avoiders and radios."""

from dataclasses import asdict, dataclass, field
from itertools import product

from companion.errors import ConfigError
from sim.campaign.plan import Part
from sim.campaign.results import ResultLine
from sim.encounters import surveillance_of
from sim.formation.crossing import Crossing, crossing
from sim.formation.engines import AVOIDERS, COMPANION, Separation, engine_of
from sim.formation.flight import Conditions
from sim.formation.radio import RadioQuality

LARGEST = 10


@dataclass(frozen=True)
class FormationPlan:
    """A formation campaign. The same plan and number give the same crossing and result on any machine.

    `surveillance` is what the members hear of a stranger; among each other they have the radio.
    """

    members: int
    encounters: int
    seed: int = 0
    avoiders: tuple[str, ...] = (COMPANION,)
    losses: tuple[float, ...] = (0.0,)
    delays_s: tuple[float, ...] = (0.0,)
    separation: Separation = field(default_factory=Separation)
    surveillance: str = "perfect"
    part: Part = Part.ALL
    ticks_hz: int = 5
    falls_silent: bool = False

    def __post_init__(self) -> None:
        if not 2 <= self.members <= LARGEST:
            raise ConfigError(f"--formation {self.members}: a formation has 2 to {LARGEST} members")
        for name in self.avoiders:
            if name not in AVOIDERS:
                raise ConfigError(f"--avoider {name}: with --formation there are {', '.join(AVOIDERS)}")
        surveillance_of(self.surveillance)
        if self.separation.smallest_m > self.separation.wanted_m:
            raise ConfigError("--separation must not exceed the wanted separation")

    @property
    def radios(self) -> dict[str, RadioQuality]:
        """The radios by their labels."""
        qualities = (RadioQuality(*one) for one in product(self.losses, self.delays_s))
        return {quality.label: quality for quality in qualities}

    @property
    def flights(self) -> int:
        """Number of flights: each crossing by each avoider with each radio."""
        return self.encounters * len(self.avoiders) * len(self.radios)

    def numbers(self) -> range:
        """The numbers of the plan's crossings."""
        return self.part.numbers(self.encounters)

    def identity(self) -> dict[str, object]:
        """The settings that all results of one file share."""
        varied = ("encounters", "avoiders", "losses", "delays_s")
        return {"formation": {k: v for k, v in asdict(self).items() if k not in varied}}

    def wants(self, result: ResultLine) -> bool:
        """True for a result of this plan."""
        return (
            result["avoider"] in self.avoiders
            and result["radio"] in self.radios
            and result["number"] in self.numbers()
        )

    def crossing(self, number: int) -> Crossing:
        """A crossing by its number."""
        return crossing(self.members, self.seed, number, self.separation.smallest_m)

    def conditions(self, radio: str) -> Conditions:
        """How the crossings are flown with a radio."""
        surveillance = surveillance_of(self.surveillance)
        quality = self.radios[radio]
        return Conditions(quality, surveillance, self.separation, self.ticks_hz, self.falls_silent)

    def check(self) -> None:
        """`ConfigError` if an avoider's library is missing."""
        limits = self.crossing(0).missions[0].limits
        for avoider in self.avoiders:
            engine_of(avoider, 1, limits, self.separation)
