"""Answers of an autopilot without a mission to those who read it."""

from collections.abc import Iterable

from companion.mavlink.dialect import Message
from companion.mavlink.facts import MissionCount, Sender


def empty_missions(sent: Iterable[Message], autopilot: Sender, us: Sender) -> list[MissionCount]:
    """The answers to the requests among the messages sent to the autopilot."""
    kinds = [message.mission_type for message in sent if message.get_type() == "MISSION_REQUEST_LIST"]
    return [MissionCount(autopilot, us, kind, 0) for kind in kinds]
