"""The clock of a log: its time stamps, or the autopilot's boot clock where the stamps make no clock.

The program that recorded the log wrote the stamps. Some step back by half a minute when the computer's clock
is set, others are zero, in milliseconds, or in the wrong byte order. A replay whose time stands still would
see nothing.
"""

import struct
from typing import NamedTuple

from companion.mavlink.dialect import mavlink
from companion.mavlink.framing import Frame

# A larger step forward means a damaged log or another flight: the clock goes on from where it was.
_LONGEST_GAP_US = 60_000_000
# Frames of several links are written a little out of order. After a larger step back the clock goes on, too.
_OUT_OF_ORDER_US = 1_000_000
# Stamps of the years 2001 to 2096 in nanoseconds.
_FIRST_NS, _LAST_NS = 10**18, 4 * 10**18
_POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
_unpack_boot_ms = struct.Struct("<I").unpack_from
_BOOT_BYTES = 4
# The stamps make no clock when they advance by less than this share of the autopilot's time, or by more than
# its inverse, this many times in a row. A simulation may run many times as fast as the computer's clock.
_SHARE = 0.02
_JUDGED_AFTER_US = 2_000_000
_JUDGEMENTS = 2
# A longer silence of the autopilot's clock is another flight, or its restart.
_LONGEST_SILENCE_US = 600_000_000


class _Mark(NamedTuple):
    """The autopilot's time and ours at one record."""

    sender: tuple[int, int]
    boot_us: int
    now_us: int


class LogClock:
    """Converts time stamps to a time that never runs backwards; without jumps the two are equal.

    `jumps` counts the steps of the stamps that were not followed. `by_boot_time` is set once the stamps have
    made no clock: from then on the time is that of the first autopilot whose positions are in the log.
    """

    def __init__(self, longest_gap_us: int = _LONGEST_GAP_US) -> None:
        self._longest_gap_us = longest_gap_us
        self._now_us: int | None = None
        self._offset_us = 0
        self._mark: _Mark | None = None
        self._against = 0
        self.jumps = 0
        self.by_boot_time = False

    def at(self, stamp_us: int, frame: Frame | None = None) -> int:
        """Time [us] of the record with this stamp and frame."""
        if _FIRST_NS <= stamp_us < _LAST_NS:
            stamp_us //= 1000
        if self._now_us is None:
            self._now_us = stamp_us
        if not self.by_boot_time:
            self._now_us = self._follow(stamp_us, self._now_us)
        if frame is not None and frame.message_id == _POSITION:
            self._now_us = self._compare(frame, self._now_us)
        return self._now_us

    def _follow(self, stamp_us: int, before_us: int) -> int:
        now_us = stamp_us + self._offset_us
        if not -_OUT_OF_ORDER_US <= now_us - before_us <= self._longest_gap_us:
            self.jumps += 1
            self._offset_us = before_us - stamp_us
            return before_us
        return max(now_us, before_us)

    def _compare(self, frame: Frame, now_us: int) -> int:
        """The time after a record that has the autopilot's time too."""
        sender = (frame.system_id, frame.component_id)
        (boot_ms,) = _unpack_boot_ms(frame.payload[:_BOOT_BYTES].ljust(_BOOT_BYTES, b"\0"))
        boot_us: int = boot_ms * 1000
        mark = self._mark
        if mark is not None and sender != mark.sender:
            return now_us
        if mark is None or not 0 <= boot_us - mark.boot_us <= _LONGEST_SILENCE_US:
            self._mark = _Mark(sender, boot_us, now_us)
            return now_us
        passed_us = boot_us - mark.boot_us
        if self.by_boot_time:
            now_us = max(mark.now_us + passed_us, now_us)
            self._mark = _Mark(sender, boot_us, now_us)
            return now_us
        if passed_us < _JUDGED_AFTER_US:
            return now_us
        self._mark = _Mark(sender, boot_us, now_us)
        stamped_us = now_us - mark.now_us
        stands = stamped_us < _SHARE * passed_us
        self._against = self._against + 1 if stands or stamped_us * _SHARE > passed_us else 0
        self.by_boot_time = self._against >= _JUDGEMENTS
        if not stands:
            return now_us
        self._mark = _Mark(sender, boot_us, mark.now_us + passed_us)
        self._offset_us += mark.now_us + passed_us - now_us
        return mark.now_us + passed_us
