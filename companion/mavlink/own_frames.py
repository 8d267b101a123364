"""Our own frames: a router may send them back to us, and a second companion may have our address."""

from collections import deque

# Frames are remembered for this long: no echo is later.
_REMEMBERED_S = 15.0
# A former run of ours may still echo after the start. Later, so many frames that we did not send, within the
# time below, come from another companion.
_STARTED_S = 2.0
_FOREIGN, _FOREIGN_WITHIN_S = 2, 10.0


class OwnFrames:
    """The frames that we sent recently."""

    def __init__(self) -> None:
        self._sent: dict[bytes, float] = {}
        self._first_s: float | None = None
        self._foreign_s: deque[float] = deque(maxlen=_FOREIGN)

    def sent(self, raw: bytes, now_s: float) -> None:
        """Remember a frame."""
        if self._first_s is None:
            self._first_s = now_s
        self._sent.pop(raw, None)
        self._sent[raw] = now_s  # the last one is the newest
        oldest = next(iter(self._sent))
        while now_s - self._sent[oldest] > _REMEMBERED_S:
            del self._sent[oldest]
            oldest = next(iter(self._sent))

    def is_foreign(self, raw: bytes, now_s: float) -> bool:
        """Whether a frame from our address, and those before it, show that another companion has it."""
        if raw in self._sent or self._first_s is None or now_s - self._first_s < _STARTED_S:
            return False
        self._foreign_s.append(now_s)
        return len(self._foreign_s) == _FOREIGN and now_s - self._foreign_s[0] <= _FOREIGN_WITHIN_S
