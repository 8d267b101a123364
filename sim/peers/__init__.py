"""The methods that ours is measured against, each from its published description, in one common form."""

from collections.abc import Callable

from companion.errors import ConfigError
from sim.peers.ardupilot import ArduPilot, ArduPilotParams
from sim.peers.mvp import Mvp
from sim.peers.orca import Orca
from sim.peers.peer import Decides, PeerLimits
from sim.peers.unmitigated import Nobody

PEERS: dict[str, Callable[[PeerLimits], Decides]] = {
    "none": Nobody,
    "ardupilot": ArduPilot,  # with the distances it comes with, 300 by 100 m
    "ardupilot-610": lambda limits: ArduPilot(limits, ArduPilotParams.well_clear()),
    "mvp": Mvp,
    "orca": Orca,
}


def make_peer(name: str, limits: PeerLimits) -> Decides:
    """The peer of that name, for one aircraft; `ConfigError` if there is none, or its library is missing."""
    if name not in PEERS:
        raise ConfigError(f"avoider {name!r} is not known: there are companion, {', '.join(PEERS)}")
    return PEERS[name](limits)


__all__ = ["PEERS", "Decides", "PeerLimits", "make_peer"]
