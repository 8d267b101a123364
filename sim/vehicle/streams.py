"""The message intervals of one channel, and which messages are due."""

from collections.abc import Collection, Sequence

_TOLERANCE_S = 1e-6


class Streams:
    """The intervals requested on one channel; they end with the channel."""

    def __init__(
        self, now_s: float, default_rate_hz: float, *, default: Sequence[int], streamed: Collection[int]
    ) -> None:
        """Start with the `default` messages at one rate (0: none); `streamed` are those allowed."""
        self.default_rate_hz = default_rate_hz
        self._default_interval_s = 1.0 / default_rate_hz if default_rate_hz > 0.0 else 0.0
        self._default = tuple(default)
        self._streamed = frozenset(streamed)
        self._interval_s: dict[int, float] = {}
        self._due_s: dict[int, float] = {}
        self._stopped: set[int] = set()
        for message_id in self._default:
            self.set_interval(message_id, self._default_interval_s, now_s)
        self._stopped.clear()

    def interval_s(self, message_id: int) -> float:
        """The interval of a message [s], 0 if it is not streamed."""
        return self._interval_s.get(message_id, 0.0)

    def is_stopped(self, message_id: int) -> bool:
        """True if the message was stopped by request."""
        return message_id in self._stopped

    def set_interval(self, message_id: int, interval_s: float, now_s: float) -> bool:
        """Set the interval of a message, 0 stops it; False for one that cannot be streamed."""
        if message_id not in self._streamed:
            return False
        if interval_s <= 0.0:
            self._interval_s.pop(message_id, None)
            self._due_s.pop(message_id, None)
            self._stopped.add(message_id)
        else:
            self._interval_s[message_id] = interval_s
            self._due_s[message_id] = now_s + interval_s
            self._stopped.discard(message_id)
        return True

    def reset_interval(self, message_id: int, now_s: float) -> bool:
        """Restore the default rate."""
        default_s = self._default_interval_s if message_id in self._default else 0.0
        known = self.set_interval(message_id, default_s, now_s)
        self._stopped.discard(message_id)
        return known

    def due(self, now_s: float) -> list[int]:
        """The messages to send now. Missed ones are dropped, not sent later."""
        ready: list[int] = []
        for message_id, due_s in self._due_s.items():
            if due_s <= now_s + _TOLERANCE_S:
                ready.append(message_id)
                interval_s = self._interval_s[message_id]
                self._due_s[message_id] = max(due_s + interval_s, now_s)
        return ready
