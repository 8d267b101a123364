"""Our autopilot as it reports itself: its identity, the contact with it, the sticks, and the flight state."""

import math

from companion.autopilots import Adapter, choose
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import FenceStatus, Heartbeat, LandedState, RcChannels, Sender

# Aeroplanes, and those VTOLs that fly like one.
_FIXED_WINGS = frozenset({mavlink.MAV_TYPE_FIXED_WING, *range(19, 26)})
# Without heartbeats for this long the autopilot is gone or restarting.
_HEARTBEAT_LOST_S = 5.0
# Many messages come in a second. Without any for this long the link is lost, and ours do not arrive either.
_SILENCE_S = 1.0
# Messages that come several times a second, such as ATTITUDE_TARGET, have arrived again by then.
_CONTACT_RENEWED_S = 1.0
# Roll, pitch and yaw, in the channel order that both autopilots expect of a receiver. The throttle (channel
# 3) may be anywhere while the autopilot flies.
_STEERING = (0, 1, 3)
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


class Identity:
    """Adopts one autopilot and keeps it.

    `autopilot` is a MAV_AUTOPILOT. If it or `system_id` is given, no other autopilot is adopted. Without
    `system_id` the adoption waits `adopt_after_s`, and none is adopted while several are heard.
    """

    def __init__(self, system_id: int | None, autopilot: int | None, adopt_after_s: float) -> None:
        self._wanted_system_id = system_id
        self._wanted_autopilot = autopilot
        self._adopt_after_s = adopt_after_s
        self._first_heard_s: float | None = None
        self.adapter: Adapter | None = None
        self.adopted_s = -math.inf
        self.fixed_wing = False
        self.version: str | None = None
        self.others: set[int] = set()  # systems with another autopilot that could be ours
        self.unwanted_since_s: dict[int, float] = {}  # systems whose autopilot is not the configured one

    @property
    def sender(self) -> Sender | None:
        """The address of our autopilot."""
        return None if self.adapter is None else self.adapter.target

    def expect(self, system_id: int) -> None:
        """Adopt the autopilot of this system without waiting, unless another system is configured."""
        if self._wanted_system_id is None:
            self._wanted_system_id = system_id

    def is_ours(self, fact: Heartbeat, now_s: float) -> bool:
        """Whether the heartbeat comes from our autopilot; may adopt the sender."""
        if fact.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        if self.adapter is None:
            self._consider(fact, now_s)
        if fact.sender == self.sender:
            return True
        if self._is_wanted(fact):
            self.others.add(fact.sender.system_id)
        else:
            self.unwanted_since_s.setdefault(fact.sender.system_id, now_s)
        return False

    def _is_wanted(self, fact: Heartbeat) -> bool:
        return self._wanted_system_id in (None, fact.sender.system_id) and self._wanted_autopilot in (
            None,
            fact.autopilot,
        )

    def _consider(self, fact: Heartbeat, now_s: float) -> None:
        """Adopt the sender, unless another one is configured or several are heard."""
        if not self._is_wanted(fact):
            return
        if self._first_heard_s is None:
            self._first_heard_s = now_s
        waited = now_s - self._first_heard_s >= self._adopt_after_s
        alone = not self.others - {fact.sender.system_id}
        if self._wanted_system_id is None and not (waited and alone):
            return
        self.adapter = choose(fact.autopilot, fact.sender)
        self.adopted_s = now_s
        self.fixed_wing = fact.vehicle_type in _FIXED_WINGS
        self.others.discard(fact.sender.system_id)


class Contact:
    """When the autopilot was last heard [s], and how its clock differs from ours."""

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

    def contact_just_regained(self, now_s: float) -> bool:
        """Whether a silence ended so recently that not all frequent messages have arrived since."""
        return now_s - self._silent_until_s < _CONTACT_RENEWED_S

    def since_silence_s(self, now_s: float) -> float:
        """Time since the last silence ended [s]; inf if there was none."""
        return now_s - self._silent_until_s


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
