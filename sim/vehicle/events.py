"""What happens in flight that the operator is told of."""

from dataclasses import dataclass

INFO, WARNING, CRITICAL = 6, 4, 2  # MAV_SEVERITY


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text (STATUSTEXT)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class ItemReached:
    """A mission item has been done (MISSION_ITEM_REACHED)."""

    sequence: int


@dataclass(frozen=True, slots=True)
class FenceChanged:
    """A fence has been broken, or is kept again (FENCE_STATUS)."""


@dataclass(frozen=True, slots=True)
class ModeChanged:
    """Another mode is flown (a HEARTBEAT soon, where the autopilot sends one)."""


Event = Text | ItemReached | FenceChanged | ModeChanged
