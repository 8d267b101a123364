"""Two links joined in memory, for tests and simulations: no sockets, and faults on request."""

import random

from companion.links.datagram import DatagramLink


class MemoryLink(DatagramLink[str]):
    """One end of a pair; see `memory_pair`."""

    def __init__(
        self, address: str, chance: random.Random, loss: float, duplication: float, reordering: float
    ) -> None:
        super().__init__(address)
        self.other: MemoryLink | None = None
        self._chance = chance
        self._loss = loss
        self._duplication = duplication
        self._reordering = reordering
        self._delayed: list[bytes] = []

    @property
    def _is_open(self) -> bool:
        return True

    async def _connect(self) -> None:
        """There is nothing to open."""

    def _disconnect(self) -> None:
        """There is nothing to close."""

    def _send(self, data: bytes) -> None:
        if self.closed or self.other is None:
            self.counters.send_errors += 1
            return
        self.counters.sent_frames += 1
        self.counters.sent_bytes += len(data)
        delayed, self._delayed = self._delayed, []
        if self._chance.random() >= self._loss:
            copies = 2 if self._chance.random() < self._duplication else 1
            if self._chance.random() < self._reordering:
                self._delayed = [data] * copies  # delivered after the next one
            else:
                self._deliver(self.other, [data] * copies)
        self._deliver(self.other, delayed)

    def _deliver(self, other: "MemoryLink", datagrams: list[bytes]) -> None:
        for datagram in datagrams:
            other.arrived(self.address, datagram)


def memory_pair(
    *, loss: float = 0.0, duplication: float = 0.0, reordering: float = 0.0, seed: int = 0
) -> tuple[MemoryLink, MemoryLink]:
    """Two joined links; probabilities are per datagram, and the same seed gives the same faults."""
    ends = [
        MemoryLink(f"memory:{name}", random.Random(f"{seed}{name}"), loss, duplication, reordering)
        for name in ("a", "b")
    ]
    ends[0].other, ends[1].other = ends[1], ends[0]
    return ends[0], ends[1]
