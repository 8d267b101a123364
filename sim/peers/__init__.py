"""Peers: published methods to compare ours with, each behind one common interface."""

from collections.abc import Callable

from companion.errors import ConfigError
from sim.peers.ardupilot import ArduPilot, ArduPilotParams
from sim.peers.mvp import Mvp
from sim.peers.orca import Orca
from sim.peers.peer import Peer, PeerLimits, Unmitigated

PEERS: dict[str, Callable[[PeerLimits], Peer]] = {
    "none": Unmitigated,
    "ardupilot": ArduPilot,  # with its default distances, 300 by 100 m
    "ardupilot-610": lambda limits: ArduPilot(limits, ArduPilotParams.well_clear()),
    "mvp": Mvp,
    "orca": Orca,
}


def make_peer(name: str, limits: PeerLimits) -> Peer:
    """The peer of that name, for one aircraft; `ConfigError` for an unknown name or a missing library."""
    if name not in PEERS:
        raise ConfigError(f"avoider {name!r} is not known: there are companion, {', '.join(PEERS)}")
    return PEERS[name](limits)


__all__ = ["PEERS", "Peer", "PeerLimits", "make_peer"]
