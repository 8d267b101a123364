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


class Condition(NamedTuple):
    """Something that keeps the aircraft from being flown, is odd or was given up, while it holds.

    It is announced when it has held for `after_s`, again every half minute while it `matters`, and its end by
    the text `ended`, unless another condition with the same `ended` holds. The `key` identifies it: the text
    may change, as with a height in it.
    """

    key: str
    severity: int
    text: str
    ended: str | None = None
    matters: bool = True
    after_s: float = 0.0


class ConflictNotice(NamedTuple):
    """The most urgent threat, and what is flown against it; without `flying`, what is advised."""

    flying: bool


class ResumeNotice(NamedTuple):
    """The threats that are not avoided, because the operator resumes the mission in `mode`."""

    mode: str


AnyNotice = Notice | ConflictNotice | ResumeNotice
