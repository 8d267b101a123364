"""Our autopilot as it reports itself: its identity, the contact with it, the sticks, and the flight state."""

import math

from companion.autopilots import NAMES, Adapter, choose
from companion.mavlink.dialect import AEROPLANE, VTOLS, is_vehicle, mavlink
from companion.mavlink.facts import FenceStatus, Heartbeat, LandedState, RcChannels, Sender

# After a second without setpoints PX4 leaves its guided mode.
_UPLINK_LOST_S = 0.8
# Another autopilot, vehicle or companion counts until it has been silent for this long.
_OTHER_HEARD_S = 10.0
# Without heartbeats for this long the autopilot is gone or restarting.
_HEARTBEAT_LOST_S = 5.0
# Many messages come in a second. Without any for this long the link is lost, and ours do not arrive either.
_SILENCE_S = 1.0
# Messages that come several times a second, such as ATTITUDE_TARGET, have arrived again by then.
_CONTACT_RENEWED_S = 1.0
# Roll, pitch and yaw, in the channel order that both autopilots expect of a receiver. The throttle (channel
# 3) may be anywhere while the autopilot flies.
_STEERING = (0, 1, 3)
# A pilot who flies with the sticks moves them more often than this.
_AT_REST_S = 10.0
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
        self.vehicle_type: int | None = None
        self.version: str | None = None
        self._others_s: dict[int, float] = {}  # systems with another autopilot that could be ours
        self._unwanted_s: dict[int, tuple[float, float]] = {}  # not the one configured: first, last heard
        self._companion: tuple[int, float] | None = None  # another one: its component id, last heard
        self._impostor_s = -math.inf  # another vehicle with the address of ours

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
        if not is_vehicle(fact.vehicle_type, fact.autopilot):
            return False
        if self.adapter is None:
            self._consider(fact, now_s)
        if fact.sender == self.sender:
            return True
        system_id = fact.sender.system_id
        if self._is_wanted(fact):
            self._others_s[system_id] = now_s
        else:
            first_s, _ = self._unwanted_s.get(system_id, (now_s, now_s))
            self._unwanted_s[system_id] = first_s, now_s
        return False

    def others(self, now_s: float) -> set[int]:
        """Systems heard now with another autopilot that could be ours."""
        return {number for number, at_s in self._others_s.items() if now_s - at_s <= _OTHER_HEARD_S}

    def unwanted_since_s(self, now_s: float) -> dict[int, float]:
        """Systems heard now whose autopilot is not the configured one, and since when."""
        return {
            number: first_s
            for number, (first_s, last_s) in self._unwanted_s.items()
            if now_s - last_s <= _OTHER_HEARD_S
        }

    def observe_companion(self, component_id: int, now_s: float) -> None:
        """Note another companion in our system that avoids too."""
        self._companion = component_id, now_s

    def observe_component(self, fact: Heartbeat, us: Sender, now_s: float) -> None:
        """Note another component of our system that announces itself as a companion like us."""
        if fact.sender.system_id != us.system_id:
            return
        avoids = fact.sender.component_id == mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE
        if fact.is_companion or (avoids and fact.autopilot == mavlink.MAV_AUTOPILOT_INVALID):
            self.observe_companion(fact.sender.component_id, now_s)

    def other_companion(self, now_s: float) -> int | None:
        """Component id of another companion that is heard now; `None` without one."""
        if self._companion is None or now_s - self._companion[1] > _OTHER_HEARD_S:
            return None
        return self._companion[0]

    def observe_impostor(self, now_s: float) -> None:
        """Note that another vehicle has the address of ours."""
        self._impostor_s = now_s

    def is_ambiguous(self, now_s: float) -> bool:
        """Whether two vehicles have our autopilot's address: commands would reach both."""
        return now_s - self._impostor_s <= _OTHER_HEARD_S

    def _is_wanted(self, fact: Heartbeat) -> bool:
        """Whether it could be ours: the configured one, or by default any that we have an adapter for."""
        kinds = NAMES.values() if self._wanted_autopilot is None else (self._wanted_autopilot,)
        return self._wanted_system_id in (None, fact.sender.system_id) and fact.autopilot in kinds

    def _consider(self, fact: Heartbeat, now_s: float) -> None:
        """Adopt the sender, unless another one is configured or several are heard."""
        if not self._is_wanted(fact):
            return
        if self._first_heard_s is None:
            self._first_heard_s = now_s
        waited = now_s - self._first_heard_s >= self._adopt_after_s
        alone = not self.others(now_s) - {fact.sender.system_id}
        if self._wanted_system_id is None and not (waited and alone):
            return
        self.adapter = choose(fact.autopilot, fact.sender)
        self.adopted_s = now_s
        self.vehicle_type = fact.vehicle_type
        self._others_s.pop(fact.sender.system_id, None)


class Contact:
    """When the autopilot was last heard [s], and how its clock differs from ours."""

    def __init__(self) -> None:
        self.heartbeat_s = -math.inf
        self.clock_offset_s: float | None = None  # the autopilot's Unix time minus ours
        self._boot_time_s = -math.inf
        self._fact_s = -math.inf
        self._silent_until_s = -math.inf
        self._answered_s: float | None = None  # when the newest message was sent that was answered
        self._round_trip_s = 0.0
        self._gap_until_s = -math.inf  # of our own: nothing from before its end shows the present

    def observe(self, now_s: float) -> None:
        """Note that a fact has arrived."""
        if now_s - self._fact_s > _SILENCE_S and math.isfinite(self._fact_s):
            self._silent_until_s = now_s
        self._fact_s = max(now_s, self._fact_s)

    def restarted(self, boot_time_s: float) -> bool:
        """Whether the autopilot has restarted, by the time since its start in its newest position."""
        before, self._boot_time_s = self._boot_time_s, boot_time_s
        return boot_time_s < before - 1.0

    def observe_clock(self, unix_s: float | None, now_s: float) -> None:
        """Compare the autopilot's Unix time with ours; `None`: it has none yet."""
        self.clock_offset_s = None if unix_s is None else unix_s - now_s

    def observe_answer(self, asked_s: float, now_s: float) -> None:
        """Note an answer to what we sent at `asked_s`."""
        if self._answered_s is None or asked_s > self._answered_s:
            self._answered_s, self._round_trip_s = asked_s, now_s - asked_s

    def uplink_interrupted(self, now_s: float) -> bool:
        """Whether nothing that we sent for about a second is answered, although it was before.

        It counts only while requests are sent at every tick.
        """
        if self._answered_s is None:
            return False
        return now_s - self._answered_s > _UPLINK_LOST_S + 2.0 * self._round_trip_s

    def note_gap(self, now_s: float) -> None:
        """Note that we did nothing until now: what is known is of before."""
        self._silent_until_s = self._gap_until_s = now_s

    @property
    def resynchronized(self) -> bool:
        """Whether a heartbeat from after the last gap of ours was received."""
        return self.heartbeat_s >= self._gap_until_s

    def heard(self, now_s: float) -> bool:
        """Whether heartbeats arrive."""
        return now_s - self.heartbeat_s < _HEARTBEAT_LOST_S

    def in_contact(self, now_s: float) -> bool:
        """Whether messages arrive right now, with a heartbeat since the last silence."""
        return now_s - self._fact_s <= _SILENCE_S and self.heartbeat_s >= self._silent_until_s

    def just_regained(self, now_s: float) -> bool:
        """Whether a silence ended so recently that not all frequent messages have arrived since."""
        return now_s - self._silent_until_s < _CONTACT_RENEWED_S


class Sticks:
    """Compares the sticks with their marked positions; with `limit_us` 0 they never count as moved."""

    def __init__(self, limit_us: float) -> None:
        self._limit_us = limit_us or math.inf
        self.pulses_us: tuple[int | None, ...] = ()  # the newest; empty before the first report
        self._marked_us: tuple[int | None, ...] | None = None
        self._rested_us: tuple[int | None, ...] = ()  # where they were when they moved last
        self._motion_s = -math.inf

    def observe(self, fact: RcChannels, now_s: float) -> None:
        """Store the newest positions."""
        self.pulses_us = fact.pulses_us
        if not self._rested_us or self._differ(self._rested_us, 0.5 * self._limit_us):
            self._rested_us, self._motion_s = fact.pulses_us, now_s

    def in_use(self, now_s: float) -> bool:
        """Whether the pilot flies with them: moved, and not at rest since then."""
        return self.moved and now_s - self._motion_s < _AT_REST_S

    def mark(self) -> None:
        """Mark the newest positions; without a report yet, the first ones that are received."""
        self._marked_us = self.pulses_us or None

    @property
    def moved(self) -> bool:
        """Whether a stick is further from its marked position than the limit."""
        if self._marked_us is None:
            self._marked_us = self.pulses_us or None
        return self._differ(self._marked_us or (), self._limit_us)

    def _differ(self, from_us: tuple[int | None, ...], limit_us: float) -> bool:
        """Whether a stick is further from these positions than a limit."""
        now_us, other_us = self._steering(self.pulses_us), self._steering(from_us)
        return any(
            abs(now - other) > limit_us
            for now, other in zip(now_us, other_us, strict=True)
            if now is not None and other is not None
        )

    @staticmethod
    def _steering(pulses_us: tuple[int | None, ...]) -> list[int | None]:
        return [pulses_us[channel] if channel < len(pulses_us) else None for channel in _STEERING]


class FlightState:
    """The newest flight state; the landed state is `None` while it is unknown."""

    def __init__(self) -> None:
        self.armed = False
        self.custom_mode = 0
        self.mode_since_s = -math.inf
        self.failsafe = False
        self.fence_breached = False
        self.landed_state_heard = False
        self._fence_s = -math.inf
        self._landed_state: int | None = None
        self._vtol_state: int | None = None

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
        self._vtol_state = fact.vtol_state

    @property
    def may_be_in_the_air(self) -> bool:
        """Whether the landed state is unknown, or in the air and neither taking off nor landing."""
        return self._landed_state in (None, mavlink.MAV_LANDED_STATE_IN_AIR)

    @property
    def in_the_air(self) -> bool:
        """Whether the aircraft reports that it is in the air, neither taking off nor landing."""
        return bool(self._landed_state == mavlink.MAV_LANDED_STATE_IN_AIR)

    def flies_as_wing(self, vehicle_type: int | None) -> bool:
        """Whether it flies as an aeroplane, neither on its rotors nor in transition, as far as is known.

        ArduPlane reports a quadplane as an aeroplane, so the state counts for every type. A VTOL that reports
        no state may be on its rotors.
        """
        if self._vtol_state is None:
            return bool(vehicle_type == AEROPLANE)
        wing = self._vtol_state == mavlink.MAV_VTOL_STATE_FW
        return bool(wing and (vehicle_type == AEROPLANE or vehicle_type in VTOLS))

    @property
    def landing(self) -> bool:
        """Whether the aircraft is landing or on the ground."""
        return self._landed_state in (mavlink.MAV_LANDED_STATE_ON_GROUND, mavlink.MAV_LANDED_STATE_LANDING)
