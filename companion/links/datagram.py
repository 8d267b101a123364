"""Links of datagrams, and their peers: every sender of good frames that was heard lately."""

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from companion.links.content import MAVLINK, MAX_PEERS, Content, Reader
from companion.links.queued import QueuedLink
from companion.links.rank import Rank, rank_of
from companion.mavlink.framing import Frame, StreamCounters

SILENCE_S = 30.0

Address = TypeVar("Address", bound=Hashable)


@dataclass(slots=True)
class _Peer:
    reader: Reader
    heard_s: float
    rank: Rank = Rank.OTHER


class Peers(Generic[Address]):
    """The peers that sent a good frame in the last `SILENCE_S`, at most `MAX_PEERS`.

    When the table is full, a newcomer takes the place of the peer of the lowest rank, not above its own, that
    was not heard for longest. So the newest wins, and neither early senders nor a flood of addresses keep
    the autopilot out. Frames of a newcomer without a place are received too.
    """

    def __init__(
        self,
        counters: StreamCounters,
        clock_s: Callable[[], float] = time.monotonic,
        content: Content = MAVLINK,
    ) -> None:
        self._counters = counters
        self._content = content
        self._clock_s = clock_s
        self._peers: dict[Address, _Peer] = {}

    def split(self, address: Address, datagram: bytes, ours: tuple[int, int] | None = None) -> list[Frame]:
        """The frames of a datagram; if it has any, its sender becomes a peer."""
        now_s = self._clock_s()
        peer = self._peers.get(address)
        if peer is None:
            peer = _Peer(self._content.new_reader(self._counters), now_s)
        frames = peer.reader.feed_datagram(datagram)
        if frames:
            peer.heard_s = now_s
            peer.rank = max(peer.rank, rank_of(frames, ours))
            if address not in self._peers:
                self._add(address, peer)
        return frames

    def present(self) -> list[Address]:
        """The addresses to send to."""
        self._remove_silent()
        return list(self._peers)

    def _add(self, address: Address, peer: _Peer) -> None:
        if len(self._peers) >= MAX_PEERS:
            self._remove_silent()
        if len(self._peers) >= MAX_PEERS:
            last = min(self._peers, key=lambda each: (self._peers[each].rank, self._peers[each].heard_s))
            if self._peers[last].rank > peer.rank:
                return
            del self._peers[last]
        self._peers[address] = peer

    def _remove_silent(self) -> None:
        oldest_s = self._clock_s() - SILENCE_S
        silent = [address for address, peer in self._peers.items() if peer.heard_s < oldest_s]
        for address in silent:
            del self._peers[address]


class DatagramLink(QueuedLink[Address], Generic[Address]):
    """A link whose datagrams are split into frames independently of each other."""

    def __init__(
        self,
        address: str,
        clock_s: Callable[[], float] = time.monotonic,
        *,
        listen_only: bool = False,
        content: Content = MAVLINK,
    ) -> None:
        super().__init__(address, listen_only=listen_only, content=content)
        self.peers: Peers[Address] = Peers(self.counters, clock_s, content)

    def _split(self, source: Address, data: bytes) -> list[Frame]:
        return self.peers.split(source, data, self.ours)
