"""The engine: facts in, effects out, the clock is an argument.

The same object flies the aircraft, replays a log and runs in tests. It only keeps the order of a tick: who
has the aircraft, then the decision, then commands, then housekeeping.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache

from companion.airspace.obstacles import ObstacleMap
from companion.autopilots import NAMES
from companion.avoidance import Avoider
from companion.control.emergency import EmergencyRelease
from companion.control.handover import Handover, Orders
from companion.control.readiness import Readiness
from companion.control.state_machine import State, Supervisor
from companion.engine.deciding import Deciding
from companion.engine.housekeeping import Housekeeping, Rooms
from companion.engine_config import EngineConfig
from companion.gcs.forwarding import Forwarding, Received
from companion.gcs.maneuvers import ManeuverNotices
from companion.gcs.notices import OperatorNotices
from companion.gcs.phrases import TrafficSituation
from companion.gcs.requests import GcsRequests
from companion.gcs.settings import Settings
from companion.gcs.statustext import StatusText
from companion.geodesy import LocalFrame
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    RECEIVER,
    AttitudeTarget,
    AutopilotVersion,
    AvailableMode,
    CommandRequest,
    CommandResult,
    Fact,
    Heartbeat,
    NavigationTarget,
    OtherCompanion,
    OwnPosition,
    Parameter,
    ParameterRequest,
    ParameterSet,
    ReceiverOwnship,
    Sender,
    Traffic,
)
from companion.model import Decision, Role, Snapshot, TrafficSource
from companion.output.effects import Effect, Save, Say, Transmit
from companion.output.notice import AnyNotice, Condition, ConflictNotice, Notice, ResumeNotice
from companion.output.persisted_state import PersistedState
from companion.ownship.aircraft import Aircraft
from companion.ownship.autopilot_queries import RELEVANT_FACTS, AutopilotQueries
from companion.ownship.message_rates import MessageRates
from companion.traffic import Concern, Tracker, TrafficPicture, Urgency

_OPERATOR_FACTS = (CommandRequest, ParameterRequest, ParameterSet)
_ADAPTER_FACTS = (Parameter, AttitudeTarget, AutopilotVersion, AvailableMode, NavigationTarget)
_NOTICES = (Notice, ConflictNotice, ResumeNotice)
_MOST_SOURCES = 64  # senders of traffic


class Engine:
    """One flight. `receive` and `tick` share one clock [s], which never runs backwards."""

    def __init__(
        self,
        config: EngineConfig | None = None,
        *,
        saved: Mapping[str, float] | None = None,
        avoider: Avoider | None = None,
    ) -> None:
        """`saved` are settings that take precedence over the configuration (see `Save`).

        `avoider` replaces the one that is made from the configuration, for comparisons.
        """
        self._settings = Settings(config or EngineConfig(), saved)
        config = self._settings.config
        self._applied, self._saved = config, self._settings.changed
        wanted = config.engine.autopilot_system_id
        self.aircraft = Aircraft(
            None if wanted == "auto" else wanted,
            NAMES.get(config.autopilot),
            adopt_after_s=config.engine.adopt_after_s,
            stick_us=config.supervisor.stick_us,
        )
        # The autopilot's answers to our requests; `companion check --link` shows them.
        self.queries = AutopilotQueries(config.avoidance.envelope, config.aircraft, config.fences)
        self._rates = MessageRates()
        self._picture = TrafficPicture(config.traffic, config.members)
        self.tracker: Tracker = self._picture.tracker  # the traffic that is known
        self.operator = GcsRequests(
            self._settings,
            lambda: self.sender,
            may_resume=lambda: self.supervisor.holds or self._handover.suppresses,
        )
        self._notices = OperatorNotices(self.aircraft, self.queries, self.operator, self._settings)
        self._statustext = StatusText()
        self._maneuvers = ManeuverNotices()
        self.forwarding = Forwarding(config.traffic.forward)
        self._readiness = Readiness(
            self.aircraft,
            config.supervisor,
            position_fresh_s=config.engine.position_fresh_s,
            other_avoider=self._notices.other_avoider,
        )
        self._handover = Handover(self.aircraft, config.supervisor, self._readiness, config.control)
        self.supervisor: Supervisor = self._handover.supervisor  # the state machine: who has the aircraft
        self._commanding = self._handover.commanding
        self.avoider = avoider or Avoider(config.avoidance)  # with the limits and volumes in effect
        self._deciding = Deciding(
            self.aircraft,
            self.queries,
            self.tracker,
            ObstacleMap(config.known_obstacles, config.obstacles) if config.known_obstacles else None,
            config,
            self._handover,
            self._readiness,
            self.avoider,
        )
        self._end = Housekeeping(
            Rooms(
                self.aircraft,
                self.queries,
                self._rates,
                self.tracker,
                self.operator,
                self._notices,
                self._readiness,
                self._handover,
                self._deciding,
                self.forwarding,
            ),
            lambda: self.sender,
        )
        self._prompted = False  # a threat was reported since the last tick
        self._resume = False  # the operator requested to resume the mission since the last tick
        self._answers: list[Message] = []
        self.shell_conditions: tuple[Condition, ...] = ()  # of the shell around the engine, such as its files
        # The number of traffic reports by MAVLink, by kind and sender.
        self.mavlink_sources: Counter[tuple[TrafficSource, Sender]] = Counter()
        self.ticks = 0
        self.foreign = 0  # facts from other systems

    # --- what others see

    @property
    def sender(self) -> Sender:
        """Our address: the autopilot's system, unless configured otherwise."""
        system_id = self._applied.engine.system_id
        if system_id == "auto":
            own = self.aircraft.sender
            system_id = 1 if own is None else own.system_id
        return _address(system_id, self._applied.engine.component_id)

    @property
    def frame(self) -> LocalFrame | None:
        """The present local frame; it moves along with the aircraft."""
        return self._deciding.frame

    @property
    def engagements(self) -> int:
        """Number of take-overs so far."""
        return self._handover.engagements

    @property
    def rejections(self) -> int:
        """Number of our commands that the autopilot refused or never answered."""
        return self._handover.rejections

    @property
    def rates_hz(self) -> dict[int, float]:
        """The measured rate of each message, by its id."""
        return self._rates.measured_hz

    @property
    def decision(self) -> Decision:
        """The standing decision."""
        return self._deciding.decision

    @property
    def finished(self) -> bool:
        """Whether, after `request_stop`, the aircraft and everything borrowed from it are given back."""
        adapter = self.aircraft.adapter
        return self.supervisor.state is State.STOPPED and not (
            adapter is not None and adapter.changed_parameters
        )

    def hindrances(self, now_s: float, role: Role | None = None) -> list[str]:
        """The reasons why the aircraft would not be taken over now, in the present role or in `role`."""
        return self._readiness.hindrances(now_s, self.operator.role if role is None else role)

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """What keeps the aircraft from being flown, is odd, or was given up; the most severe first."""
        return self._end.conditions.holding

    @property
    def concerns(self) -> tuple[Concern, ...]:
        """Traffic that was not avoided or was odd on the last tick."""
        return self._end.concerns

    def snapshot(self, now_s: float) -> Snapshot:
        """The present state, for a display."""
        deciding = self._deciding
        return Snapshot(
            time_s=now_s,
            state=str(self.supervisor.state),
            mode=self.aircraft.mode,
            armed=self.aircraft.flight_state.armed,
            ownship=deciding.own,
            tracks=deciding.tracks,
            decision=deciding.decision,
            goal=deciding.goal,
            last_text=self._statustext.last_text,
            maneuver=self._maneuvers.words,
            maneuver_text=self._maneuvers.text,
        )

    # --- requests of the shell

    def request_stop(self, now_s: float) -> list[Effect]:
        """Give the aircraft back, as the service ends. Go on ticking until `finished`."""
        return self._emit(self._handover.request_stop(now_s), now_s)

    def recover(self, text: str, now_s: float, age_s: float) -> None:
        """Restore the state saved `age_s` ago (see `Keep`); hand the aircraft back if we were flying it."""
        left = PersistedState.from_text(text)
        if left is None:
            return
        left = replace(left, time_s=now_s - age_s)
        self._end.left = left
        if not left.is_fresh(now_s):
            return
        if left.role is not None:
            self.operator.role = left.role
        self.aircraft.identity.expect(left.system_id)
        self._handover.recover(left)

    def announce(self, text: str, now_s: float) -> list[Effect]:
        """Send the operator a warning from the shell."""
        return self._emit([Notice(mavlink.MAV_SEVERITY_WARNING, text)], now_s)

    def emergency_release(self, now_s: float) -> EmergencyRelease:
        """The object that gives the aircraft back after the engine has failed."""
        return EmergencyRelease(self.aircraft, self.supervisor, now_s)

    def note_gap(self, lasted_s: float, now_s: float) -> list[Effect]:
        """Note that we did nothing for `lasted_s` until now: nothing is performed for that time."""
        self._handover.note_gap(now_s)
        text = f"Avoidance: stalled for {lasted_s:.1f} s"
        return self._emit([Notice(mavlink.MAV_SEVERITY_WARNING, text)], now_s)

    # --- sense

    def urgency(self, fact: Fact, now_s: float) -> Urgency | None:
        """How soon a fact is to be processed, while too much arrives; `None`: at once, as it is of us."""
        if isinstance(fact, ReceiverOwnship) and self._is_of_another_vehicle(fact):
            fact = Traffic(fact.sender, fact.report)
        if isinstance(fact, Traffic) or (isinstance(fact, OwnPosition) and self._is_of_another_system(fact)):
            return self._picture.urgency(fact, now_s)
        return None

    def receive(self, fact: Fact, now_s: float, true_s: float | None = None) -> bool:
        """Take a fact in; true when it should be acted upon at once, by a tick at the same time.

        `true_s` is when it was true on our clock, as far as that is known; by default, now.
        """
        at_s = now_s if true_s is None else min(true_s, now_s)
        sender = fact.sender
        if sender.component_id == self._applied.engine.component_id and sender == self.sender:
            if isinstance(fact, OtherCompanion):
                self.aircraft.identity.observe_companion(sender.component_id, now_s)
            return False
        if isinstance(fact, _OPERATOR_FACTS):
            self._answers += self.operator.receive(fact)
            self._resume |= self.operator.take_resume()
            return bool(self._answers)
        if isinstance(fact, ReceiverOwnship) and self._is_of_another_vehicle(fact):
            fact = Traffic(sender, fact.report)
        if isinstance(fact, ReceiverOwnship):
            self._picture.observe_receiver(fact, now_s)
            return False
        if isinstance(fact, Traffic):
            if fact.sender == self.aircraft.sender:
                self._rates.traffic_s = now_s
            return self._receive_traffic(fact, now_s)
        return self._receive_telemetry(fact, now_s, at_s)

    def _receive_telemetry(self, fact: Fact, now_s: float, at_s: float) -> bool:
        """Take in what a vehicle or a component reports about itself; it was true at `at_s`."""
        mode_before = self.aircraft.flight_state.custom_mode
        back = not self.aircraft.contact.heard(at_s)
        if type(fact) in RELEVANT_FACTS and self.aircraft.adapter is not None:
            self.queries.observe(fact, self.aircraft.adapter, self.sender, now_s)
        if not self.aircraft.observe(fact, at_s):
            self.foreign += 1
            if isinstance(fact, Heartbeat):
                self.aircraft.identity.observe_component(fact, self.sender, now_s)
            return self._is_of_another_system(fact) and self._receive_traffic(fact, now_s)
        self._rates.observe(fact)
        self._picture.observe_ownship(fact, at_s)
        match fact:
            case Heartbeat():
                if back:
                    self.aircraft.navigation.refresh(now_s)
                    self._ask_again()
                if self.aircraft.adapter is not None:
                    self.aircraft.adapter.observe(fact, at_s)
                return self.aircraft.flight_state.custom_mode != mode_before
            case OwnPosition():
                if self.aircraft.contact.restarted(fact.boot_time_s):
                    self._ask_again()
                    if self.aircraft.adapter is not None:
                        self.aircraft.adapter.restarted()
            case CommandResult() if fact.target in (None, self.sender):
                self._handover.answered(fact, now_s)
            case _ if isinstance(fact, _ADAPTER_FACTS) and self.aircraft.adapter is not None:
                self.aircraft.adapter.observe(fact, now_s)
            case _:
                pass
        return False

    def _receive_traffic(self, fact: Fact, now_s: float) -> bool:
        """Take in a report about another aircraft; true when it is a threat."""
        forwarding = self.forwarding
        if (forwarding.sent or forwarding.systems_s) and forwarding.is_echo(fact, now_s):
            return False
        self._count_source(fact)
        if isinstance(fact, Traffic):
            track_id = self.tracker.receive(fact.report, now_s, fact.sender)
        else:
            track_id = self._picture.receive(fact, now_s)
        if forwarding.to is not None:
            forwarding.received.append(Received(fact, track_id, self.aircraft.sender, now_s))
        if track_id is None:
            return False
        self._end.reports[track_id] += 1
        prompted = any(threat.track_id == track_id for threat in self.decision.threats)
        self._prompted |= prompted
        return prompted

    def _count_source(self, fact: Fact) -> None:
        """Count a report by who sent it; receivers that speak no MAVLink count their own."""
        if isinstance(fact, Heartbeat) or fact.sender == RECEIVER:
            return
        source = fact.report.source if isinstance(fact, Traffic) else TrafficSource.SYSTEM
        key = source, fact.sender
        if key in self.mavlink_sources or len(self.mavlink_sources) < _MOST_SOURCES:
            self.mavlink_sources[key] += 1

    def _is_of_another_system(self, fact: Fact) -> bool:
        """Whether another system than ours sent it; false until our autopilot is known."""
        own = self.aircraft.sender
        return own is not None and fact.sender.system_id not in (own.system_id, self.sender.system_id)

    def _is_of_another_vehicle(self, fact: ReceiverOwnship) -> bool:
        """Whether another vehicle sent its own position; receivers that speak no MAVLink are on ours."""
        return fact.sender != RECEIVER and self._is_of_another_system(fact)

    def _ask_again(self) -> None:
        """Request everything again: the autopilot restarted or came back, and may have other settings."""
        self._rates.restart()
        self.queries.restart()

    # --- the tick

    def tick(self, now_s: float) -> list[Effect]:
        """Settle who has the aircraft, decide, command, and do the housekeeping."""
        self.ticks += 1
        was_flying = self.supervisor.flying
        overridden = self._handover.check_overrides(now_s)
        effects = self._emit(overridden or (), now_s)
        if self._answers:
            effects += self._apply_settings()
        orders, self._resume = Orders(self.operator.role, self._resume), False
        if overridden is None:
            self._deciding.update(orders.role, now_s)
            outgoing = self._handover.step(self.decision, orders, now_s, self._deciding.unheard)
            effects += self._emit(outgoing, now_s)
        if was_flying and not self.supervisor.flying and not self._handover.suppresses:
            # A suppressed conflict goes on as the same one.
            self._deciding.forget_conflict()
        self.aircraft.ours = self.supervisor.holds
        effects += self._command(now_s)
        answers, self._answers = self._answers, []
        effects += self._emit(self._end.outgoing(answers, self.shell_conditions, now_s), now_s)
        effects += self._end.effects(now_s)
        if overridden is None:
            effects += self._end.record(now_s)
        self._prompted = False
        return effects

    def _apply_settings(self) -> list[Effect]:
        """Use the settings that the operator changed, and save them."""
        config = self._settings.config
        if config is self._applied:
            return []
        if config.avoidance is not self._applied.avoidance:
            self.avoider.retune(config.avoidance)
        self._handover.retune(config.supervisor)
        self._deciding.config = config
        self._applied = config
        before, self._saved = self._saved, self._settings.changed
        return [] if self._saved == before else [Save(self._saved)]

    def _command(self, now_s: float) -> list[Effect]:
        """Setpoints while we fly, and while the guided mode is entered or left."""
        messages = self._commanding.messages(
            self.decision.guidance,
            now_s,
            max_bank_rad=self.avoider.envelope.max_bank_rad,
            urgent=self._prompted,
        )
        for refused in self._commanding.take_refused():
            self.avoider.refuse(refused.control, refused.value, now_s)
        changes = self._maneuvers.changes(
            self._commanding.commanded,
            self._situation,
            self._applied.engine.text_units,
            now_s,
            returning=self.supervisor.state is State.RETURNING,
        )
        return self._emit([*messages, *changes], now_s)

    def _emit(self, outgoing: Iterable[Message | AnyNotice], now_s: float) -> list[Effect]:
        """Messages and notices as effects, in their order."""
        effects: list[Effect] = []
        for item in outgoing:
            said = self._say(item, now_s) if isinstance(item, _NOTICES) else [item]
            effects += [one if isinstance(one, Say) else Transmit(self.sender, one) for one in said]
        return effects

    def _say(self, notice: AnyNotice, now_s: float) -> list[Say | Message]:
        units = self._applied.engine.text_units
        text = self._maneuvers.worded(notice, self._situation, units, now_s)
        return [] if text is None else self._statustext.say(text, now_s)

    @property
    def _situation(self) -> TrafficSituation:
        deciding = self._deciding
        return TrafficSituation(deciding.decision, deciding.own, self.aircraft.kinematics.home_altitude_m())


@cache
def _address(system_id: int, component_id: int) -> Sender:
    """An address; cached, because every fact is compared with it."""
    return Sender(system_id, component_id)
