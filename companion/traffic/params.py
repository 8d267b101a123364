"""Parameters of traffic tracking."""

import re
from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Gt, Le

from companion.model import TrafficKind
from companion.traffic.altitude_datums import HeightParams
from companion.traffic.gates import AssociationParams, EchoParams
from companion.traffic.track_filter import EstimateParams

Icao = Annotated[int, Ge(1), Le(0xFFFFFF)]


@dataclass(frozen=True, slots=True)
class TrafficParams:
    """When traffic is believed, kept and forgotten."""

    # A track is dropped when nothing new was measured for this long.
    stale_s: Annotated[float, Gt(0)] = 20.0
    # The same for point obstacles, which stay where they are.
    obstacle_stale_s: Annotated[float, Gt(0)] = 300.0
    # A height this old, coasted with its last climb, still places a track; an older one does not.
    altitude_hold_s: Annotated[float, Gt(0)] = 20.0
    # An identical report within this time is the old one again: ArduPilot re-sends for 5 s, plus latency.
    repeat_window_s: Annotated[float, Ge(0)] = 7.0
    # Up to this speed an aircraft may truly report the same place again after the window; a transponder's
    # position is coarser (5 m) than the way a hovering helicopter drifts meanwhile.
    hovering_mps: Annotated[float, Ge(0)] = 2.0
    # When there are more, the one not heard for longest gives way.
    max_tracks: Annotated[int, Ge(1)] = 2000
    # Our own transponder's addresses, which come back as traffic. More are learnt from the autopilot.
    own_icao: frozenset[Icao] = frozenset()
    # The same for unmanned traffic management: the id in hexadecimal, as UTM_GLOBAL_POSITION carries it.
    own_uas_id: str | None = None
    estimate: EstimateParams = field(default_factory=EstimateParams)
    heights: HeightParams = field(default_factory=HeightParams)
    association: AssociationParams = field(default_factory=AssociationParams)
    own_echo: EchoParams = field(default_factory=EchoParams)

    def stale_after_s(self, kind: TrafficKind) -> float:
        """For how long a track of this kind lives without a new measurement [s]."""
        return self.obstacle_stale_s if kind is TrafficKind.OBSTACLE else self.stale_s

    def __post_init__(self) -> None:
        if self.repeat_window_s >= self.stale_s:
            raise ValueError("repeat_window_s must be less than stale_s, or hovering traffic disappears")
        if self.own_uas_id is not None and not re.fullmatch("([0-9A-Fa-f]{2}){1,18}", self.own_uas_id):
            raise ValueError("own_uas_id must be up to 18 bytes in hexadecimal")
