"""When frames were true: the boot clock of their sender, mapped to our clock.

A frame is not as young as its arrival. A second path may deliver a copy seconds later, a link may hold frames
back, and after a stall of our own a whole queue arrives at once. Many messages carry `time_boot_ms`. Its
difference from our clock is smallest for the frames that were the fastest, so every other frame is later by
what exceeds that. An answer to TIMESYNC shows how old a frame can be at the most.

HEARTBEAT has no time. It belongs to the frames whose sequence numbers surround it, and one that was overtaken
by a newer one is of the past.

A boot clock that runs backwards has three causes, which are told apart here: late copies repeat what was
received before; a restart begins near 0, in the silence of the former clock; everything else comes from
another vehicle with the same address.
"""

import math
import struct
from collections import OrderedDict, deque
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame

# A frame later than this is not used, as its content is of the past.
LATEST_S = 2.0

_WRAP = 256  # of the sequence number
# Messages with `time_boot_ms`, and its place in the payload.
_BOOT_TIME_AT = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: 0,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 8,
}
_POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
_PLACE = slice(4, 12)  # latitude and longitude in its payload
_LONGEST_PAYLOAD = 12
_unpack_ms = struct.Struct("<I").unpack_from
# Datagrams overtake each other by less than this.
_REORDERED_S = 0.6
# Two heartbeats of different paths are further apart than this.
_SAME_HEARTBEAT_S = 0.05
# How far a boot clock may run ahead of ours between two frames: losses, and simulations that run fast.
_AHEAD_S, _FASTEST = 2.0, 3.0
# Without a frame for this long a clock has ended: the autopilot restarted.
_ENDED_S = 1.5
# An autopilot boots and sends within this time after it was last heard.
_BOOT_S = 10.0
# After this time without the former clock any other one is believed.
_FORGOTTEN_S = 10.0
# Frames of interest on one path follow each other within this many numbers, more after a loss of frames, and
# are at most so many numbers out of order.
_NEXT_WITHIN, _MOST_PER_S, _LATE_WITHIN = 24, 400.0, 32
_PATH_SILENT_S = 2.0
# After this many outdated heartbeats in a row the sender must have restarted.
_MOST_OUTDATED = 3
# The lateness of a path counts for frames without a time until this long after the last one with a time.
_LATENESS_KNOWN_S = 1.5
# Two clocks drift apart by less than this share; a simulator that runs slowly by far more. While TIMESYNC is
# answered, it is known how late frames are, and the smaller share counts.
_DRIFT, _DRIFT_OF_SIMULATORS = 1e-3, 0.5
# Between two frames, so that a stall is not taken for a drift.
_LONGEST_DRIFT_S = 0.2
_ANSWERED_WITHIN_S = 10.0
_REMEMBERED = 600  # positions: one minute
# So many positions, most of them never received before, come from another vehicle.
_NEWS_OF_ANOTHER = 5
_LEAST_SHARE_OF_COPIES = 0.2
_COPIES_OF_ANOTHER = 3
_MOST_OTHERS = 4
_HEARTBEATS = 32  # remembered: of some seconds, whatever their rate


class Origin(Enum):
    """What a frame is."""

    PRESENT = "present"
    PAST = "past"  # a late copy, or held back on its way
    OTHER = "other"  # from another vehicle with the same address


class Timing(NamedTuple):
    """When a frame was true, on our clock [s], and what it is."""

    true_s: float
    origin: Origin


@dataclass(slots=True)
class _Clock:
    """Frames whose boot clock runs forward together."""

    boot_s: float
    received_s: float
    # The difference between reception and boot time of a frame without delay.
    fastest_s: float = math.inf
    late_s: float = 0.0  # of the newest frame
    answered_s: float = -math.inf  # the last answer to a TIMESYNC
    positions: OrderedDict[float, bytes] = field(default_factory=OrderedDict)  # by boot time
    copies: int = 0  # positions that another clock brought before
    # Positions that none did, with one of the present clock in between: after a restart there is none.
    news: int = 0
    counted_s: float = -math.inf

    def follows(self, boot_s: float, received_s: float) -> bool:
        """Whether a frame continues this clock."""
        ahead_s = boot_s - self.boot_s
        return -_REORDERED_S <= ahead_s <= _AHEAD_S + _FASTEST * max(received_s - self.received_s, 0.0)

    def observe(self, boot_s: float, received_s: float) -> None:
        """Go on to a frame, and measure how late it is."""
        offset_s = received_s - boot_s
        answered = received_s - self.answered_s <= _ANSWERED_WITHIN_S
        drift = _DRIFT if answered else _DRIFT_OF_SIMULATORS
        # Least possible offset: it grows with the drift, from one frame to the next.
        passed_s = min(max(received_s - self.received_s, 0.0), _LONGEST_DRIFT_S)
        least_s = self.fastest_s + drift * passed_s
        self.fastest_s = min(offset_s, least_s)
        self.late_s = offset_s - self.fastest_s
        self.boot_s, self.received_s = max(boot_s, self.boot_s), received_s

    def lateness_s(self, other: "_Clock") -> float:
        """How late the newest frame of another clock was, if both are clocks of one vehicle [s]."""
        return other.received_s - other.boot_s - self.fastest_s

    def limit_lateness(self, round_trip_s: float) -> None:
        """Use an answer to our TIMESYNC: what is received now is at most a round trip old."""
        if self.late_s > round_trip_s:
            self.fastest_s += self.late_s - round_trip_s / 2.0
            self.late_s = round_trip_s / 2.0

    @property
    def is_of_another(self) -> bool:
        """Whether its positions are not those that we received before."""
        positions = self.copies + self.news
        return self.news >= _NEWS_OF_ANOTHER and self.copies < _LEAST_SHARE_OF_COPIES * positions


@dataclass(slots=True)
class _Path:
    """Frames with consecutive sequence numbers, and their clock; numbers are counted on over all wraps."""

    newest: int
    received_s: float
    clock: _Clock | None = None
    late_s: float = 0.0  # of its newest frame with a time
    heartbeat: int | None = None  # number of the newest heartbeat
    outdated: int = 0  # heartbeats in a row

    def number(self, sequence: int) -> int:
        """The number of a frame, near the newest one."""
        ahead = (sequence - self.newest + _WRAP // 2) % _WRAP - _WRAP // 2
        return self.newest + ahead

    def apart(self, sequence: int, received_s: float) -> float:
        """How far the frame is from the next one expected; inf when it is not of this path."""
        ahead = self.number(sequence) - self.newest
        if 0 < ahead <= _NEXT_WITHIN + _MOST_PER_S * max(received_s - self.received_s, 0.0):
            return ahead
        return _WRAP / 2 - ahead if -_LATE_WITHIN < ahead <= 0 else math.inf

    def is_overtaken(self, number: int) -> bool:
        """Whether the heartbeat with this number is not newer than one received before."""
        if self.heartbeat is not None and number <= self.heartbeat and self.outdated < _MOST_OUTDATED:
            self.outdated += 1
            return True
        self.heartbeat, self.outdated = number, 0
        return False


@dataclass(slots=True)
class _Sender:
    present: _Clock | None = None
    others: list[_Clock] = field(default_factory=list)
    heartbeat_s: float = -math.inf  # when the newest heartbeat was true
    heartbeat_path: _Path | None = None  # which brought it
    heartbeats: deque[bytes] = field(default_factory=lambda: deque(maxlen=_HEARTBEATS))  # the newest ones
    paths: list[_Path] = field(default_factory=list)


class VehicleClocks:
    """The clocks of all senders, over all links: call `judge` for every frame of interest, in order."""

    def __init__(self) -> None:
        self._senders: dict[tuple[int, int], _Sender] = {}

    def judge(self, frame: Frame, received_s: float) -> Timing:
        """When a frame was true, and whether it is of the present; `received_s` is on our clock."""
        sender = self._senders.setdefault((frame.system_id, frame.component_id), _Sender())
        boot_s, clock = boot_time_s(frame), None
        if boot_s is not None:
            clock = _clock_of(sender, boot_s, received_s)
            clock.observe(boot_s, received_s)
            if frame.message_id == _POSITION:
                _compare(sender, clock, boot_s, frame.payload[_PLACE])
        path, number = _path_of(sender, frame.sequence, clock, received_s)
        if clock is not None:
            path.late_s = clock.late_s
        timing = _timing(sender, path, boot_s is not None, received_s)
        if frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT or timing.origin is not Origin.PRESENT:
            return timing
        # A mode change sends a heartbeat at once, maybe just after another one: on one path the numbers tell
        # which is newer, unless it is a copy that was counted to the wrong path.
        since_s = timing.true_s - sender.heartbeat_s
        is_copy = frame.raw in sender.heartbeats
        sender.heartbeats.append(frame.raw)
        in_order = path is sender.heartbeat_path and not path.outdated and not is_copy
        is_newer = (in_order and since_s > -_SAME_HEARTBEAT_S) or since_s > _SAME_HEARTBEAT_S
        is_newer |= path.clock is None
        if path.is_overtaken(number) or not is_newer:
            return timing._replace(origin=Origin.PAST)
        sender.heartbeat_s, sender.heartbeat_path = timing.true_s, path
        return timing

    def answered(self, frame: Frame, asked_s: float, received_s: float) -> None:
        """Use an answer to the TIMESYNC that we sent at `asked_s`."""
        sender = self._senders.get((frame.system_id, frame.component_id))
        if sender is None or sender.present is None or received_s < asked_s:
            return
        sender.present.answered_s = received_s
        path, _ = _path_of(sender, frame.sequence, None, received_s)
        if path.clock in (None, sender.present):
            sender.present.limit_lateness(received_s - asked_s)


def boot_time_s(frame: Frame) -> float | None:
    """The boot time in a frame [s]; `None` when its message has none, or the sender does not know it."""
    at = _BOOT_TIME_AT.get(frame.message_id)
    if at is None:
        return None
    (boot_ms,) = _unpack_ms(frame.payload[:_LONGEST_PAYLOAD].ljust(_LONGEST_PAYLOAD, b"\0"), at)
    return boot_ms / 1000.0 if boot_ms else None


def _path_of(sender: _Sender, sequence: int, clock: _Clock | None, received_s: float) -> tuple[_Path, int]:
    """The path that the frame came by, whose numbers are the nearest, and the frame's number on it.

    `clock` is that of a frame with a time. A path whose newest number is before the frame's is preferred to
    one whose newest number is after it.
    """
    sender.paths = [path for path in sender.paths if received_s - path.received_s < _PATH_SILENT_S]
    found, least = None, float(_WRAP)
    for path in sender.paths:
        if clock is None or path.clock in (None, clock):
            apart = path.apart(sequence, received_s)
            if apart < least:
                found, least = path, apart
    if found is None:
        found = _Path(sequence, received_s)
        sender.paths.append(found)
    number = found.number(sequence)
    found.newest, found.received_s = max(found.newest, number), received_s
    found.clock = clock or found.clock
    return found, number


def _timing(sender: _Sender, path: _Path, is_timed: bool, received_s: float) -> Timing:
    """When a frame of this path was true; frames without a time share the lateness of the last timed one.

    A path that begins beside others may be a late one: its frames count once one of them has a time.
    """
    clock = path.clock or sender.present
    if clock is None:
        return Timing(received_s, Origin.PRESENT)
    if path.clock is None and any(other.clock is clock for other in sender.paths):
        return Timing(received_s, Origin.PAST)
    if clock is not sender.present:
        late_s = 0.0 if sender.present is None else max(sender.present.lateness_s(clock), 0.0)
        return Timing(received_s - late_s, Origin.OTHER if clock.is_of_another else Origin.PAST)
    if not is_timed and received_s - clock.received_s > _LATENESS_KNOWN_S:
        # Without the present clock, frames of another clock say that this one may be late as well.
        others = any(received_s - one.received_s <= _LATENESS_KNOWN_S for one in sender.others)
        return Timing(received_s, Origin.PAST if others else Origin.PRESENT)
    return Timing(received_s - path.late_s, Origin.PRESENT if path.late_s <= LATEST_S else Origin.PAST)


def _clock_of(sender: _Sender, boot_s: float, received_s: float) -> _Clock:
    """The clock that the frame continues, or a new one; a restart becomes the present clock."""
    present = sender.present
    if present is not None and present.follows(boot_s, received_s):
        return present
    followed = [clock for clock in sender.others if clock.follows(boot_s, received_s)]
    clock = min(followed, key=lambda one: abs(boot_s - one.boot_s), default=None)
    if clock is None:
        clock = _Clock(boot_s, received_s)
        sender.others = [*sender.others[-_MOST_OTHERS + 1 :], clock]
    if present is None or _has_restarted(present, boot_s, received_s):
        sender.present = clock
        sender.others.remove(clock)
        sender.paths.clear()  # their numbers went on from before the restart
    return clock


def _has_restarted(present: _Clock, boot_s: float, received_s: float) -> bool:
    silence_s = received_s - present.received_s
    return silence_s > _FORGOTTEN_S or (silence_s > _ENDED_S and boot_s <= silence_s + _BOOT_S)


def _compare(sender: _Sender, clock: _Clock, boot_s: float, place: bytes) -> None:
    """Look whether another clock brought this position before; if it was the present one, that is a copy."""
    clocks = sender.others if clock is sender.present else [sender.present, *sender.others]
    original = next(
        (
            one
            for one in clocks
            if one is not None and one is not clock and one.positions.get(boot_s) == place
        ),
        None,
    )
    if original is None:
        present_s = math.inf if sender.present is None else sender.present.received_s
        if clock is not sender.present and present_s > clock.counted_s:
            clock.news, clock.counted_s = clock.news + 1, present_s
        clock.positions[boot_s] = place
        if len(clock.positions) > _REMEMBERED:
            clock.positions.popitem(last=False)
        return
    clock.copies += 1
    if clock is sender.present and clock.copies >= _COPIES_OF_ANOTHER:
        sender.present = original  # what we took for the present is a late copy of this
        sender.others = [*(one for one in sender.others if one is not original), clock]
