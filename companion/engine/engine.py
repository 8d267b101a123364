"""The engine: facts in, effects out, the clock is an argument.

The same object flies the aircraft, replays a log and sits in a test. It holds the aircraft, the traffic, the
avoider and the supervisor together, and decides nothing that one of them could.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from companion.autopilots import NAMES
from companion.autopilots.adapter import Adapter, Flown
from companion.avoidance import AvoidanceParams, Avoider
from companion.engine.aircraft import Aircraft
from companion.engine.announcer import Announcer, describe_guidance, describe_threat
from companion.engine.effects import Effect, Record, Say, Transmit
from companion.engine.mode_request import ModeRequest, Progress
from companion.engine.rates import RateKeeper
from companion.engine.record import decision_line
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    CommandResult,
    Fact,
    Heartbeat,
    OwnPosition,
    OwnTransponder,
    Parameter,
    Sender,
    Traffic,
)
from companion.model import (
    AltitudeReference,
    Decision,
    Goal,
    Guidance,
    Layer,
    Ownship,
    Snapshot,
    Track,
    TrafficReport,
)
from companion.supervisor import WATCHING, Event, State, Supervisor, SupervisorParams
from companion.traffic import Tracker, TrafficParams

_HEARTBEAT_INTERVAL_S = 1.0
# Far from its origin the flat frame bends; closer than this its error cannot be seen.
_FRAME_REACH_M = 5_000.0
# The mode is taken over only from one that was heard just now.
_FRESH_HEARTBEAT_S = 1.5
_LONGEST_ENGAGING_S = 3.0
# A request that was given up may still arrive, on a slow link.
_LATE_S = 10.0
_SETTLE_S = 1.0
_REFUSALS_BEFORE_FALLBACK = 3
# Own position so old is no ground for a decision; after the longer time the aircraft is given back.
_BLIND_S = 5.0


_NOT_REFUSED = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
_ASKING = frozenset({State.ENGAGING, State.RELEASING, State.STOPPING})


@dataclass(frozen=True)
class EngineParams:
    """Identity on the wire, and when own position is too old to act on."""

    system_id: Literal["auto"] | Annotated[int, Ge(1), Le(254)] = "auto"
    # 1 is the autopilot itself.
    component_id: Annotated[int, Ge(2), Le(255)] = 196
    autopilot_system_id: Literal["auto"] | Annotated[int, Ge(1), Le(255)] = "auto"
    # With no autopilot configured, others are waited for so long; of several none is chosen.
    adopt_after_s: Annotated[float, Ge(0), Le(60)] = 1.5
    position_stale_s: Annotated[float, Gt(0), Le(5)] = 2.0
    # Highest height above home that an avoidance may climb to; `None`: no ceiling.
    max_height_m: Annotated[float, Gt(0)] | None = None


@dataclass(frozen=True)
class EngineConfig:
    """All that the engine is built from."""

    autopilot: Literal["auto", "ardupilot", "px4"] = "auto"
    engine: EngineParams = field(default_factory=EngineParams)
    supervisor: SupervisorParams = field(default_factory=SupervisorParams)
    traffic: TrafficParams = field(default_factory=TrafficParams)
    avoidance: AvoidanceParams = field(default_factory=AvoidanceParams)


class Engine:
    """One flight. `receive` and `tick` share one clock [s], which never runs backwards."""

    def __init__(self, config: EngineConfig | None = None) -> None:
        config = config or EngineConfig()
        self._params = config.engine
        self._rules = config.supervisor
        wanted = config.engine.autopilot_system_id
        self.aircraft = Aircraft(
            None if wanted == "auto" else wanted,
            NAMES.get(config.autopilot),
            adopt_after_s=config.engine.adopt_after_s,
        )
        self.tracker = Tracker(config.traffic)
        self.supervisor = Supervisor()
        self._avoider = Avoider(config.avoidance)
        self._envelope = config.avoidance.envelope
        self._announcer = Announcer()
        self._rates = RateKeeper()
        self._frame: LocalFrame | None = None
        self._goal: Goal | None = None
        self._decision = Decision(Layer.CLEAR, because="no position")
        self._own: Ownship | None = None
        self._tracks: tuple[Track, ...] = ()
        self._mode_before = 0
        self._request: ModeRequest | None = None
        self._was_guided = False
        self._against_us = False
        self._abandoned = 0
        self._abandoned_s = -math.inf
        self._ready_since_s: float | None = None
        self._not_before_s = -math.inf
        self._heartbeat_s = -math.inf
        self._boot_time_s = -math.inf
        self._prompted = False
        self.ticks = 0

    @property
    def sender(self) -> Sender:
        """Our address: the autopilot's system, unless configured otherwise."""
        system_id = self._params.system_id
        if system_id == "auto":
            own = self.aircraft.sender
            system_id = 1 if own is None else own.system_id
        return Sender(system_id, self._params.component_id)

    @property
    def decision(self) -> Decision:
        """The decision that stands."""
        return self._decision

    @property
    def finished(self) -> bool:
        """Whether the aircraft is given back after `request_stop`."""
        return self.supervisor.state is State.STOPPED

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
        if fact.sender == self.sender:
            return False
        if isinstance(fact, Traffic):
            return self._receive_traffic(fact, now_s)
        mode_before = self.aircraft.custom_mode
        back = not self.aircraft.heard(now_s)
        if not self.aircraft.observe(fact, now_s):
            return False
        self._rates.observe(fact, now_s)
        match fact:
            case Heartbeat():
                if back:
                    self._rates.restart()
                return self.aircraft.custom_mode != mode_before
            case OwnPosition():
                if fact.boot_time_s < self._boot_time_s - 1.0:
                    self._rates.restart()
                self._boot_time_s = fact.boot_time_s
            case CommandResult():
                return self._receive_answer(fact, now_s)
            case Parameter() if fact.name == self._adapter().own_icao_parameter and fact.value >= 1.0:
                self.tracker.learn_own(int(fact.value))
            case OwnTransponder():
                self.tracker.learn_own(fact.icao)
            case _:
                pass
        return False

    def request_stop(self, now_s: float) -> list[Effect]:
        """The service ends: give the aircraft back first. Tick on until `finished`."""
        held = self.supervisor.flying or self.supervisor.state is State.ENGAGING
        if not self.supervisor.handle(Event.STOP) or not held:
            return []
        ending = f"Avoidance ends, back to {self._before()}"
        return [*self._release(now_s), *self._tell(mavlink.MAV_SEVERITY_WARNING, ending, now_s)]

    def emergency_release(self) -> list[Message]:
        """Messages that ask for the former mode, when the engine itself cannot be trusted any more."""
        adapter = self.aircraft.adapter
        held = self.supervisor.flying or self.supervisor.state in _ASKING
        return [adapter.set_mode(self._mode_before)] if adapter is not None and held else []

    def tick(self, now_s: float) -> list[Effect]:
        """Decide, supervise, command, and keep up the manners."""
        self.ticks += 1
        effects: list[Effect] = []
        effects += self._tell_who_is_there(now_s)
        self._decide(now_s)
        effects += self._supervise(now_s)
        if self.supervisor.flying:
            effects += self._command(now_s)
        adapter = self.aircraft.adapter
        if adapter is not None:
            effects += self._transmit(adapter.tick(now_s))
            if self.aircraft.heard(now_s):
                effects += self._transmit(self._rates.tick(adapter, now_s))
        effects += self._transmit(
            self._announcer.collisions(self._decision, flying=self.supervisor.flying, now_s=now_s)
        )
        if now_s - self._heartbeat_s >= _HEARTBEAT_INTERVAL_S - 1e-3 or now_s < self._heartbeat_s:
            self._heartbeat_s = now_s
            effects += self._transmit([self._heartbeat(now_s)])
        if self._own is not None:
            effects.append(Record(decision_line(now_s, self._decision, self._own, len(self._tracks))))
        self._prompted = False
        return effects

    # --- deciding

    def _decide(self, now_s: float) -> None:
        if self._blind(now_s):
            self._avoider.reset()
            self._own, self._tracks = None, ()
            self._decision = Decision(Layer.CLEAR, because="no position")
            return
        if now_s - self.aircraft.position_s > self._params.position_stale_s:
            return  # for a moment, what was decided last stands
        self._frame = self._frame_here()
        if self._frame is None:
            return
        self._own = self.aircraft.ownship(self._frame)
        self._tracks = self.tracker.tracks(now_s, self._frame)
        if self._goal is None or self.supervisor.state in WATCHING:
            self._goal = self.aircraft.goal(self._frame, now_s)
        if self._own is None or not self._may_decide():
            self._avoider.reset()
            self._decision = Decision(Layer.CLEAR, because="not flying")
            return
        self._limit_heights()
        self._decision = self._avoider.decide(now_s, self._own, self._tracks, self._goal)

    def _may_decide(self) -> bool:
        """Nothing is decided on the ground; while flying for us the aircraft may sink to the floor and be."""
        return self.supervisor.flying or self.aircraft.flying(self._rules.min_height_m)

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

    def _limit_heights(self) -> None:
        """Floor and ceiling are above home, the frame's zero is the sea."""
        home_m = self.aircraft.home_altitude_m()
        if home_m is None:
            return
        # Barometer and home move by centimetres all the time; whole metres keep decisions from following.
        home_m = float(round(home_m))
        ceiling_m = self._params.max_height_m
        self._avoider.envelope = replace(
            self._envelope,
            min_altitude_m=home_m + self._rules.min_height_m,
            max_altitude_m=None if ceiling_m is None else home_m + ceiling_m,
        )

    # --- supervising

    def _supervise(self, now_s: float) -> list[Effect]:
        state = self.supervisor.state
        if state in WATCHING:
            return self._while_watching(now_s)
        if state is State.STOPPED:
            return []
        if self._overruled():
            return self._hands_off(now_s)
        if state is State.ENGAGING:
            return self._while_engaging(now_s)
        if self.supervisor.flying:
            return self._while_flying(now_s)
        return self._while_releasing(now_s)

    def _overruled(self) -> bool:
        """Whether somebody else decided about the aircraft while we had it, or asked for it."""
        aircraft, request = self.aircraft, self._request
        if aircraft.landed():
            return True
        if request is None:
            return not aircraft.guided
        return request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is Progress.OVERRULED

    def _while_watching(self, now_s: float) -> list[Effect]:
        if self._came_late(now_s):
            self.supervisor.handle(Event.LATE)
            return self._release(now_s)
        clear = self._decision.layer is Layer.CLEAR
        # Whoever sent the aircraft back on its mission against us has decided about this conflict.
        if not self._ready(now_s) or (self._against_us and not clear):
            self._ready_since_s = None
            if not self._ready(now_s):
                self.supervisor.handle(Event.NOT_READY)
            return []
        if self._ready_since_s is None:
            self._ready_since_s = now_s
        hands_off = self.supervisor.state is State.HANDS_OFF
        if hands_off and now_s - self._ready_since_s < self._rules.settle_s:
            return []
        self._against_us = False
        self.supervisor.handle(Event.READY)
        fresh = now_s - self.aircraft.heartbeat_s <= _FRESH_HEARTBEAT_S
        if clear or not fresh:
            return []
        self.supervisor.handle(self._conflict())
        self._mode_before = self.aircraft.custom_mode
        self._was_guided = False
        self._request = ModeRequest(self._mode_before, self._adapter().guided_mode, now_s)
        self._adapter().stand_back()
        return [*self._ask(now_s), *self._tell_conflict(now_s)]

    def _while_engaging(self, now_s: float) -> list[Effect]:
        aircraft, request = self.aircraft, self._asked()
        if aircraft.guided:
            self._request, self._was_guided = None, True
            self.supervisor.handle(Event.TAKEN)
            self.supervisor.handle(self._conflict())
            return []
        if self._decision.layer is Layer.CLEAR:
            self.supervisor.handle(Event.CLEAR)
            return self._release(now_s)
        if request.refusals or now_s - request.made_s >= _LONGEST_ENGAGING_S:
            return self._give_up_engaging(now_s)
        return self._ask(now_s)

    def _give_up_engaging(self, now_s: float) -> list[Effect]:
        request = self._asked()
        if not request.refusals and self.aircraft.heartbeat_s <= request.made_s:
            # Not a word since: the aircraft may be in the guided mode by now, with nobody flying it.
            self.supervisor.handle(Event.UNKNOWN)
            return self._release(now_s)
        self.supervisor.handle(Event.REFUSED)
        self._request, self._ready_since_s = None, None
        self._abandoned_s, self._abandoned = now_s, self._abandoned + 1
        self._not_before_s = now_s + self._rules.retry_s * min(self._abandoned, 5)
        words = "refused" if request.refusals else "did not answer"
        return self._tell(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: autopilot {words}", now_s)

    def _came_late(self, now_s: float) -> bool:
        """The guided mode, entered on a request that we had given up: nobody else flies it."""
        late = self.aircraft.guided and now_s - self._abandoned_s < _LATE_S
        return late and self.supervisor.state is State.STANDBY

    def _while_flying(self, now_s: float) -> list[Effect]:
        self._abandoned = 0
        if self._blind(now_s):
            self.supervisor.handle(Event.CLEAR)
            lost = self._tell(mavlink.MAV_SEVERITY_CRITICAL, "Avoidance: own position lost", now_s)
            return [*self._release(now_s), *lost]
        refused = [
            effect
            for words in self._adapter().refusals()
            for effect in self._tell(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {words}", now_s)
        ]
        if self._decision.layer is Layer.CLEAR:
            self.supervisor.handle(Event.CLEAR)
            told = self._tell(mavlink.MAV_SEVERITY_NOTICE, self._returned(), now_s)
            return [*refused, *self._release(now_s), *told]
        if self.supervisor.handle(self._conflict()):
            return [*refused, *self._tell_conflict(now_s)]
        return refused

    def _while_releasing(self, now_s: float) -> list[Effect]:
        aircraft, request = self.aircraft, self._asked()
        if request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is Progress.CONFIRMED:
            self._request = None
            self.supervisor.handle(Event.GIVEN_BACK)
            return []
        stuck = request.refusals and aircraft.guided and self.supervisor.state is State.RELEASING
        if stuck and self._decision.layer is not Layer.CLEAR:
            # It cannot leave, and there is traffic: better flown by us than by nobody.
            self.supervisor.handle(self._conflict())
            return self._while_engaging(now_s)
        if request.refusals >= _REFUSALS_BEFORE_FALLBACK and request.wanted == self._mode_before:
            fallback = self._adapter().fallback_mode
            self._request = ModeRequest(request.start, fallback, now_s)
            name = self._adapter().mode_name(fallback)
            told = self._tell(
                mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {self._before()} refused, {name} instead", now_s
            )
            return [*self._ask(now_s), *told]
        return self._ask(now_s)

    def _ready(self, now_s: float) -> bool:
        aircraft = self.aircraft
        return (
            aircraft.adapter is not None
            and aircraft.adapter.can_fly
            and aircraft.fixed_wing
            and aircraft.heard(now_s)
            and now_s - aircraft.position_s <= self._params.position_stale_s
            and aircraft.mode in self._rules.take_over_from
            and aircraft.flying(self._rules.min_height_m)
            and now_s >= self._not_before_s
        )

    def _hands_off(self, now_s: float) -> list[Effect]:
        self._adapter().stand_back()
        self.supervisor.handle(Event.LOST)
        self._request, self._ready_since_s = None, None
        self._against_us = self.aircraft.mode in self._rules.take_over_from
        self._avoider.reset()
        mode = self.aircraft.mode if self.aircraft.armed else "disarmed"
        return self._tell(mavlink.MAV_SEVERITY_WARNING, f"Avoidance: hands off, {mode}", now_s)

    def _release(self, now_s: float) -> list[Effect]:
        adapter = self._adapter()
        adapter.stand_back()
        # Our own request for the guided mode may still be under way: then the former mode, seen too soon, is
        # what it was before that arrived.
        settle_s = 0.0 if self._was_guided else _SETTLE_S
        self._request = ModeRequest(adapter.guided_mode, self._mode_before, now_s, settle_s=settle_s)
        return self._ask(now_s)

    def _ask(self, now_s: float) -> list[Effect]:
        """Send the request for a mode, if the heartbeats allow it."""
        aircraft, request = self.aircraft, self._asked()
        if not request.due(aircraft.custom_mode, aircraft.heartbeat_s, now_s):
            return []
        return self._transmit([self._adapter().set_mode(request.wanted)])

    def _asked(self) -> ModeRequest:
        if self._request is None:
            raise RuntimeError("no request under way: the supervisor must not get here")
        return self._request

    def _blind(self, now_s: float) -> bool:
        return now_s - self.aircraft.position_s > _BLIND_S

    def _conflict(self) -> Event:
        return Event.INNER_CONFLICT if self._decision.layer is Layer.INNER else Event.OUTER_CONFLICT

    # --- commanding

    def _command(self, now_s: float) -> list[Effect]:
        place, guidance = self.aircraft.place(), self._decision.guidance
        if place is None or guidance is None:
            return []
        flown = Flown(_in_reach(guidance), place, self.aircraft.velocity_mps())
        return self._transmit(self._adapter().command(flown, now_s, urgent=self._prompted))

    # --- receiving

    def _receive_traffic(self, fact: Traffic, now_s: float) -> bool:
        if fact.sender == self.aircraft.sender:
            self._rates.observe(fact, now_s)
        if not self.tracker.receive(self._above_sea_level(fact.report), now_s):
            return False
        track_id = f"{fact.report.icao:06X}"
        self._prompted = any(threat.track_id == track_id for threat in self._decision.threats)
        return self._prompted

    def _above_sea_level(self, report: TrafficReport) -> TrafficReport:
        """A transponder's height compared by pressure, barometer against barometer."""
        offset_m = self.aircraft.pressure_offset_m
        barometric = report.altitude_reference is AltitudeReference.BAROMETRIC
        if not barometric or offset_m is None or report.altitude_m is None:
            return report
        return replace(report, altitude_m=report.altitude_m + offset_m)

    def _receive_answer(self, fact: CommandResult, now_s: float) -> bool:
        if fact.target is not None and fact.target != self.sender:
            return False
        adapter = self._adapter()
        if fact.command != adapter.mode_command:
            adapter.observe(fact, now_s)
        elif self._request is not None and fact.result not in _NOT_REFUSED:
            self._request.refused(now_s)
        return False

    # --- telling

    def _adapter(self) -> Adapter:
        adapter = self.aircraft.adapter
        if adapter is None:
            raise RuntimeError("no autopilot: the supervisor must not get here")
        return adapter

    def _before(self) -> str:
        return self._adapter().mode_name(self._mode_before)

    def _returned(self) -> str:
        return f"Clear of traffic, back to {self._before()}"

    def _tell_who_is_there(self, now_s: float) -> list[Effect]:
        """Whatever keeps us from flying the autopilot that is heard."""
        aircraft = self.aircraft
        problem = None
        if aircraft.adapter is None and len(aircraft.others) > 1:
            problem = "Avoidance: several autopilots, set autopilot_system_id"
        elif aircraft.adapter is not None and aircraft.others:
            problem = f"Avoidance: another autopilot, system {min(aircraft.others)}"
        elif aircraft.adapter is not None and not aircraft.fixed_wing:
            problem = "Avoidance: not a fixed wing, advising only"
        return [] if problem is None else self._tell(mavlink.MAV_SEVERITY_WARNING, problem, now_s, once=True)

    def _tell_conflict(self, now_s: float) -> list[Effect]:
        """Once for each traffic and layer: where it is, and what we do."""
        own, decision = self._own, self._decision
        if own is None or not decision.threats:
            return []
        threat = decision.threats[0]
        names = [(track.track_id, track.callsign) for track in self._tracks]
        inner = decision.layer is Layer.INNER
        text = f"{describe_threat(threat, own, names)}: {describe_guidance(decision, own)}"
        return self._tell(
            mavlink.MAV_SEVERITY_CRITICAL if inner else mavlink.MAV_SEVERITY_WARNING,
            f"{'Traffic!' if inner else 'Traffic'} {text}",
            now_s,
            topic=f"{decision.layer} {threat.track_id}",
        )

    def _heartbeat(self, now_s: float) -> Message:
        healthy = self.aircraft.heard(now_s) and now_s - self.aircraft.position_s < _BLIND_S
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
            mavlink.MAV_AUTOPILOT_INVALID,
            0,
            0,
            mavlink.MAV_STATE_ACTIVE if healthy else mavlink.MAV_STATE_CRITICAL,
            3,
        )

    def _tell(
        self, severity: int, text: str, now_s: float, topic: str | None = None, *, once: bool = False
    ) -> list[Effect]:
        messages = self._announcer.text(severity, text, now_s, topic, once=once)
        return [Say(severity, text), *self._transmit(messages)] if messages else []

    def _transmit(self, messages: list[Message]) -> list[Effect]:
        sender = self.sender
        return [Transmit(sender, message) for message in messages]


def _in_reach(guidance: Guidance) -> Guidance:
    """A course in [0, 2 pi), whatever came of rounding."""
    return replace(guidance, course_rad=guidance.course_rad % (2.0 * math.pi))
