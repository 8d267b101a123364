"""The plan of a campaign: which encounters, which avoiders, which surveillance."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path

from companion.control.rejoin import RejoinMode
from companion.engine import Engine
from companion.errors import ConfigError
from sim.campaign.avoiders import COMPANION, engine_for
from sim.campaign.changes import Changes, changed
from sim.campaign.plane import Limits
from sim.campaign.results import ResultLine
from sim.campaign.route import Route, legs
from sim.campaign.two_sided import is_flyable
from sim.dynamics import AIRFRAMES
from sim.encounters import (
    Encounter,
    EncounterModel,
    Surveillance,
    generate,
    read_encounters,
    read_model,
    sample,
    surveillance_of,
)
from sim.peers import PEERS

# With the height locked: distance of floor and ceiling from the mission's height.
_SLACK_M = 1.0
_FILES = (".csv", ".daa")
# Settings that results files name only where they differ from these.
_LATER: dict[str, object] = {"two_sided": False, "avoidance": (), "own_limits": ()}
# The end of an avoider's name if both aircraft of a two-sided encounter fly it.
BOTH = "-both"
# An encounter whose intruder cannot fly Companion is drawn again with a number further on by this.
_DRAWN_AGAIN = 10_000_000


class Part(StrEnum):
    """The encounters flown: all, the half for tuning, or the half for quoted results."""

    ALL = "all"
    TUNING = "tuning"  # even numbers
    EVALUATION = "evaluation"  # odd numbers

    def numbers(self, count: int) -> range:
        """The numbers of so many encounters."""
        if self is Part.ALL:
            return range(count)
        return range(int(self is Part.EVALUATION), 2 * count, 2)


@dataclass(frozen=True, slots=True)
class Inputs:
    """The content of a plan's models or files, so that workers elsewhere need no files."""

    models: tuple[EncounterModel, ...] = ()
    encounters: tuple[Encounter, ...] = ()


@dataclass(frozen=True)
class Plan:
    """A campaign. The same plan and number give the same encounter and result on any machine.

    `avoidance` are changed values of `AvoidanceParams`, `own_limits` those of the aircraft's `Limits`.
    """

    encounters: int
    seed: int = 0
    avoiders: tuple[str, ...] = (COMPANION,)
    models: tuple[str, ...] = ()
    surveillance: tuple[str, ...] = ("perfect",)
    intruders: int = 1
    lock_height: bool = False
    part: Part = Part.ALL
    legs: bool = False
    rejoin: RejoinMode = "line"
    airframe: str = "ardupilot"
    two_sided: bool = False
    avoidance: Changes = ()
    own_limits: Changes = ()

    def __post_init__(self) -> None:
        for name in map(self.method_of, self.avoiders):
            if name != COMPANION and name not in PEERS:
                raise ConfigError(f"--avoider {name}: there are {COMPANION}, {', '.join(PEERS)}")
        for name in self.surveillance:
            surveillance_of(name)
        if self.airframe not in AIRFRAMES:
            raise ConfigError(f"--airframe {self.airframe}: there are {', '.join(AIRFRAMES)}")

    @property
    def limits(self) -> Limits:
        """The limits of the aircraft."""
        slack_m = _SLACK_M if self.lock_height else None
        return changed(Limits(slack_m=slack_m, dynamics=AIRFRAMES[self.airframe]), self.own_limits)

    @property
    def first_surveillance(self) -> Surveillance:
        """The first of the plan's surveillance presets."""
        return surveillance_of(self.surveillance[0])

    @property
    def flights(self) -> int:
        """Number of flights: each encounter by each avoider with each surveillance."""
        return self.encounters * len(self.avoiders) * len(self.surveillance)

    def identity(self) -> dict[str, object]:
        """The settings that all results of one file share: all but number, avoiders and surveillance."""
        varied = {"encounters", "avoiders", "surveillance"}
        varied |= {name for name, usual in _LATER.items() if getattr(self, name) == usual}
        return {k: v for k, v in asdict(self).items() if k not in varied}

    def method_of(self, avoider: str) -> str:
        """The method of an avoider, without the mark that both aircraft fly it."""
        return avoider.removesuffix(BOTH) if self.two_sided else avoider

    def wants(self, result: ResultLine) -> bool:
        """True for a result of this plan."""
        return (
            result["avoider"] in self.avoiders
            and result["surveillance"] in self.surveillance
            and result["number"] in self.numbers()
        )

    def numbers(self) -> range:
        """The numbers of the plan's encounters."""
        return self.part.numbers(self.encounters)

    def inputs(self) -> Inputs:
        """Read the models or files; `ConfigError` if that fails."""
        paths = [Path(name) for name in self.models]
        files = [path for path in paths if path.suffix.lower() in _FILES]
        if not files:
            return Inputs(models=tuple(read_model(path) for path in paths))
        if len(files) < len(paths):
            raise ConfigError("--model: either models, or files of encounters")
        return Inputs(encounters=tuple(one for path in files for one in read_encounters(path)))

    def source(self, inputs: Inputs | None = None) -> Callable[[int], Encounter]:
        """A function from a number to its encounter; without `inputs`, models or files are read."""
        inputs = inputs or self.inputs()
        if not self.two_sided:
            return self._any_source(inputs)
        flyable = tuple(encounter for encounter in inputs.encounters if is_flyable(encounter))
        if inputs.encounters and not flyable:
            raise ConfigError("--two-sided: no intruder in the files flies at 15 to 60 m/s")
        drawn = self._any_source(replace(inputs, encounters=flyable))

        def draw(number: int) -> Encounter:
            while not is_flyable(encounter := drawn(number)):
                number += _DRAWN_AGAIN
            return encounter

        return draw

    def _any_source(self, inputs: Inputs) -> Callable[[int], Encounter]:
        listed, models = inputs.encounters, inputs.models
        if listed:
            # A file's encounters repeat, each time with other surveillance errors.
            return lambda number: replace(
                listed[number % len(listed)],
                encounter_id=f"{listed[number % len(listed)].encounter_id}#{number}",
            )
        if models:
            return lambda number: sample(models, self.seed, number, intruders=self.intruders)
        return lambda number: generate("mix", self.seed, number)

    def route_of(self, encounter: Encounter, number: int) -> Route | None:
        """The mission of an encounter; `None`: its straight line."""
        return legs(encounter, self.seed, number) if self.legs else None

    def check(self) -> None:
        """`ConfigError` if a model, a file or an avoider's library is missing."""
        self.source()
        for avoider in self.avoiders:
            self.engine_for(avoider)(generate("level", 0, 0))

    def engine_for(self, avoider: str, limits: Limits | None = None) -> Callable[[Encounter], Engine]:
        """A function that makes the engine for an encounter, of the plan's aircraft or of these limits."""
        return engine_for(self.method_of(avoider), limits or self.limits, self.rejoin, self.avoidance)
