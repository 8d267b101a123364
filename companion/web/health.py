"""Health of the service: tick times, and counts of what its links carried."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from companion.links import Link, ReceiverLink
from companion.links.receiver_link import SILENCE_S
from companion.sources.receiver import Receiver


class LoopTimes:
    """A histogram of tick times. `below[i]` ticks took at most `BOUNDS_S[i]`; its last entry counts all."""

    BOUNDS_S: ClassVar[tuple[float, ...]] = (
        0.0005, 0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5,
    )  # fmt: skip

    def __init__(self) -> None:
        self.last_s = 0.0
        self.total_s = 0.0
        self._counts = [0] * (len(self.BOUNDS_S) + 1)

    def observe(self, seconds: float) -> None:
        """Add the duration of one tick."""
        self.last_s = seconds
        self.total_s += seconds
        self._counts[bisect_left(self.BOUNDS_S, seconds)] += 1

    @property
    def below(self) -> tuple[int, ...]:
        """Cumulative counts, one more than there are bounds."""
        cumulative, total = [], 0
        for count in self._counts:
            total += count
            cumulative.append(total)
        return tuple(cumulative)


@dataclass(frozen=True, slots=True)
class LinkCount:
    """What one link carried since the start."""

    address: str
    frames: int
    lost: int
    bad_bytes: int
    sent_frames: int
    send_errors: int
    dropped: int = 0  # datagrams or pieces that arrived faster than they were processed


@dataclass(frozen=True, slots=True)
class ReceiverCount:
    """What one receiver sent since the start, and how it is now.

    `bad` counts what was not understood, by reason, `dropped` pieces that arrived faster than they were
    processed; `aircraft` were heard in the last minute. `silent_s` is the time since the last message.
    """

    address: str
    title: str
    lacks: str
    messages: int
    reports: int
    bad: tuple[tuple[str, int], ...]
    dropped: int
    aircraft: int
    silent_s: float
    problem: str | None

    @classmethod
    def of(cls, one: ReceiverLink, now_s: float) -> "ReceiverCount":
        """The counts of a receiver at `now_s` by the engine's clock."""
        dropped = one.link.counters.dropped
        return cls._of(one.receiver, dropped, one.silent_s(now_s), one.problem(now_s), now_s)

    @classmethod
    def of_recorded(cls, receiver: Receiver, now_s: float) -> "ReceiverCount":
        """The counts of a receiver in a replay: its link is not known, only what came over it."""
        heard_s = receiver.taken_s if receiver.heard_s is None else receiver.heard_s
        silent_s = 0.0 if heard_s is None else now_s - heard_s
        silent = silent_s >= SILENCE_S
        problem = f"silent for {SILENCE_S:.0f} s" if silent else receiver.status
        return cls._of(receiver, 0, silent_s, problem, now_s)

    @classmethod
    def _of(
        cls, receiver: Receiver, dropped: int, silent_s: float, problem: str | None, now_s: float
    ) -> "ReceiverCount":
        counters = receiver.counters
        return cls(
            receiver.address,
            receiver.title,
            receiver.lacks,
            counters.messages,
            counters.reports,
            tuple(sorted(counters.bad.items())),
            dropped,
            receiver.aircraft(now_s),
            silent_s,
            problem,
        )


@dataclass(frozen=True, slots=True)
class Health:
    """Health of the service at one moment; counts since the start.

    `unusable`, `past`, `of_others` and `repeated` are those of `Intake`; `dropped_reports` of traffic came
    faster than they were processed. `late_ticks` were made half an interval after their time, or later.
    """

    uptime_s: float
    tick_s: float  # duration of the last tick
    ticks_below: tuple[int, ...]  # as `LoopTimes.below`
    ticks_total_s: float
    links: tuple[LinkCount, ...]
    receivers: tuple[ReceiverCount, ...] = ()
    skipped_ticks: int = 0
    late_ticks: int = 0
    unusable: int = 0
    past: int = 0
    of_others: int = 0
    repeated: int = 0
    unsent: int = 0  # messages that came too late to be sent
    setpoints_sent: int = 0
    dropped_reports: int = 0
    mavlink_sources: tuple[tuple[str, int], ...] = ()  # reports of traffic by "ADS-B 1/156"
    forwarded: int = 0  # reports of traffic that were sent on
    recording_problem: str | None = None

    @classmethod
    def of(cls, uptime_s: float, times: LoopTimes, links: Sequence[Link]) -> "Health":
        """The health by tick times and links; all other counts are 0."""
        counts = tuple(
            LinkCount(
                link.address,
                (counters := link.counters).frames,
                counters.lost,
                counters.bad_bytes,
                counters.sent_frames,
                counters.send_errors,
                counters.dropped,
            )
            for link in links
        )
        return cls(uptime_s, times.last_s, times.below, times.total_s, counts)
