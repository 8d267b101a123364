"""What a configuration file holds. Parameters live with the maths that uses them; here they come together."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import MinLen
from pydantic import AfterValidator

from companion.address import parse_address
from companion.autopilots import MODE_NAMES
from companion.avoidance import AvoidanceParams
from companion.engine import EngineConfig, EngineParams
from companion.errors import LinkError
from companion.supervisor import SupervisorParams
from companion.traffic import TrafficParams
from companion.traffic.obstacles import Obstacle, ObstacleParams


def _is_address(text: str) -> str:
    try:
        parse_address(text)
    except LinkError as error:
        raise ValueError(str(error)) from error
    return text


def _are_distinct(addresses: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(addresses)) < len(addresses):
        raise ValueError("the same address twice")
    return addresses


@dataclass(frozen=True, slots=True)
class RecordingParams:
    """Where flights are recorded: everything received and sent, and the decisions."""

    enabled: bool = True
    directory: Path = Path("recordings")


@dataclass(frozen=True, slots=True)
class Config:
    """Everything that `companion run` needs to know."""

    # Addresses as in `companion.address`. Whatever comes in by any of them is heard, and all are answered.
    links: Annotated[
        tuple[Annotated[str, AfterValidator(_is_address)], ...], MinLen(1), AfterValidator(_are_distinct)
    ]
    # Which adapter flies the aircraft: "auto" goes by the autopilot's heartbeat.
    autopilot: Literal["auto", "ardupilot", "px4"] = "auto"
    recording: RecordingParams = field(default_factory=RecordingParams)
    engine: EngineParams = field(default_factory=EngineParams)
    supervisor: SupervisorParams = field(default_factory=SupervisorParams)
    traffic: TrafficParams = field(default_factory=TrafficParams)
    # What stands on the ground, in YAML or GeoJSON; paths count from the folder of the configuration.
    obstacle_files: tuple[Path, ...] = ()
    obstacles: ObstacleParams = field(default_factory=ObstacleParams)
    avoidance: AvoidanceParams = field(default_factory=AvoidanceParams)

    def __post_init__(self) -> None:
        for name in self.supervisor.take_over_from:
            if name not in MODE_NAMES:
                raise ValueError(f"supervisor.take_over_from: no autopilot has a mode {name!r}")

    def for_engine(self, known_obstacles: tuple[Obstacle, ...] = ()) -> EngineConfig:
        """The part that the engine is built from, with what the obstacle files say."""
        return EngineConfig(
            autopilot=self.autopilot,
            engine=self.engine,
            supervisor=self.supervisor,
            traffic=self.traffic,
            obstacles=self.obstacles,
            known_obstacles=known_obstacles,
            avoidance=self.avoidance,
        )
