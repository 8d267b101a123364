"""What the operator is to read: returned by the rooms that have something to say, worded for STATUSTEXT."""

from typing import NamedTuple


class Notice(NamedTuple):
    """One text with its MAV_SEVERITY.

    A notice of the same `topic` (by default the text) is not repeated for a while; with `once`, never.
    `log_only`: for the log of the service, not for the ground station.
    """

    severity: int
    text: str
    topic: str | None = None
    once: bool = False
    log_only: bool = False


class ConflictNotice(NamedTuple):
    """Where the most urgent threat is, and what is flown against it (`flying`), or would be."""

    flying: bool


class ResumeNotice(NamedTuple):
    """The operator resumes the mission in `mode`: which threats are not avoided."""

    mode: str


AnyNotice = Notice | ConflictNotice | ResumeNotice
