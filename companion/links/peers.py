"""Who is heard on a link: each peer's stream is split on its own, and the silent ones are forgotten."""

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from companion.mavlink.framing import Frame, FrameSplitter, StreamCounters

MAX_PEERS = 16
SILENCE_S = 30.0

Address = TypeVar("Address", bound=Hashable)


@dataclass(slots=True)
class _Peer:
    splitter: FrameSplitter
    heard_s: float


class Peers(Generic[Address]):
    """The peers that sent a good frame in the last `SILENCE_S`, `MAX_PEERS` of them at most.

    When the table is full a newcomer is heard but not remembered: whoever floods a port with sender addresses
    does not push the autopilot out.
    """

    def __init__(self, counters: StreamCounters, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._counters = counters
        self._clock_s = clock_s
        self._peers: dict[Address, _Peer] = {}

    def split(self, address: Address, datagram: bytes) -> list[Frame]:
        """The frames of a datagram; if there are any, its sender is present from now on."""
        now_s = self._clock_s()
        peer = self._peers.get(address)
        if peer is None:
            peer = _Peer(FrameSplitter(self._counters), now_s)
        frames = peer.splitter.feed_datagram(datagram)
        if frames:
            peer.heard_s = now_s
            if address not in self._peers:
                self._remember(address, peer)
        return frames

    def present(self) -> list[Address]:
        """The addresses to send to."""
        self._forget_silent()
        return list(self._peers)

    def _remember(self, address: Address, peer: _Peer) -> None:
        if len(self._peers) >= MAX_PEERS:
            self._forget_silent()
        if len(self._peers) < MAX_PEERS:
            self._peers[address] = peer

    def _forget_silent(self) -> None:
        oldest_s = self._clock_s() - SILENCE_S
        silent = [address for address, peer in self._peers.items() if peer.heard_s < oldest_s]
        for address in silent:
            del self._peers[address]
