"""What happens in flight that the operator is told of."""

from dataclasses import dataclass

INFO, WARNING = 6, 4  # MAV_SEVERITY


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text (STATUSTEXT)."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class ItemReached:
    """A mission item has been done (MISSION_ITEM_REACHED)."""

    sequence: int


Event = Text | ItemReached
