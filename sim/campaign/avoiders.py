"""The avoiders of a campaign: ours or a peer, each in the same engine with its tracker and state machine."""

from collections.abc import Callable, Sequence

from companion.avoidance import AvoidanceParams, Avoider
from companion.control.rejoin import ControlParams, RejoinMode
from companion.control.state_machine import SupervisorParams
from companion.engine import Engine, EngineConfig, EngineParams
from companion.model import Decision, Goal, Ownship, Track
from companion.ownship.performance_limits import AircraftLimits
from sim.campaign.changes import Changes, changed
from sim.campaign.plane import Limits
from sim.encounters import Encounter
from sim.peers import Peer, PeerLimits, make_peer

COMPANION, NONE = "companion", "none"


class PeerAvoider(Avoider):
    """A peer in place of our avoider; fences and refused commands have no effect on it."""

    def __init__(self, params: AvoidanceParams, peer: Peer) -> None:
        super().__init__(params)
        self._peer = peer

    def reset(self) -> None:
        """Clear the present conflict."""
        super().reset()
        self._peer.reset()

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The peer's decision, in the same frame [m, m/s, rad]."""
        return self._peer.decide(now_s, own, tracks, goal)


def engine_for(
    avoider: str, limits: Limits, rejoin: RejoinMode = "line", avoidance: Changes = ()
) -> Callable[[Encounter], Engine]:
    """A function that makes the engine for an encounter; `avoidance` are changed values of its parameters."""
    params = changed(AvoidanceParams(), avoidance)
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
            control=ControlParams(rejoin=rejoin),
            avoidance=params,
            aircraft=aircraft,
        )
        return Engine(config, avoider=_peer(avoider, limits, config, floor_m, ceiling_m))

    return make


def _peer(
    avoider: str, limits: Limits, config: EngineConfig, floor_m: float, ceiling_m: float | None
) -> Avoider | None:
    if avoider == COMPANION:
        return None
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
