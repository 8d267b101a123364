"""The pilot's sticks: whether he has taken the aircraft in hand without changing the mode."""

import math

from companion.mavlink.facts import RcChannels

# Roll, pitch and yaw in the order that both autopilots expect of a receiver; the throttle (channel 3) lies
# anywhere while the autopilot flies.
_STEERING = (0, 1, 3)


class Sticks:
    """Compares the sticks with where they were when we took over; `limit_us` 0 never sees them move."""

    def __init__(self, limit_us: float) -> None:
        self._limit_us = limit_us or math.inf
        self._now_us: tuple[int | None, ...] = ()
        self._then_us: tuple[int | None, ...] | None = None

    def observe(self, fact: RcChannels) -> None:
        """Take note of where the sticks are."""
        self._now_us = fact.pulses_us

    def mark(self) -> None:
        """Compare with where they are now, or, while none is heard, with where they will first be."""
        self._then_us = self._now_us or None

    @property
    def moved(self) -> bool:
        """Whether one of them is further from its place than the limit."""
        if self._then_us is None:
            self._then_us = self._now_us or None
        now_us, then_us = self._steering(self._now_us), self._steering(self._then_us or ())
        return any(
            abs(now - then) > self._limit_us
            for now, then in zip(now_us, then_us, strict=True)
            if now is not None and then is not None
        )

    @staticmethod
    def _steering(pulses_us: tuple[int | None, ...]) -> list[int | None]:
        return [pulses_us[place] if place < len(pulses_us) else None for place in _STEERING]
