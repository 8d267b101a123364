"""What the engine is built from: every section of the configuration, and the rules between them."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from companion.airspace.fence_zones import FenceZone
from companion.airspace.obstacles import Obstacle, ObstacleParams
from companion.avoidance import AvoidanceParams
from companion.control.state_machine import SupervisorParams
from companion.model import TextUnits
from companion.ownship.performance_limits import AircraftLimits
from companion.traffic import TrafficParams


@dataclass(frozen=True)
class EngineParams:
    """Identity on the wire, and when own position is too old to act on."""

    system_id: Literal["auto"] | Annotated[int, Ge(1), Le(254)] = "auto"
    # 1 is the autopilot itself.
    component_id: Annotated[int, Ge(2), Le(255)] = 196
    autopilot_system_id: Literal["auto"] | Annotated[int, Ge(1), Le(255)] = "auto"
    # With no autopilot configured, others are waited for so long; of several none is chosen.
    adopt_after_s: Annotated[float, Ge(0), Le(60)] = 1.5
    # Own position older than this begins no take-over; older than the second, no decision is made anew.
    position_fresh_s: Annotated[float, Gt(0), Le(5)] = 0.5
    position_stale_s: Annotated[float, Gt(0), Le(5)] = 2.0
    # Highest height above home that an avoidance may climb to; `None`: no ceiling.
    max_height_m: Annotated[float, Gt(0)] | None = None
    # In which the operator is told of heights and speeds: metres and m/s, or feet and knots.
    text_units: TextUnits = "metric"

    def __post_init__(self) -> None:
        if self.position_fresh_s > self.position_stale_s:
            raise ValueError("position_fresh_s must not exceed position_stale_s")


@dataclass(frozen=True)
class EngineConfig:
    """All that the engine is built from."""

    autopilot: Literal["auto", "ardupilot", "px4"] = "auto"
    engine: EngineParams = field(default_factory=EngineParams)
    supervisor: SupervisorParams = field(default_factory=SupervisorParams)
    traffic: TrafficParams = field(default_factory=TrafficParams)
    obstacles: ObstacleParams = field(default_factory=ObstacleParams)
    known_obstacles: tuple[Obstacle, ...] = ()
    avoidance: AvoidanceParams = field(default_factory=AvoidanceParams)
    aircraft: AircraftLimits = field(default_factory=AircraftLimits)
    fences: tuple[FenceZone, ...] = ()

    def __post_init__(self) -> None:
        ceiling_m = self.engine.max_height_m
        if ceiling_m is not None and ceiling_m <= self.supervisor.min_height_m:
            raise ValueError("engine.max_height_m must be above supervisor.min_height_m")
