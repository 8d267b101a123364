"""The engine of each member: the one place that says what the members of a formation are configured with."""

from dataclasses import replace

from companion.avoidance.params import Layers
from companion.engine import Engine, EngineConfig
from sim.members.scenario import Member


def engine_config(
    member: Member, layers: Layers = Layers.BOTH, base: EngineConfig | None = None
) -> EngineConfig:
    """The configuration of a member's engine; all other vehicles on the network are members.

    One layer alone, without cooperation, is for comparisons.
    """
    base = base or EngineConfig()
    formation = replace(base.avoidance.formation, members="all", cooperate=layers is Layers.BOTH)
    return replace(
        base,
        engine=replace(base.engine, system_id=member.system_id, autopilot_system_id=member.system_id),
        avoidance=replace(base.avoidance, layers=layers, formation=formation),
    )


def engine_of(member: Member, layers: Layers = Layers.BOTH) -> Engine:
    """A member's engine."""
    return Engine(engine_config(member, layers))
