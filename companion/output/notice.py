"""What the operator should read: the engine turns notices into STATUSTEXT and lines of the log."""

from typing import NamedTuple


class Notice(NamedTuple):
    """A text with its MAV_SEVERITY.

    A notice with the same `topic` (by default the text) is left out for a while, with `once` for ever.
    `log_only`: the text goes to the service's log only, not to the ground station.
    """

    severity: int
    text: str
    topic: str | None = None
    once: bool = False
    log_only: bool = False
