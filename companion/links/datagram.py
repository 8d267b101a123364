"""Links of datagrams: each stands alone, and everybody who sends good ones is a peer."""

import time
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from companion.links.peers import Peers
from companion.links.queued import QueuedLink
from companion.mavlink.framing import Frame

Address = TypeVar("Address", bound=Hashable)


class DatagramLink(QueuedLink[Address], Generic[Address]):
    """The receiving half of a datagram link."""

    def __init__(
        self, address: str, clock_s: Callable[[], float] = time.monotonic, *, listen_only: bool = False
    ) -> None:
        super().__init__(address, listen_only=listen_only)
        self.peers: Peers[Address] = Peers(self.counters, clock_s)

    def _split(self, source: Address, data: bytes) -> list[Frame]:
        return self.peers.split(source, data)
