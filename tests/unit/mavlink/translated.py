"""The fact of a message, packed, split and decoded in both ways."""

from typing import Any

from companion.mavlink.dialect import Encoder
from companion.mavlink.facts import (
    Fact,
    Sender,
)
from companion.mavlink.framing import FrameSplitter, decode
from companion.mavlink.translate import frame_to_fact, to_fact

RECEIVED_S = 1000.0
SENDER = Sender(7, 3)


def fact_of(message: Any) -> Fact | None:
    (frame,) = FrameSplitter().feed(Encoder().encode(message, SENDER.system_id, SENDER.component_id))
    fact = frame_to_fact(frame, RECEIVED_S)
    assert fact == to_fact(decode(frame), RECEIVED_S)
    return fact
