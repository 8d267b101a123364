"""The network between the members: each frame reaches every other one, unless it is lost, after the delay."""

import random
from collections import defaultdict, deque
from collections.abc import Sequence

from companion.mavlink.dialect import Encoder, Message, mavlink
from sim.members.scenario import NetworkPlan

# What a vehicle is known by to the others. The rest of its telemetry is for its own companion and station.
_OF_VEHICLES = frozenset({mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT})


def is_of_vehicle(message_id: int) -> bool:
    """Whether a vehicle sends a message of this kind to the other members."""
    return message_id in _OF_VEHICLES


def is_broadcast(message: Message) -> bool:
    """Whether a message of a companion is for all: one with a target is for that system alone."""
    return getattr(message, "target_system", 0) == 0


class Network:
    """Frames on their way between members, which are known by their numbers. The same seed loses the same.

    Each address has sequence numbers of its own on this network, as on a link of its own.
    """

    def __init__(self, plan: NetworkPlan, members: int, *, seed: int = 0) -> None:
        self._plan = plan
        self._chances = [
            [random.Random(f"{seed} {sender} {receiver}") for receiver in range(members)]
            for sender in range(members)
        ]
        self._coming: list[deque[tuple[float, bytes]]] = [deque() for _ in range(members)]
        self._encoders: defaultdict[tuple[int, int], Encoder] = defaultdict(Encoder)
        self.sent_bytes = [0] * members

    def send(self, sender: int, message: Message, address: tuple[int, int], now_s: float) -> None:
        """Send a message of one member, from its system and component, to all others."""
        raw = self._encoders[address].encode(message, *address)
        self.sent_bytes[sender] += len(raw)
        for receiver, coming in enumerate(self._coming):
            if receiver != sender and self._chances[sender][receiver].random() >= self._plan.loss:
                coming.append((now_s + self._plan.delay_s, raw))

    def arrived(self, receiver: int, now_s: float) -> Sequence[bytes]:
        """The frames that reached a member since the last call, in order."""
        coming, arrived = self._coming[receiver], []
        while coming and coming[0][0] <= now_s + 1e-6:
            arrived.append(coming.popleft()[1])
        return arrived
