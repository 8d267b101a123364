"""Our own frames: a router may send them back to us, and a second companion may have our address."""

from collections import deque

from companion.mavlink.recent_frames import RecentFrames

# A former run of ours may still echo after the start. Later, so many frames that we did not send, within the
# time below, come from another companion.
_STARTED_S = 2.0
_FOREIGN, _FOREIGN_WITHIN_S = 2, 10.0


class OwnFrames:
    """The frames that we sent recently."""

    def __init__(self) -> None:
        self._sent: RecentFrames[bytes] = RecentFrames()
        self._first_s: float | None = None
        self._foreign_s: deque[float] = deque(maxlen=_FOREIGN)

    def sent(self, raw: bytes, now_s: float) -> None:
        """Remember a frame."""
        if self._first_s is None:
            self._first_s = now_s
        self._sent.put(raw, raw, now_s)

    def is_echo(self, raw: bytes, now_s: float) -> bool:
        """Whether this is a frame of ours that comes back."""
        return self._sent.holds(raw, raw, now_s)

    def is_foreign(self, raw: bytes, now_s: float) -> bool:
        """Whether a frame from our address, and those before it, show that another companion has it."""
        if self._first_s is None or now_s - self._first_s < _STARTED_S:
            return False
        if self.is_echo(raw, now_s):
            return False
        self._foreign_s.append(now_s)
        return len(self._foreign_s) == _FOREIGN and now_s - self._foreign_s[0] <= _FOREIGN_WITHIN_S
