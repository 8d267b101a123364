"""A peer in the place of our avoider, so that all are flown by the same engine, tracker and supervisor."""

from collections.abc import Sequence

from companion.avoidance import AvoidanceParams, Avoider
from companion.model import Decision, Goal, Ownship, Track
from sim.peers import Decides


class PeerAvoider(Avoider):
    """Decides as the peer does; what an autopilot refuses, and fences, are nothing to it."""

    def __init__(self, params: AvoidanceParams, peer: Decides) -> None:
        super().__init__(params)
        self._peer = peer

    def reset(self) -> None:
        """Forget the conflict at hand."""
        super().reset()
        self._peer.reset()

    def decide(self, now_s: float, own: Ownship, tracks: Sequence[Track], goal: Goal) -> Decision:
        """The peer's decision, in the same frame [m, m/s, rad]."""
        return self._peer.decide(now_s, own, tracks, goal)
