"""The snapshot that the flying process sends to the display, ten times a second.

It holds references to objects that exist anyway. The display's process computes everything derived from them,
so that neither the computing time nor a bug in it reaches the flying loop.
"""

from dataclasses import dataclass

from companion.airspace.fences import FenceZone
from companion.avoidance import AvoidanceParams, Envelope
from companion.engine import Engine
from companion.geodesy import LocalFrame
from companion.model import Snapshot
from companion.output.notice import Condition
from companion.ownship.mission import Mission
from companion.traffic import Concern
from companion.web.health import Health


@dataclass(frozen=True, slots=True)
class LiveSnapshot:
    """One moment of the engine and of the service around it."""

    snapshot: Snapshot
    role: str
    flying: bool
    autopilot: str | None
    firmware: str | None
    system_id: int | None
    frame: LocalFrame | None
    home_altitude_m: float | None
    position_age_s: float
    avoidance: AvoidanceParams
    envelope: Envelope
    mission: Mission | None
    mission_sequence: int | None
    zones: tuple[FenceZone, ...]
    engagements: int
    rejections: int
    conditions: tuple[Condition, ...]
    health: Health
    concerns: tuple[Concern, ...] = ()


def live_snapshot_of(engine: Engine, now_s: float, health: Health) -> LiveSnapshot:
    """The snapshot at `now_s` by the engine's clock."""
    aircraft, adapter = engine.aircraft, engine.aircraft.adapter
    return LiveSnapshot(
        snapshot=engine.snapshot(now_s),
        role=engine.operator.role.name.lower(),
        flying=engine.supervisor.flying,
        autopilot=None if adapter is None else adapter.name,
        firmware=aircraft.identity.version,
        system_id=None if adapter is None else adapter.target.system_id,
        frame=engine.frame,
        home_altitude_m=aircraft.kinematics.home_altitude_m(),
        position_age_s=now_s - aircraft.kinematics.position_s,
        avoidance=engine.avoider.params,
        envelope=engine.avoider.envelope,
        mission=engine.queries.mission,
        mission_sequence=aircraft.navigation.sequence,
        zones=engine.queries.zones,
        engagements=engine.engagements,
        rejections=engine.rejections,
        conditions=engine.conditions,
        health=health,
        concerns=engine.concerns,
    )
