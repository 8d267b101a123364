"""The three controls of the aircraft (paper §3.2)."""

from enum import StrEnum


class Control(StrEnum):
    """What an avoidance can change."""

    HEADING = "heading"
    SPEED = "speed"
    HEIGHT = "height"


ALL_CONTROLS = frozenset(Control)
