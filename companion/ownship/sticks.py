"""The pilot's sticks: where they are, and whether they left the place where they were at take-over."""

import math

from companion.mavlink.facts import RcChannels

# Roll, pitch and yaw, in the channel order that both autopilots expect of a receiver. The throttle (channel
# 3) may be anywhere while the autopilot flies.
_STEERING = (0, 1, 3)


class Sticks:
    """Compares the sticks with their marked positions; with `limit_us` 0 they never count as moved."""

    def __init__(self, limit_us: float) -> None:
        self._limit_us = limit_us or math.inf
        self.pulses_us: tuple[int | None, ...] = ()  # the newest; empty before the first report
        self._marked_us: tuple[int | None, ...] | None = None

    def observe(self, fact: RcChannels) -> None:
        """Store the newest positions."""
        self.pulses_us = fact.pulses_us

    def mark(self) -> None:
        """Mark the newest positions; without a report yet, the first ones that are received."""
        self._marked_us = self.pulses_us or None

    @property
    def moved(self) -> bool:
        """Whether a stick is further from its marked position than the limit."""
        if self._marked_us is None:
            self._marked_us = self.pulses_us or None
        now_us, marked_us = self._steering(self.pulses_us), self._steering(self._marked_us or ())
        return any(
            abs(now - marked) > self._limit_us
            for now, marked in zip(now_us, marked_us, strict=True)
            if now is not None and marked is not None
        )

    @staticmethod
    def _steering(pulses_us: tuple[int | None, ...]) -> list[int | None]:
        return [pulses_us[channel] if channel < len(pulses_us) else None for channel in _STEERING]
