"""Notices for the operator, before they are put into words for STATUSTEXT."""

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
    """The most urgent threat, and what is flown against it; without `flying`, what is advised."""

    flying: bool


class ResumeNotice(NamedTuple):
    """The threats that are not avoided, because the operator resumes the mission in `mode`."""

    mode: str


AnyNotice = Notice | ConflictNotice | ResumeNotice
