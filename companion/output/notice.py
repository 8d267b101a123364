"""Notices for the operator, before they are put into words for STATUSTEXT."""

from typing import NamedTuple

# A STATUSTEXT message holds this many bytes; a longer text takes several.
TEXT_BYTES = 50


class Notice(NamedTuple):
    """One text with its MAV_SEVERITY; `brief` is the same for STATUSTEXT in fewer words.

    A notice of the same `topic` (by default the text) is not repeated for a while.
    `log_only`: for the log of the service, not for the ground station.
    """

    severity: int
    text: str
    topic: str | None = None
    log_only: bool = False
    brief: str | None = None


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
