"""The state of the link to our autopilot: when it was heard, and when a silence ended."""

import math

# Without heartbeats for this long the autopilot is gone or restarting.
_HEARTBEAT_LOST_S = 5.0
# Many messages come in a second. Without any for this long the link is lost, and ours do not arrive either.
_SILENCE_S = 1.0
# Messages that come several times a second, such as ATTITUDE_TARGET, have arrived again by then.
_RENEWED_S = 1.0


class Contact:
    """Times [s] of the newest heartbeat and of the newest fact, and the autopilot's clock."""

    def __init__(self) -> None:
        self.heartbeat_s = -math.inf
        self.clock_offset_s: float | None = None  # the autopilot's Unix time minus ours
        self._fact_s = -math.inf
        self._silent_until_s = -math.inf

    def observe(self, now_s: float) -> None:
        """Note that a fact has arrived."""
        if now_s - self._fact_s > _SILENCE_S and math.isfinite(self._fact_s):
            self._silent_until_s = now_s
        self._fact_s = now_s

    def observe_clock(self, unix_s: float | None, now_s: float) -> None:
        """Compare the autopilot's Unix time with ours; `None`: it has none yet."""
        self.clock_offset_s = None if unix_s is None else unix_s - now_s

    def heard(self, now_s: float) -> bool:
        """Whether heartbeats arrive."""
        return now_s - self.heartbeat_s < _HEARTBEAT_LOST_S

    def in_contact(self, now_s: float) -> bool:
        """Whether messages arrive right now, with a heartbeat since the last silence."""
        return now_s - self._fact_s <= _SILENCE_S and self.heartbeat_s >= self._silent_until_s

    def just_back(self, now_s: float) -> bool:
        """Whether a silence ended so recently that not all frequent messages have arrived since."""
        return now_s - self._silent_until_s < _RENEWED_S

    def since_silence_s(self, now_s: float) -> float:
        """Time since the last silence ended [s]; infinite when there was none."""
        return now_s - self._silent_until_s
