"""What the flying process hands to the display, ten times a second: references to what it has anyway.

What costs time, and every mistake in drawing conclusions from it, is left to the other process. Only for the
record the same is done here too, every ten seconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from companion.airspace.fence_zones import FenceZone
from companion.avoidance import AvoidanceParams, Envelope
from companion.engine import Engine
from companion.geodesy import LocalFrame
from companion.links import Link
from companion.model import Snapshot
from companion.ownship.mission import Mission
from companion.web.loop_times import LoopTimes


@dataclass(frozen=True, slots=True)
class LinkCount:
    """What one link carried since the start."""

    address: str
    frames: int
    lost: int
    bad_bytes: int
    sent_frames: int
    send_errors: int


@dataclass(frozen=True, slots=True)
class Health:
    """How the service itself does; counts since the start."""

    uptime_s: float
    tick_s: float  # how long the last tick took
    ticks_below: tuple[int, ...]  # how many took no longer than each of `LoopTimes.BOUNDS_S`, and all of them
    ticks_total_s: float
    skipped_ticks: int
    links: tuple[LinkCount, ...]
    unusable: int
    setpoints_sent: int
    recording_problem: str | None

    @classmethod
    def of(
        cls,
        uptime_s: float,
        times: LoopTimes,
        links: Sequence[Link],
        *,
        skipped_ticks: int = 0,
        unusable: int = 0,
        setpoints_sent: int = 0,
        recording_problem: str | None = None,
    ) -> "Health":
        """The counts of the moment."""
        counts = tuple(
            LinkCount(
                link.address,
                (heard := link.counters).frames,
                heard.lost,
                heard.bad_bytes,
                heard.sent_frames,
                heard.send_errors,
            )
            for link in links
        )
        return cls(
            uptime_s,
            times.last_s,
            times.below,
            times.total_s,
            skipped_ticks,
            counts,
            unusable,
            setpoints_sent,
            recording_problem,
        )


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
    health: Health


def live_snapshot_of(engine: Engine, now_s: float, health: Health) -> LiveSnapshot:
    """What there is to be seen at `now_s`, by the engine's clock."""
    aircraft, adapter = engine.aircraft, engine.aircraft.adapter
    return LiveSnapshot(
        snapshot=engine.snapshot(now_s),
        role=engine.operator.role.name.lower(),
        flying=engine.supervisor.flying,
        autopilot=None if adapter is None else adapter.name,
        firmware=aircraft.version,
        system_id=None if adapter is None else adapter.target.system_id,
        frame=engine.frame,
        home_altitude_m=aircraft.home_altitude_m(),
        position_age_s=now_s - aircraft.position_s,
        avoidance=engine.avoider.params,
        envelope=engine.avoider.envelope,
        mission=engine.queries.mission,
        mission_sequence=aircraft.sequence,
        zones=engine.queries.zones,
        engagements=engine.engagements,
        rejections=engine.rejections,
        health=health,
    )
