"""The configuration of the engine: its sections, and the rules between them."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from companion.airspace.fences import FenceZone
from companion.airspace.obstacles import Obstacle, ObstacleParams
from companion.avoidance import AvoidanceParams
from companion.control.rejoin import ControlParams
from companion.control.state_machine import SupervisorParams
from companion.mavlink.dialect import mavlink
from companion.model import TextUnits
from companion.ownship.performance_limits import AircraftLimits
from companion.traffic import TrafficParams
from companion.traffic.members import MemberParams


@dataclass(frozen=True)
class EngineParams:
    """Identity on the wire, age limits of the own position, ceiling and units of texts."""

    system_id: Literal["auto"] | Annotated[int, Ge(1), Le(254)] = "auto"
    # 1 is the autopilot itself.
    component_id: Annotated[int, Ge(2), Le(255)] = 196
    autopilot_system_id: Literal["auto"] | Annotated[int, Ge(1), Le(255)] = "auto"
    # Without a configured system, wait this long for other autopilots; if there are several, none is chosen.
    adopt_after_s: Annotated[float, Ge(0), Le(60)] = 1.5
    # The aircraft is taken over only with an own position no older than this.
    position_fresh_s: Annotated[float, Gt(0), Le(5)] = 0.5
    # No new decision is made from an own position older than this.
    position_stale_s: Annotated[float, Gt(0), Le(5)] = 2.0
    # Highest height above home that an avoidance may climb to; `None`: no ceiling.
    max_height_m: Annotated[float, Gt(0), Le(10_000)] | None = None
    # Units of the texts for the operator: metres and m/s, or feet and knots.
    text_units: TextUnits = "metric"

    def __post_init__(self) -> None:
        if self.position_fresh_s > self.position_stale_s:
            raise ValueError("position_fresh_s must not exceed position_stale_s")


@dataclass(frozen=True)
class EngineConfig:
    """Every section that the engine uses."""

    autopilot: Literal["auto", "ardupilot", "px4"] = "auto"
    engine: EngineParams = field(default_factory=EngineParams)
    supervisor: SupervisorParams = field(default_factory=SupervisorParams)
    control: ControlParams = field(default_factory=ControlParams)
    traffic: TrafficParams = field(default_factory=TrafficParams)
    obstacles: ObstacleParams = field(default_factory=ObstacleParams)
    known_obstacles: tuple[Obstacle, ...] = ()
    avoidance: AvoidanceParams = field(default_factory=AvoidanceParams)
    aircraft: AircraftLimits = field(default_factory=AircraftLimits)
    fences: tuple[FenceZone, ...] = ()

    def __post_init__(self) -> None:
        if self.avoidance.formation.members and self.engine.autopilot_system_id == "auto":
            raise ValueError(
                "avoidance.formation.members needs engine.autopilot_system_id: several autopilots are heard"
            )
        ceiling_m = self.engine.max_height_m
        if ceiling_m is not None and ceiling_m <= self.supervisor.min_height_m:
            raise ValueError("engine.max_height_m must be above supervisor.min_height_m")
        if self.engine.component_id == mavlink.MAV_COMP_ID_ADSB and self.traffic.forward != "off":
            raise ValueError("engine.component_id 156 is that of traffic.forward: choose another one")

    @property
    def members(self) -> MemberParams:
        """The formation as the picture of the traffic knows it."""
        known = self.avoidance.formation
        return MemberParams(known.members, known.silent_s, known.smallest_m, known.smallest_vertical_m)
