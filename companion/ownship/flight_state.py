"""The flight state that the autopilot reports: armed, mode, landed state, failsafe, fence breach."""

import math

from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import FenceStatus, Heartbeat, LandedState

# FENCE_STATUS comes once a second while the fence is enabled.
_FENCE_HEARD_S = 10.0
# The MAV_STATEs of an autopilot in a failsafe.
_FAILSAFE = frozenset(
    {
        mavlink.MAV_STATE_CRITICAL,
        mavlink.MAV_STATE_EMERGENCY,
        mavlink.MAV_STATE_POWEROFF,
        mavlink.MAV_STATE_FLIGHT_TERMINATION,
    }
)


class FlightState:
    """The newest flight state; the landed state is `None` while it is unknown."""

    def __init__(self) -> None:
        self.armed = False
        self.custom_mode = 0
        self.failsafe = False
        self.fence_breached = False
        self.landed_state_heard = False
        self._fence_s = -math.inf
        self._landed_state: int | None = None

    def observe_heartbeat(self, fact: Heartbeat, now_s: float) -> None:
        """Store everything in a heartbeat except its mode (see `Aircraft.enter_mode`)."""
        self.armed = fact.armed
        self.failsafe = fact.system_status in _FAILSAFE
        # When the fence is switched off, FENCE_STATUS ends without a last report.
        self.fence_breached &= now_s - self._fence_s < _FENCE_HEARD_S

    def observe_fence(self, fact: FenceStatus, now_s: float) -> None:
        """Store whether the fence is breached."""
        self.fence_breached, self._fence_s = fact.breached, now_s

    def observe_landed_state(self, fact: LandedState) -> None:
        """Store the landed state."""
        self._landed_state, self.landed_state_heard = fact.landed_state, True

    @property
    def may_be_in_the_air(self) -> bool:
        """Whether the landed state is unknown, or in the air and neither taking off nor landing."""
        return self._landed_state in (None, mavlink.MAV_LANDED_STATE_IN_AIR)

    @property
    def landing(self) -> bool:
        """Whether the aircraft is landing or on the ground."""
        return self._landed_state in (mavlink.MAV_LANDED_STATE_ON_GROUND, mavlink.MAV_LANDED_STATE_LANDING)
