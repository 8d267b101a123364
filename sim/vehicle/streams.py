"""Which telemetry is due: the message intervals of one channel."""

from collections.abc import Collection, Sequence

_TOLERANCE_S = 1e-6


class Streams:
    """The intervals that one channel has asked for. They belong to the channel and are lost with it."""

    def __init__(
        self, now_s: float, default_rate_hz: float, *, default: Sequence[int], streamed: Collection[int]
    ) -> None:
        """Start with the `default` messages, all at one rate (0: silence); `streamed` are all that can be."""
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
        """The interval of a message, 0 when it is not sent."""
        return self._interval_s.get(message_id, 0.0)

    def is_stopped(self, message_id: int) -> bool:
        """Whether somebody asked not to be sent a message."""
        return message_id in self._stopped

    def set_interval(self, message_id: int, interval_s: float, now_s: float) -> bool:
        """Send a message so often; 0 stops it. False for a message that is not streamed at all."""
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
        """Back to the default rate."""
        default_s = self._default_interval_s if message_id in self._default else 0.0
        known = self.set_interval(message_id, default_s, now_s)
        self._stopped.discard(message_id)
        return known

    def due(self, now_s: float) -> list[int]:
        """The messages to send now. What could not be sent in time is dropped, not caught up."""
        ready: list[int] = []
        for message_id, due_s in self._due_s.items():
            if due_s <= now_s + _TOLERANCE_S:
                ready.append(message_id)
                interval_s = self._interval_s[message_id]
                self._due_s[message_id] = max(due_s + interval_s, now_s)
        return ready
