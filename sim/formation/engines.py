"""The engines of a formation's members, by avoider: the one place that makes their configuration."""

from dataclasses import dataclass

from companion.avoidance.group.formation import FormationParams
from companion.avoidance.params import AvoidanceParams, Layers
from companion.engine import AircraftLimits, Engine, EngineConfig, EngineParams
from sim.campaign.avoiders import PeerAvoider
from sim.campaign.plane import Limits
from sim.peers import PeerLimits
from sim.peers.orca import Orca, OrcaParams

COMPANION, SILENT = "companion", "companion-silent"
OUTER, INNER, ORCA, NONE = "outer", "inner", "orca", "none"
AVOIDERS = (COMPANION, SILENT, OUTER, INNER, ORCA, NONE)
# The layers in use; one alone answers without communication, like the silent companion.
_LAYERS = {OUTER: Layers.OUTER, INNER: Layers.INNER}


@dataclass(frozen=True, slots=True)
class Separation:
    """What members keep from each other: wanted, and the smallest that counts as kept [m]."""

    wanted_m: float = 100.0
    smallest_m: float = 50.0
    smallest_vertical_m: float = 30.0


def separated(smallest_m: float) -> Separation:
    """The separation with that smallest distance; twice as much is wanted."""
    return Separation(2.0 * smallest_m, smallest_m)


def shares_intent(avoider: str) -> bool:
    """Whether the companions hear what the others intend."""
    return avoider == COMPANION


def engine_of(avoider: str, system_id: int, limits: Limits, separation: Separation) -> Engine | None:
    """The engine of a member; `None` without avoidance. `ConfigError` if a library is missing."""
    if avoider == NONE:
        return None
    config = config_of(avoider, system_id, limits, separation)
    if avoider != ORCA:
        return Engine(config)
    return Engine(config, avoider=PeerAvoider(config.avoidance, _orca(limits, separation)))


def config_of(avoider: str, system_id: int, limits: Limits, separation: Separation) -> EngineConfig:
    """The configuration of a member: all other vehicles of its network are members too."""
    formation = FormationParams(
        members="all",
        separation_m=separation.wanted_m,
        influence_m=separation.wanted_m,
        smallest_m=separation.smallest_m,
        smallest_vertical_m=separation.smallest_vertical_m,
    )
    layers = _LAYERS.get(avoider, Layers.BOTH)
    return EngineConfig(
        engine=EngineParams(autopilot_system_id=system_id),
        avoidance=AvoidanceParams(layers=layers, formation=formation),
        aircraft=AircraftLimits(
            min_airspeed_mps=limits.min_airspeed_mps,
            max_airspeed_mps=limits.max_airspeed_mps,
            max_bank_rad=limits.max_bank_rad,
            max_climb_mps=limits.max_climb_mps,
            max_sink_mps=limits.max_climb_mps,
        ),
    )


def _orca(limits: Limits, separation: Separation) -> Orca:
    """ORCA among agents that all take half of each change, at the wanted separation."""
    peer = PeerLimits(
        min_airspeed_mps=limits.min_airspeed_mps,
        max_airspeed_mps=limits.max_airspeed_mps,
        max_bank_rad=limits.max_bank_rad,
        max_climb_mps=limits.max_climb_mps,
        max_sink_mps=limits.max_climb_mps,
    )
    volume = OrcaParams(separation_m=separation.wanted_m, half_height_m=separation.smallest_vertical_m)
    return Orca(peer, volume)
