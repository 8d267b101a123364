"""Nobody avoids: the flight that every risk ratio is measured against."""

from collections.abc import Sequence

from companion.model import Decision, Goal, Layer, Ownship, Track
from sim.peers.peer import PeerLimits


class Nobody:
    """Flies the mission whatever comes."""

    def __init__(self, limits: PeerLimits) -> None:
        self.limits = limits

    def decide(
        self,
        now_s: float,  # noqa: ARG002
        own: Ownship,  # noqa: ARG002
        tracks: Sequence[Track],  # noqa: ARG002
        goal: Goal,  # noqa: ARG002
    ) -> Decision:
        """Always the mission."""
        return Decision(Layer.CLEAR, because="nobody avoids")

    def reset(self) -> None:
        """There is nothing to forget."""
