"""The engine: facts in, effects out, the clock is an argument.

The same object flies the aircraft, replays a log and sits in a test. It holds the aircraft, the traffic, the
avoider and the supervisor together, and decides nothing that one of them could.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

from companion.airspace.altitude_limits import HeightLimits, limit_heights
from companion.airspace.fence_zones import LocalFence
from companion.autopilots import NAMES
from companion.avoidance import Avoider, Envelope
from companion.avoidance.fence import Fence, Zone
from companion.control.handover import Handover
from companion.control.readiness import Readiness
from companion.control.state_machine import WATCHING, State, Supervisor
from companion.engine_config import EngineConfig
from companion.gcs.notices import OperatorNotices
from companion.gcs.requests import GcsRequests
from companion.gcs.settings import Settings
from companion.gcs.statustext import StatusText, TrafficSituation
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AttitudeTarget,
    AutopilotVersion,
    CommandRequest,
    CommandResult,
    Fact,
    Heartbeat,
    OwnPosition,
    Parameter,
    ParameterRequest,
    ParameterSet,
    Sender,
    Traffic,
)
from companion.model import Decision, Goal, Layer, Ownship, Role, Snapshot, Track
from companion.output.decision_record import Circumstances
from companion.output.effects import Effect, Keep, Record, Save
from companion.output.persisted_state import PersistedState
from companion.ownship.aircraft import Aircraft
from companion.ownship.autopilot_queries import HEEDED, AutopilotQueries
from companion.ownship.message_rates import MessageRates
from companion.traffic import Tracker
from companion.traffic.picture import TrafficPicture

# What an operator sends; looked for in every fact.
_OPERATORS = (CommandRequest, ParameterRequest, ParameterSet)
_HEARTBEAT_INTERVAL_S = 1.0
_KEEP_INTERVAL_S = 1.0
# Position, wind and the autopilot's own following of a course are good to this.
_FENCE_MARGIN_M = 30.0
# Far from its origin the flat frame bends; closer than this its error cannot be seen.
_FRAME_REACH_M = 5_000.0


class Engine:
    """One flight. `receive` and `tick` share one clock [s], which never runs backwards."""

    def __init__(
        self,
        config: EngineConfig | None = None,
        *,
        saved: Mapping[str, float] | None = None,
        avoider: Avoider | None = None,
    ) -> None:
        """`saved` are settings that go before the configuration (see `Save`).

        `avoider` decides instead of one made from the configuration: for comparisons.
        """
        self._settings = Settings(config or EngineConfig(), saved)
        config = self._settings.config
        self._tuned, self._saved = config, self._settings.changed
        wanted = config.engine.autopilot_system_id
        self.aircraft = Aircraft(
            None if wanted == "auto" else wanted,
            NAMES.get(config.autopilot),
            adopt_after_s=config.engine.adopt_after_s,
            stick_us=config.supervisor.stick_us,
        )
        self.operator = GcsRequests(self._settings, lambda: self.sender)
        self._surroundings = TrafficPicture(config.traffic, config.known_obstacles, config.obstacles)
        self._announcer = StatusText(lambda: self.sender, lambda: self._settings.engine.text_units)
        # What is known of the aircraft by asking its autopilot; shown by `companion check --link`.
        self.queries = AutopilotQueries(
            self._announcer, config.avoidance.envelope, config.aircraft, config.fences
        )
        self._briefing = OperatorNotices(
            self.aircraft, self.queries, self.operator, self._announcer, self._settings
        )
        self.readiness = Readiness(
            self.aircraft,
            self._settings,
            self.operator,
            position_fresh_s=config.engine.position_fresh_s,
            other_avoider=self._briefing.other_avoider,
        )
        self._authority = Handover(
            self.aircraft, self._settings, self._announcer, self.operator, self.readiness
        )
        self._avoider = avoider or Avoider(config.avoidance)
        self._rates = MessageRates()
        self._frame: LocalFrame | None = None
        self._goal: Goal | None = None
        self._decision = Decision(Layer.CLEAR, because="no position")
        self._own: Ownship | None = None
        self._tracks: tuple[Track, ...] = ()
        self._heartbeat_s = -math.inf
        self._boot_time_s = -math.inf
        self._prompted = False
        self._limits: tuple[Envelope, HeightLimits, float, float | None] | None = None  # in effect
        self._local_fence: LocalFence | None = None
        self._answers: list[Message] = []
        self._left: PersistedState | None = None  # by a former run; what it borrowed is put back
        self._kept_s: float | None = None
        self.ticks = 0
        self.foreign = 0  # facts of systems that are not ours

    @property
    def sender(self) -> Sender:
        """Our address: the autopilot's system, unless configured otherwise."""
        system_id = self._settings.engine.system_id
        if system_id == "auto":
            own = self.aircraft.sender
            system_id = 1 if own is None else own.system_id
        return _address(system_id, self._settings.engine.component_id)

    @property
    def tracker(self) -> Tracker:
        """Who is out there."""
        return self._surroundings.tracker

    @property
    def supervisor(self) -> Supervisor:
        """Who may fly."""
        return self._authority.supervisor

    @property
    def avoider(self) -> Avoider:
        """What decides, with the limits and volumes in effect."""
        return self._avoider

    @property
    def frame(self) -> LocalFrame | None:
        """The local frame of the moment; it moves along with the aircraft."""
        return self._frame

    @property
    def engagements(self) -> int:
        """How often the aircraft was taken over."""
        return self._authority.engagements

    @property
    def rejections(self) -> int:
        """How many of our commands the autopilot refused or never answered."""
        return self._authority.rejections

    @property
    def rates_hz(self) -> dict[int, float]:
        """How often each measured message came lately, by its id."""
        return self._rates.measured_hz

    @property
    def decision(self) -> Decision:
        """The decision that stands."""
        return self._decision

    @property
    def finished(self) -> bool:
        """Whether the aircraft is given back after `request_stop`, and all that was borrowed of it."""
        adapter = self.aircraft.adapter
        return self.supervisor.state is State.STOPPED and not (adapter is not None and adapter.borrowed)

    def snapshot(self, now_s: float) -> Snapshot:
        """What a display shows."""
        return Snapshot(
            time_s=now_s,
            state=str(self.supervisor.state),
            mode=self.aircraft.mode,
            armed=self.aircraft.armed,
            ownship=self._own,
            tracks=self._tracks,
            decision=self._decision,
            goal=self._goal,
            last_text=self._announcer.last_text,
        )

    def receive(self, fact: Fact, now_s: float) -> bool:
        """Take a fact in; true when it should be acted upon at once, by a tick at the same time."""
        sender = fact.sender
        if sender.component_id == self._settings.engine.component_id and sender == self.sender:
            return False
        if isinstance(fact, _OPERATORS):
            self._answers += self.operator.receive(fact)
            return bool(self._answers)
        if isinstance(fact, Traffic):
            if fact.sender == self.aircraft.sender:
                self._rates.observe(fact, now_s)
            return self._hear(fact, now_s)
        mode_before = self.aircraft.custom_mode
        back = not self.aircraft.heard(now_s)
        if type(fact) in HEEDED and self.aircraft.adapter is not None:
            self.queries.observe(fact, self.aircraft.adapter, self.sender, now_s)
        if not self.aircraft.observe(fact, now_s):
            self.foreign += 1
            return self._is_of_another_system(fact) and self._hear(fact, now_s)
        self._rates.observe(fact, now_s)
        self._surroundings.observe_own(fact, now_s)
        match fact:
            case Heartbeat():
                if back:
                    self.aircraft.resume(now_s)
                    self._ask_anew()
                return self.aircraft.custom_mode != mode_before
            case OwnPosition():
                if fact.boot_time_s < self._boot_time_s - 1.0:
                    self._ask_anew()
                self._boot_time_s = fact.boot_time_s
            case CommandResult():
                return self._receive_answer(fact, now_s)
            case Parameter() | AttitudeTarget() | AutopilotVersion():
                self._tell_adapter(fact, now_s)
            case _:
                pass
        return False

    def request_stop(self, now_s: float) -> list[Effect]:
        """The service ends: give the aircraft back first. Tick on until `finished`."""
        return self._authority.request_stop(now_s)

    def recover(self, text: str, now_s: float, age_s: float) -> None:
        """What a former run kept (see `Keep`) so long ago: had it the aircraft then, that is put right."""
        held = PersistedState.from_text(text)
        if held is None:
            return
        held = replace(held, time_s=now_s - age_s)
        self._left = held
        if not held.is_fresh(now_s):
            return
        if held.role is not None:
            self.operator.role = held.role
        self.aircraft.expect(held.system_id)
        self._authority.recover(held)

    def announce(self, text: str, now_s: float) -> list[Effect]:
        """What the shell has to tell the operator: as a warning, once."""
        return self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, text, now_s)

    def emergency_release(self, now_s: float) -> list[Message]:
        """Messages that ask for the former mode, when the engine itself cannot be trusted any more.

        To be called several times a second, for two seconds.
        """
        return self._authority.emergency_release(now_s)

    def tick(self, now_s: float) -> list[Effect]:
        """Decide, supervise, command, and keep up the manners."""
        self.ticks += 1
        effects: list[Effect] = self._tune()
        effects += self._briefing.tick(now_s)
        self._decide(now_s)
        flying_before = self.supervisor.flying
        effects += self._authority.step(TrafficSituation(self._decision, self._own, self._tracks), now_s)
        flying = self.supervisor.flying
        if flying_before and not flying and not self._authority.dismisses:
            # A conflict that the operator has decided about goes on to be the same one.
            self._avoider.reset()
        self.aircraft.ours = self._authority.holds
        effects += self._command(now_s)
        effects += self._keep_up_manners(now_s)
        effects += self._keep(now_s)
        if self._own is not None:
            around = Circumstances(self.supervisor.state, flying, self.aircraft.mode, self._frame)
            effects.append(Record(now_s, self._decision, self._own, self._tracks, around))
        self._prompted = False
        return effects

    def _keep_up_manners(self, now_s: float) -> list[Effect]:
        """Repetitions, rates, COLLISION and our own heartbeat."""
        effects: list[Effect] = []
        adapter = self.aircraft.adapter
        if adapter is not None:
            if self._left is not None:
                # It may have been another aircraft's.
                if self._left.system_id == adapter.target.system_id:
                    adapter.put_back(self._left.borrowed)
                self._left = None
            if self._may_send or not self.supervisor.flying:
                effects += self._announcer.transmit(adapter.tick(now_s))
            if self.aircraft.heard(now_s):
                effects += self._announcer.transmit(self._rates.tick(adapter, now_s))
                effects += self.queries.tick(adapter, now_s)
                self.aircraft.mission = self.queries.mission
        answers, self._answers = self._answers, []
        effects += self._announcer.transmit([*answers, *self.operator.listed(now_s)])
        effects += self._announcer.collisions(self._decision, flying=self.supervisor.flying, now_s=now_s)
        if now_s - self._heartbeat_s >= _HEARTBEAT_INTERVAL_S - 1e-3 or now_s < self._heartbeat_s:
            self._heartbeat_s = now_s
            healthy = self.aircraft.heard(now_s) and not self.aircraft.blind(now_s)
            effects += self._announcer.heartbeat(self.operator.role, healthy=healthy)
        return effects

    # --- deciding

    def _tune(self) -> list[Effect]:
        """What the operator has set since counts from now on, and is saved."""
        config = self._settings.config
        if config is self._tuned:
            return []
        if config.avoidance is not self._tuned.avoidance:
            self._avoider.retune(config.avoidance)
        self._tuned = config
        before, self._saved = self._saved, self._settings.changed
        return [] if self._saved == before else [Save(self._saved)]

    def _decide(self, now_s: float) -> None:
        if self.aircraft.blind(now_s):
            self._avoider.reset()
            self._own, self._tracks = None, ()
            self._decision = Decision(Layer.CLEAR, because="no position")
            return
        if now_s - self.aircraft.position_s > self._settings.engine.position_stale_s:
            return  # for a moment, what was decided last stands
        self._frame = self._frame_here()
        if self._frame is None:
            return
        self._own = self.aircraft.ownship(self._frame)
        self._tracks = self._surroundings.tracks(now_s, self._frame, self.aircraft.home_altitude_m())
        self._goal = self._goal_now(self._frame, now_s)
        if self._own is None or self.operator.role is Role.OFF or not self._may_decide():
            self._avoider.reset()
            because = "off" if self.operator.role is Role.OFF else "not flying"
            self._decision = Decision(Layer.CLEAR, because=because)
            return
        self._limit(now_s)
        self._decision = _sound(self._avoider.decide(now_s, self._own, self._tracks, self._goal))

    def _goal_now(self, frame: LocalFrame, now_s: float) -> Goal:
        """What the mission wants; while the aircraft is ours, what it wanted then."""
        if self._goal is None or self.supervisor.state in WATCHING:
            goal = self.aircraft.goal(frame, now_s)
            if self.aircraft.mission_outdated(now_s):
                self.queries.doubt_mission(now_s)
            return goal
        if self._goal.position_m is not None:
            return self._goal
        # Taken over before the mission was read, as after a restart: straight on is not where it leads.
        place = self._authority.goes_on_to()
        if place is None:
            return self._goal
        return replace(self._goal, position_m=frame.to_ned_m(place), altitude_m=place.altitude_m)

    def _may_decide(self) -> bool:
        """Nothing is decided on the ground; while flying for us the aircraft may sink to the floor and be."""
        return self.supervisor.flying or self.aircraft.flying(self._settings.supervisor.min_height_m)

    def _frame_here(self) -> LocalFrame | None:
        """The local frame, moved along with the aircraft; the goal moves with it."""
        place = self.aircraft.place()
        frame = self._frame
        if place is None:
            return frame
        if frame is not None and math.hypot(*frame.to_ned_m(place)[:2]) <= _FRAME_REACH_M:
            return frame
        here = LocalFrame(place.lat_deg, place.lon_deg)
        if frame is not None and self._goal is not None and self._goal.position_m is not None:
            moved = here.to_ned_m(frame.to_geo(*self._goal.position_m))
            self._goal = replace(self._goal, position_m=moved)
        return here

    def _limit(self, now_s: float) -> None:
        """The aircraft's envelope, with floor and ceiling of this place."""
        adapter = self.aircraft.adapter
        self._avoider.prefers_turns = adapter is not None and adapter.loses_itself_in_climbs
        home_m = self.aircraft.home_altitude_m()
        if home_m is None:
            return
        floor_m, ceiling_m = self._settings.supervisor.min_height_m, self._settings.engine.max_height_m
        heights = self.queries.heights(floor_m, ceiling_m, now_s)
        terrain_m = self.aircraft.terrain.altitude_m(now_s)
        limits = self.queries.envelope, heights, home_m, terrain_m
        if limits != self._limits:  # at every tick, mostly the same
            self._limits, self._avoider.envelope = limits, limit_heights(*limits)
        assert self._frame is not None
        local = self.queries.local_fence(self._frame, home_m, now_s)
        if local is not self._local_fence:
            self._local_fence = local
            self._avoider.fence = _fence_of(local)

    # --- commanding

    def _command(self, now_s: float) -> list[Effect]:
        """Setpoints while flying; entering and leaving the guided mode, what the autopilot wants then."""
        adapter, aircraft, state = self.aircraft.adapter, self.aircraft, self.supervisor.state
        if adapter is None or not self._authority.holds:
            return []
        bank_rad = self._avoider.envelope.max_bank_rad
        level = aircraft.flown(aircraft.flying_now(), max_bank_rad=bank_rad)
        if level is None:
            return []
        # PX4 would enter OFFBOARD by itself with the first setpoint that comes through again, and wrongly so.
        releasing = state in (State.RELEASING, State.STOPPING)
        contact = aircraft.in_contact(now_s) or not (releasing or adapter.left_to_itself_is_safe)
        if not (contact and aircraft.heard(now_s)):
            return []
        if state is State.ENGAGING:
            return self._announcer.transmit(adapter.entering(level, now_s))
        if releasing and aircraft.guided:
            return self._announcer.transmit(adapter.leaving(level, now_s))
        guidance = self._decision.guidance or self._authority.way_back()
        if not self._may_send or guidance is None:
            return []
        messages = adapter.command(replace(level, guidance=guidance), now_s, urgent=self._prompted)
        for refused in adapter.refused_values():
            self._avoider.refuse(refused.control, refused.value, now_s)
        return self._announcer.transmit(messages)

    @property
    def _may_send(self) -> bool:
        """Flying, and nothing was heard that speaks against it."""
        return self.supervisor.flying and self.aircraft.guided

    def _keep(self, now_s: float) -> list[Effect]:
        """What the next run must know, once a second and when it changes."""
        held = self._authority.held(now_s)
        if held is None:
            changed, self._kept_s = self._kept_s is not None, None
            return [Keep(None)] if changed else []
        if self._kept_s is not None and now_s - self._kept_s < _KEEP_INTERVAL_S - 1e-3:
            return []
        self._kept_s = now_s
        return [Keep(held)]

    # --- receiving

    def _ask_anew(self) -> None:
        """The autopilot started anew, or came back: it remembers nothing, and may hold other things."""
        self._rates.restart()
        self.queries.restart()

    def _is_of_another_system(self, fact: Fact) -> bool:
        """Another one than ours; before ours is known, nobody is another."""
        own = self.aircraft.sender
        return own is not None and fact.sender.system_id not in (own.system_id, self.sender.system_id)

    def _hear(self, fact: Fact, now_s: float) -> bool:
        """News of others; true when a threat is among them."""
        track_id = self._surroundings.hear(fact, now_s)
        if track_id is None:
            return False
        self._prompted = any(threat.track_id == track_id for threat in self._decision.threats)
        return self._prompted

    def _receive_answer(self, fact: CommandResult, now_s: float) -> bool:
        if fact.target is not None and fact.target != self.sender:
            return False
        self._authority.answered(fact, now_s)
        return False

    def _tell_adapter(self, fact: Fact, now_s: float) -> None:
        if self.aircraft.adapter is not None:
            self.aircraft.adapter.observe(fact, now_s)


@cache
def _address(system_id: int, component_id: int) -> Sender:
    """Asked for with every fact."""
    return Sender(system_id, component_id)


def _sound(decision: Decision) -> Decision:
    """The same; `ValueError` when nobody could fly it: a bug, which ends the service before it is sent."""
    guidance = decision.guidance
    if guidance is not None and not all(
        map(math.isfinite, (guidance.course_rad, guidance.airspeed_mps, guidance.altitude_m))
    ):
        raise ValueError("guidance is not finite")
    return decision


def _fence_of(local: LocalFence) -> Fence | None:
    """The fence as the avoidance takes it, never closer to its edge than the aircraft can be held."""
    if not local.zones:
        return None
    zones = tuple(Zone(*zone) for zone in local.zones)
    return Fence(zones, max(local.margin_m, _FENCE_MARGIN_M), any_inclusion=local.any_inclusion)
