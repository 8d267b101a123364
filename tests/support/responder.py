"""An autopilot reduced to its parameters and mission lists, and a lossy line to it."""

import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from companion.mavlink.dialect import Encoder, Message, mavlink
from companion.mavlink.facts import Fact, Sender
from companion.mavlink.framing import FrameSplitter
from companion.mavlink.translate import frame_to_fact

AUTOPILOT, US, GCS = Sender(1, 1), Sender(1, 196), Sender(255, 190)
MISSION, FENCE = 0, 1


@dataclass(frozen=True)
class Item:
    """A stored mission item; `place_deg` is latitude and longitude."""

    command: int
    place_deg: tuple[float, float] = (0.0, 0.0)
    height_m: float = 0.0
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    frame: int = 3


def as_fact(message: Message, sender: Sender = AUTOPILOT, now_s: float = 0.0) -> Fact | None:
    """The fact of a message after packing and unpacking."""
    raw = Encoder().encode(message, sender.system_id, sender.component_id)
    (frame,) = FrameSplitter().feed(raw)
    return frame_to_fact(frame, now_s)


@dataclass
class Responder:
    """Answers parameter and mission requests; unknown names get no answer, as from ArduPilot."""

    parameters: dict[str, float] = field(default_factory=dict)
    lists: dict[int, Sequence[Item]] = field(default_factory=lambda: {MISSION: (), FENCE: ()})
    heard: list[Message] = field(default_factory=list)

    def answer(self, message: Message, asker: Sender = US) -> list[Message]:
        """The answers to a message."""
        self.heard.append(message)
        kind = message.get_type()
        if kind == "PARAM_REQUEST_READ":
            name = str(message.param_id)
            return [self.parameter(name)] if name in self.parameters else []
        if not kind.startswith("MISSION_REQUEST"):
            return []
        items = self.lists.get(message.mission_type)
        address = (asker.system_id, asker.component_id)
        if items is None:
            unsupported = mavlink.MAV_MISSION_UNSUPPORTED
            return [mavlink.MAVLink_mission_ack_message(*address, unsupported, message.mission_type)]
        if kind == "MISSION_REQUEST_LIST":
            return [mavlink.MAVLink_mission_count_message(*address, len(items), message.mission_type)]
        if message.seq >= len(items):
            wrong = mavlink.MAV_MISSION_INVALID_SEQUENCE
            return [mavlink.MAVLink_mission_ack_message(*address, wrong, message.mission_type)]
        return [item_message(items[message.seq], message.seq, address, message.mission_type)]

    def parameter(self, name: str) -> Message:
        """PARAM_VALUE."""
        return mavlink.MAVLink_param_value_message(name.encode(), self.parameters[name], 9, 1, 0)


def item_message(item: Item, sequence: int, address: tuple[int, int], mission_type: int) -> Message:
    """MISSION_ITEM_INT."""
    lat_e7, lon_e7 = (round(angle * 1e7) for angle in item.place_deg)
    return mavlink.MAVLink_mission_item_int_message(
        *address, sequence, item.frame, item.command, 0, 1, *item.params, lat_e7, lon_e7, item.height_m,
        mission_type,
    )  # fmt: skip


class Line:
    """A one-way line for messages; with `loss` it also repeats and delays some, by its seed."""

    def __init__(self, seed: int = 0, *, loss: float = 0.0) -> None:
        self._random = random.Random(seed)
        self._loss = loss
        self._in_flight: list[tuple[float, int, Message]] = []
        self._count = 0

    def put(self, message: Message, now_s: float) -> None:
        """Send a message; it may be lost, repeated or overtaken."""
        if self._random.random() < self._loss:
            return
        for _ in range(2 if self._random.random() < 0.3 * self._loss else 1):
            late_s = self._random.uniform(0.0, 1.5) if self._random.random() < self._loss else 0.0
            self._count += 1
            self._in_flight.append((now_s + late_s, self._count, message))

    def take(self, now_s: float) -> list[Message]:
        """The messages that have arrived."""
        arrived = sorted(entry for entry in self._in_flight if entry[0] <= now_s)
        self._in_flight = [entry for entry in self._in_flight if entry[0] > now_s]
        return [message for _, _, message in arrived]
