"""What a campaign flies: which encounters, by whom, and what is known of the traffic."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path

from companion.avoidance import Avoider
from companion.control.state_machine import SupervisorParams
from companion.engine import Engine, EngineConfig, EngineParams
from companion.errors import ConfigError
from companion.ownship.performance_limits import AircraftLimits
from sim.campaign.peer_avoider import PeerAvoider
from sim.campaign.plane import Limits
from sim.campaign.results import Result
from sim.encounters import (
    SURVEILLANCE_PRESETS,
    Encounter,
    EncounterModel,
    Surveillance,
    generate,
    read_encounters,
    read_model,
    sample,
)
from sim.peers import PEERS, PeerLimits, make_peer

COMPANION, NONE = "companion", "none"
# With the height locked, floor and ceiling are so far from the mission's height.
_SLACK_M = 1.0
_MODEL, _FILES = ".txt", (".csv", ".daa")


class Part(StrEnum):
    """Which of the encounters: tuning looks at one half, and what is quoted comes from the other."""

    ALL = "all"
    TUNING = "tuning"  # even numbers
    EVALUATION = "evaluation"  # odd numbers


@dataclass(frozen=True, slots=True)
class Given:
    """What a plan's models or files hold, so that whoever flies it elsewhere needs none of them."""

    models: tuple[EncounterModel, ...] = ()
    encounters: tuple[Encounter, ...] = ()


@dataclass(frozen=True)
class Plan:
    """A campaign. The same plan and number give the same encounter, flight and result, wherever flown."""

    encounters: int
    seed: int = 0
    avoiders: tuple[str, ...] = (COMPANION,)
    models: tuple[str, ...] = ()
    surveillance: tuple[str, ...] = ("perfect",)
    intruders: int = 1
    lock_height: bool = False
    part: Part = Part.ALL

    def __post_init__(self) -> None:
        for name in self.avoiders:
            if name != COMPANION and name not in PEERS:
                raise ConfigError(f"--avoider {name}: there are {COMPANION}, {', '.join(PEERS)}")
        for name in self.surveillance:
            if name not in SURVEILLANCE_PRESETS:
                raise ConfigError(f"--surveillance {name}: there are {', '.join(SURVEILLANCE_PRESETS)}")

    @property
    def limits(self) -> Limits:
        """What the aircraft can do."""
        return Limits(slack_m=_SLACK_M) if self.lock_height else Limits()

    @property
    def known(self) -> Surveillance:
        """How well the traffic is known, in the first of what is flown."""
        return SURVEILLANCE_PRESETS[self.surveillance[0]]

    @property
    def flights(self) -> int:
        """How many are flown: each encounter by each avoider with each surveillance."""
        return self.encounters * len(self.avoiders) * len(self.surveillance)

    def identity(self) -> dict[str, object]:
        """What must be the same for results to belong together: all but how many, whose, and how known."""
        return {k: v for k, v in asdict(self).items() if k not in ("encounters", "avoiders", "surveillance")}

    def wants(self, result: Result) -> bool:
        """Whether a result is one of this plan's."""
        return (
            result["avoider"] in self.avoiders
            and result["surveillance"] in self.surveillance
            and result["number"] in self.numbers()
        )

    def numbers(self) -> range:
        """The numbers of the encounters, `encounters` of them."""
        if self.part is Part.ALL:
            return range(self.encounters)
        return range(int(self.part is Part.EVALUATION), 2 * self.encounters, 2)

    def given(self) -> Given:
        """Read the models or files. `ConfigError` when it cannot."""
        paths = [Path(name) for name in self.models]
        files = [path for path in paths if path.suffix.lower() in _FILES]
        if not files:
            return Given(models=tuple(read_model(path) for path in paths))
        if len(files) < len(paths):
            raise ConfigError("--model: either models, or files of encounters")
        return Given(encounters=tuple(one for path in files for one in read_encounters(path)))

    def source(self, given: Given | None = None) -> Callable[[int], Encounter]:
        """From a number to its encounter; reads what it is not given. `ConfigError` when it cannot."""
        given = given or self.given()
        listed, models = given.encounters, given.models
        if listed:
            # A file's encounters are flown over and over, each time with other errors of surveillance.
            return lambda number: replace(
                listed[number % len(listed)],
                encounter_id=f"{listed[number % len(listed)].encounter_id}#{number}",
            )
        if models:
            return lambda number: sample(models, self.seed, number, intruders=self.intruders)
        return lambda number: generate("mix", self.seed, number)

    def check(self) -> None:
        """`ConfigError` when a model, a file or what an avoider needs is missing."""
        self.source()
        for avoider in self.avoiders:
            self.engine_for(avoider)(generate("level", 0, 0))

    def engine_for(self, avoider: str) -> Callable[[Encounter], Engine]:
        """What makes the engine that flies an encounter."""
        limits = self.limits
        aircraft = AircraftLimits(
            min_airspeed_mps=limits.min_airspeed_mps,
            max_airspeed_mps=limits.max_airspeed_mps,
            max_bank_rad=limits.max_bank_rad,
            max_climb_mps=limits.max_climb_mps,
            max_sink_mps=limits.max_climb_mps,
        )

        def make(encounter: Encounter) -> Engine:
            height_m = -encounter.own_position_m[2]
            slack_m = limits.slack_m
            floor_m, ceiling_m = (0.0, None) if slack_m is None else (height_m - slack_m, height_m + slack_m)
            config = EngineConfig(
                engine=EngineParams(autopilot_system_id=1, max_height_m=ceiling_m),
                supervisor=SupervisorParams(min_height_m=max(floor_m, 0.0)),
                aircraft=aircraft,
            )
            return Engine(config, avoider=self._peer(avoider, config, floor_m, ceiling_m))

        return make

    def _peer(
        self, avoider: str, config: EngineConfig, floor_m: float, ceiling_m: float | None
    ) -> Avoider | None:
        if avoider == COMPANION:
            return None
        limits = self.limits
        peer = make_peer(
            avoider,
            PeerLimits(
                min_airspeed_mps=limits.min_airspeed_mps,
                max_airspeed_mps=limits.max_airspeed_mps,
                max_bank_rad=limits.max_bank_rad,
                max_climb_mps=limits.max_climb_mps,
                max_sink_mps=limits.max_climb_mps,
                floor_m=floor_m,
                ceiling_m=ceiling_m,
            ),
        )
        return PeerAvoider(config.avoidance, peer)
