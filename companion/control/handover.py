"""Taking the aircraft over and giving it back: the supervisor's table, driven by what is heard and decided.

The heartbeat says who has the aircraft (see `ModeRequest`); a mode that we did not ask for, the pilot's
sticks, a failsafe, a landing end ours at once, and nothing more is sent.
"""

import math

from companion.autopilots.adapter import Adapter
from companion.control.mode_request import ModeRequest, Progress
from companion.control.pilot_overrides import PilotOverrides
from companion.control.readiness import Readiness
from companion.control.rejoin import Rejoin
from companion.control.state_machine import (
    TAKEN_AWAY,
    TRANSITIONS,
    WATCHING,
    Event,
    State,
    Supervisor,
    SupervisorParams,
)
from companion.control.suppressed_threats import SuppressedThreats
from companion.control.unattended_guided import UnattendedGuided
from companion.gcs.requests import GcsRequests
from companion.gcs.settings import Settings
from companion.gcs.statustext import StatusText, TrafficSituation
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult
from companion.model import Decision, Guidance, Layer, PriorFlightState, Role
from companion.output.effects import Effect
from companion.output.persisted_state import PersistedState
from companion.ownship.aircraft import Aircraft

# The mode is taken over only from one that was heard just now.
_FRESH_HEARTBEAT_S = 1.5
_LONGEST_ENGAGING_S = 3.0
# Without heartbeats nobody knows whose the aircraft is: one try to give it back, more when we are going.
_BLIND_RELEASES, _BLIND_RELEASES_AT_END = 1, 3
_SETTLE_S = 1.0
# Given back to the guided mode the heartbeat tells nothing: time for the former target to be sent again.
_RETARGET_S = 2.5
# Datagrams overtake each other: a heartbeat from before the take-over may come after it.
_OVERTAKEN_S = 1.5
_REFUSALS_BEFORE_FALLBACK = 3
# The mission goes on where it was; an autopilot that starts it anew is told so within this time.
_ITEM_CHECKED_S = 8.0
# So long after it was taken over a recovered controller has flown setpoints again.
_RESCUED_AFTER_S = 3.0
_ASKING = frozenset({State.ENGAGING, State.RELEASING, State.STOPPING})


class Handover:
    """Holds the supervisor, and the request for a mode that is under way."""

    def __init__(
        self,
        aircraft: Aircraft,
        settings: Settings,
        announcer: StatusText,
        operator: GcsRequests,
        readiness: Readiness,
    ) -> None:
        self.supervisor = Supervisor()
        self._aircraft = aircraft
        self._settings = settings
        self._announcer = announcer
        self._operator = operator
        self._readiness = readiness
        self._claims = PilotOverrides(aircraft)
        self._strays = UnattendedGuided(aircraft, settings)
        self._dismissed = SuppressedThreats(settings)
        operator.may_resume = lambda: self.holds or self.dismisses
        self._outlook = TrafficSituation(Decision(Layer.CLEAR), None, ())
        self._before = PriorFlightState(0)
        self._request: ModeRequest | None = None
        self._way_back: Rejoin | None = None
        self._taken_s = -math.inf
        self._flew_last = False  # nobody chose another mode than the former one since
        self._was_guided = False  # since the last take-over was begun
        self._against_us = False  # somebody sent the aircraft on its mission while we flew it
        self._abandoned = 0
        self.engagements = 0  # how often it was taken over
        self.rejections = 0  # commands that were refused, or never answered
        self._ready_since_s: float | None = None
        self._not_before_s = -math.inf
        self._given_back_s = -math.inf
        self._settles = False  # given back after somebody else had it: not taken over at once
        self._rescuing = False  # flown until the controller has recovered, conflict or not
        self._emergency_s: float | None = None

    # --- for others

    @property
    def holds(self) -> bool:
        """Whether the aircraft is ours, or on its way from or to us."""
        return self.supervisor.flying or self.supervisor.state in _ASKING

    @property
    def dismisses(self) -> bool:
        """Whether there is a conflict that the operator has decided about."""
        return bool(self._dismissed)

    def recover(self, held: PersistedState) -> None:
        """A former run was killed while it had the aircraft, which is given back as soon as it is seen."""
        self._strays.expect(held)

    def held(self, now_s: float) -> PersistedState | None:
        """What the next run must know if this one is killed now."""
        adapter = self._aircraft.adapter
        role = self._operator.changed_to
        if adapter is None or not (self.holds or adapter.borrowed or role is not None):
            return None
        before = self._before if self.holds else None
        left_behind = adapter.left_behind_mode()
        return PersistedState(now_s, adapter.target.system_id, before, role, left_behind, adapter.borrowed)

    def goes_on_to(self) -> GeoPoint | None:
        """Where the aircraft will fly to when it is given back, as far as its mission says."""
        return self._aircraft.mission_place(self._before) if self.holds else None

    def way_back(self) -> Guidance | None:
        """What to fly without a conflict: to where the former mode belongs, or straight on to recover."""
        if self._rescuing:
            return self._aircraft.flying_now()
        if self.supervisor.state is not State.RETURNING or self._way_back is None:
            return None
        return self._way_back.guidance(self._aircraft)

    def request_stop(self, now_s: float) -> list[Effect]:
        """The service ends: give the aircraft back first. Tick on until `finished`."""
        held = self.supervisor.flying or self.supervisor.state is State.ENGAGING
        if not self.supervisor.handle(Event.STOP) or not held:
            return []
        ending = f"Avoidance ends, back to {self._mode_before()}"
        return [*self._release(now_s), *self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, ending, now_s)]

    def emergency_release(self, now_s: float) -> list[Message]:
        """Messages that ask for the former mode, when the engine itself cannot be trusted any more."""
        adapter = self._aircraft.adapter
        if adapter is None or not self.holds:
            return []
        if self._emergency_s is None:
            self._emergency_s = now_s
            adapter.stand_back()
        flown = self._aircraft.flown(self._aircraft.flying_now(), max_bank_rad=0.0)
        messages = [] if flown is None else adapter.leaving(flown, now_s)
        if now_s - self._emergency_s >= adapter.exit_s:
            messages += adapter.give_back(self._before)
        return [*messages, *adapter.tick(now_s)]

    @property
    def _rules(self) -> SupervisorParams:
        """As they are now: some of them can be tuned in flight."""
        return self._settings.supervisor

    # --- each tick

    def step(self, outlook: TrafficSituation, now_s: float) -> list[Effect]:
        """Act on what is heard and decided, by the supervisor's table."""
        self._outlook = outlook
        self._strays.observe()
        self._dismissed.observe(outlook.decision, now_s)
        if self._operator.role is not Role.FLY:
            self._dismissed.forget()  # told to fly again, that is against everybody
        resumes = self._operator.take_resume()
        state = self.supervisor.state
        if state in WATCHING:
            return self._while_watching(now_s)
        if state is State.STOPPED:
            return []
        claims = self._claims.made(self._request, self._before)
        taken = next((event for event in claims if (state, event) in TRANSITIONS), None)
        by_itself = taken is Event.MODE_CHANGED and self._aircraft.left_by_itself(now_s)
        if by_itself and (state, Event.FOUND) in TRANSITIONS:
            return self._fell_out(now_s)
        if taken is not None:
            return self._hands_off(taken, now_s)
        if self._operator.role is not Role.FLY and self.supervisor.handle(Event.ADVISE):
            told = self._announcer.tell(
                mavlink.MAV_SEVERITY_NOTICE, f"Avoidance told to stop, back to {self._mode_before()}", now_s
            )
            return [*self._release(now_s), *told]
        if resumes:
            return self._resume(now_s)
        if state is State.ENGAGING:
            return self._while_engaging(now_s)
        if self.supervisor.flying:
            return self._while_flying(now_s)
        return self._while_releasing(now_s)

    @property
    def _clear(self) -> bool:
        """Whether there is nobody to fly around: no conflict, or one that the operator has decided about."""
        decision = self._outlook.decision
        return decision.layer is Layer.CLEAR or self._dismissed.cover(decision)

    def _resume(self, now_s: float) -> list[Effect]:
        """Give back now, whoever is in the way: the operator says so, and is told what that means."""
        self._dismissed.add(self._outlook.decision, now_s)
        # What lost itself nobody could fly: then as soon as it has recovered, as in any other case.
        if self._rescuing or not self.supervisor.handle(Event.RESUME):
            return []
        told = self._announcer.resuming(self._outlook, self._mode_before(), now_s)
        return [*self._release(now_s), *told]

    def _while_watching(self, now_s: float) -> list[Effect]:
        self._respect_choices()
        if self._is_lost(now_s) and self.supervisor.handle(Event.POISONED):
            return self._rescue(now_s)
        stray = self._strays.seen(self.supervisor.state, now_s, was_guided=self._was_guided)
        if stray is not None and self.supervisor.handle(stray):
            return self._take_back(stray, now_s)
        advice = self._tell_lost(now_s)
        clear = self._clear
        ready = not self._readiness.hindrances(now_s) and now_s >= self._not_before_s
        if not ready and not clear:
            advice += self._announcer.conflict(self._outlook, now_s, flying=False)
        # Whoever sent the aircraft back on its mission against us has decided about this conflict.
        if not ready or (self._against_us and not clear):
            self._ready_since_s = None
            if not ready:
                self.supervisor.handle(Event.NOT_READY)
            return advice
        if self._ready_since_s is None:
            self._ready_since_s = now_s
        hands_off = self.supervisor.state is State.HANDS_OFF
        if hands_off and now_s - self._ready_since_s < self._rules.settle_s:
            return []
        self._against_us = False
        self.supervisor.handle(Event.READY)
        restored = self._check_item(now_s)
        fresh = now_s - self._aircraft.heartbeat_s <= _FRESH_HEARTBEAT_S
        return restored if clear or not fresh else [*restored, *self._take_over(now_s)]

    def _respect_choices(self) -> None:
        """Who chose another mode since decides what is flown next, and the guided mode may be his too."""
        aircraft = self._aircraft
        if not aircraft.guided:
            self._was_guided = False
            self._flew_last &= aircraft.custom_mode == self._before.mode
        if aircraft.adapter is not None and aircraft.custom_mode != self._before.mode:
            aircraft.adapter.desk.forget()
            self._given_back_s = -math.inf

    def _fell_out(self, now_s: float) -> list[Effect]:
        """It left the guided mode by itself while the link was gone, and perhaps lost itself by that."""
        if self._aircraft.just_back(now_s):
            return []
        event = Event.POISONED if self._adapter().setpoint_invalid(now_s) else Event.FOUND
        self.supervisor.handle(event)
        return self._rescue(now_s) if event is Event.POISONED else self._give_back_found(event, now_s)

    def _take_back(self, event: Event, now_s: float) -> list[Effect]:
        """Give back what is in the guided mode with nobody flying it."""
        self._settles = event is Event.ABANDONED
        if not self._settles:
            self._before = self._strays.before
        self._against_us &= event is not Event.LATE  # it was old news then, and nobody's choice
        if event is Event.POISONED:
            return self._rescue(now_s)
        return self._give_back_found(event, now_s)

    def _give_back_found(self, event: Event, now_s: float) -> list[Effect]:
        self._claims.begin(TAKEN_AWAY - {Event.MODE_CHANGED, Event.STICKS, Event.DISARMED})
        words = f"Avoidance: {event}, giving back to {self._mode_before()}"
        return [*self._release(now_s), *self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, words, now_s)]

    def _may_be_old_news(self, now_s: float) -> bool:
        """Whether it may be a heartbeat from before the take-over, overtaken on its way by a newer one."""
        aircraft = self._aircraft
        former = aircraft.custom_mode == self._before.mode and not aircraft.guided
        return former and now_s - self._taken_s < _OVERTAKEN_S

    def _is_lost(self, now_s: float) -> bool:
        """Whether the controller lost itself while we had the aircraft, and that came out only now."""
        adapter = self._aircraft.adapter
        if adapter is None or not self._flew_last or self._operator.role is not Role.FLY:
            return False
        return self._aircraft.custom_mode == self._before.mode and adapter.setpoint_invalid(now_s)

    def _tell_lost(self, now_s: float) -> list[Effect]:
        """The controller lost itself when somebody took the aircraft: it is his, but he must know."""
        adapter = self._aircraft.adapter
        if adapter is None or not adapter.setpoint_invalid(now_s):
            return []
        words = "Avoidance: attitude setpoint lost, fly MANUAL or STABILIZED"
        return self._announcer.tell(mavlink.MAV_SEVERITY_EMERGENCY, words, now_s)

    def _rescue(self, now_s: float) -> list[Effect]:
        """Enter the guided mode again, in which the controller recovers; then give the aircraft back."""
        adapter = self._adapter()
        self._rescuing, self._was_guided = True, False
        self._claims.begin(TAKEN_AWAY)
        self._request = ModeRequest(
            self._aircraft.custom_mode, adapter.guided_mode, now_s, delay_s=adapter.entry_s
        )
        words = "Avoidance: attitude setpoint lost, recovering"
        return [*self._ask(now_s), *self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, words, now_s)]

    def _take_over(self, now_s: float) -> list[Effect]:
        aircraft, adapter = self._aircraft, self._adapter()
        self.supervisor.handle(self._conflict())
        self._before = aircraft.doing(now_s)
        self._rescuing = False
        self._was_guided = False
        self._claims.begin()
        self._way_back = Rejoin.to(self._before, adapter)
        self._request = ModeRequest(self._before.mode, adapter.guided_mode, now_s, delay_s=adapter.entry_s)
        adapter.stand_back()
        return [*self._ask(now_s), *self._announcer.conflict(self._outlook, now_s, flying=True)]

    def _while_engaging(self, now_s: float) -> list[Effect]:
        aircraft, request = self._aircraft, self._asked()
        if aircraft.guided:
            self._request, self._was_guided, self._taken_s = None, True, now_s
            self._flew_last = True
            self.engagements += 1
            self.supervisor.handle(Event.TAKEN)
            self.supervisor.handle(self._conflict())
            return []
        if self._clear and not self._rescuing:
            self.supervisor.handle(Event.CLEAR)
            return self._release(now_s)
        if request.refusals or now_s - request.asked_s >= _LONGEST_ENGAGING_S:
            return self._give_up_engaging(now_s)
        return self._ask(now_s)

    def _give_up_engaging(self, now_s: float) -> list[Effect]:
        request = self._asked()
        if not request.refusals and self._aircraft.heartbeat_s <= request.sent_s:
            # Not a word since: the aircraft may be in the guided mode by now, with nobody flying it.
            self.supervisor.handle(Event.UNKNOWN)
            return self._release(now_s)
        self.supervisor.handle(Event.REFUSED)
        self._request, self._ready_since_s = None, None
        self._abandoned += 1
        self._not_before_s = now_s + self._rules.retry_s * min(self._abandoned, 5)
        words = "refused" if request.refusals or request.postponements else "did not answer"
        return self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: autopilot {words}", now_s)

    def _while_flying(self, now_s: float) -> list[Effect]:
        self._abandoned = 0
        lost = "own position lost" if self._aircraft.blind(now_s) else None
        if not self._aircraft.heard(now_s):
            lost = "autopilot lost"  # and with it whose the aircraft is
        if lost is not None:
            self.supervisor.handle(Event.CLEAR)
            told = self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {lost}", now_s)
            return [*self._release(now_s), *told]
        refusals = self._adapter().refusals()
        self.rejections += len(refusals)
        refused = [
            effect
            for words in refusals
            for effect in self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {words}", now_s)
        ]
        if self._adapter().setpoint_invalid(now_s):
            self._rescuing, self._taken_s = True, now_s  # given back like this, nobody could fly it
        elif self._rescuing:
            self._rescuing = now_s - self._taken_s < _RESCUED_AFTER_S
        if self._clear and not self._rescuing:
            return [*refused, *self._while_clear(now_s)]
        if self.supervisor.handle(self._conflict()):
            return [*refused, *self._announcer.conflict(self._outlook, now_s, flying=True)]
        return refused

    def _while_clear(self, now_s: float) -> list[Effect]:
        """Give back, where the former mode can go on from here; else fly to where it can first."""
        if self._way_back is not None and not self._way_back.is_done(self._aircraft, now_s):
            if not self.supervisor.handle(Event.FAR):
                return []
            words = f"Clear of traffic, returning for {self._mode_before()}"
            return self._announcer.tell(mavlink.MAV_SEVERITY_NOTICE, words, now_s)
        self.supervisor.handle(Event.CLEAR)
        others = "" if self._outlook.decision.layer is Layer.CLEAR else "other "
        words = f"Clear of {others}traffic, back to {self._mode_before()}"
        return [*self._release(now_s), *self._announcer.tell(mavlink.MAV_SEVERITY_NOTICE, words, now_s)]

    def _while_releasing(self, now_s: float) -> list[Effect]:
        aircraft, request = self._aircraft, self._asked()
        if request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is Progress.CONFIRMED:
            self._request = None
            self._given_back_s = now_s
            if self._settles:
                self._settles, self._not_before_s = False, now_s + self._rules.settle_s
            if self._was_guided:
                self._strays.settled()
            self.supervisor.handle(Event.GIVEN_BACK)
            return []
        stuck = request.refusals and aircraft.guided and self.supervisor.state is State.RELEASING
        stuck = stuck and not self._claims.overlooked
        if stuck and not self._clear and self._operator.role is Role.FLY:
            # It cannot leave, and there is traffic: better flown by us than by nobody.
            self.supervisor.handle(self._conflict())
            return self._while_engaging(now_s)
        if request.refusals >= _REFUSALS_BEFORE_FALLBACK:
            return self._try_other_mode(now_s)
        return self._ask(now_s)

    def _try_other_mode(self, now_s: float) -> list[Effect]:
        """The former mode and the fallback in turn, while the autopilot refuses both."""
        adapter, request = self._adapter(), self._asked()
        text = f"Avoidance: cannot leave {adapter.mode_name(adapter.guided_mode)}, take over"
        other = self._before.mode
        if request.wanted == self._before.mode:
            other = adapter.fallback_mode
            text = f"Avoidance: {self._mode_before()} refused, {adapter.mode_name(other)} instead"
        self._request = ModeRequest(request.start, other, now_s)
        return [*self._ask(now_s), *self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, text, now_s)]

    def _hands_off(self, event: Event, now_s: float) -> list[Effect]:
        """Nothing is sent from now on, whatever becomes of it."""
        self._rescuing = False
        self._adapter().stand_back()
        self.supervisor.handle(event)
        self._request, self._ready_since_s = None, None
        self._given_back_s = -math.inf
        old_news = event is Event.MODE_CHANGED and self._may_be_old_news(now_s)
        if self._was_guided and not old_news:
            self._strays.settled()
        if event is Event.MODE_CHANGED:
            self._was_guided = False  # also another target in the guided mode is somebody's choice
        self._against_us = event is Event.MODE_CHANGED and self._aircraft.mode in self._rules.take_over_from
        words = f"Avoidance: hands off, {event}, {self._aircraft.mode}"
        return self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, words, now_s)

    def _release(self, now_s: float) -> list[Effect]:
        adapter = self._adapter()
        adapter.stand_back()
        # Our own request for the guided mode may still be under way: then the former mode, seen too soon, is
        # what it was before that arrived.
        asked = self._request is None or self._request.tries > 0
        settle_s = 0.0 if self._was_guided or not asked else _SETTLE_S
        if self._before.mode == adapter.guided_mode:
            settle_s = _RETARGET_S
        ending = self.supervisor.state is State.STOPPING
        aircraft = self._aircraft
        left = adapter.left_behind_mode()
        start = adapter.guided_mode if aircraft.custom_mode != left else aircraft.custom_mode
        blind_tries = _BLIND_RELEASES_AT_END if ending else _BLIND_RELEASES
        self._request = ModeRequest(
            start,
            self._before.mode,
            now_s,
            delay_s=adapter.exit_s if aircraft.guided else 0.0,
            settle_s=settle_s,
            blind_tries=blind_tries if asked else 0,
        )
        return self._ask(now_s)

    def _ask(self, now_s: float) -> list[Effect]:
        """Send the request for a mode, if the heartbeats allow it."""
        aircraft, adapter, request = self._aircraft, self._adapter(), self._asked()
        if not request.due(aircraft.custom_mode, aircraft.heartbeat_s, now_s):
            return []
        entering = self.supervisor.state is State.ENGAGING
        if entering:
            self._strays.asked(now_s)
        if not entering and request.wanted == self._before.mode:
            return self._announcer.transmit(adapter.give_back(self._before))
        return self._announcer.transmit([adapter.set_mode(request.wanted)])

    def _check_item(self, now_s: float) -> list[Effect]:
        """The mission goes on with the item that it was at; one that was started anew is sent there."""
        wanted, flown = self._before.sequence, self._aircraft.sequence
        if wanted is None or flown is None or now_s - self._given_back_s > _ITEM_CHECKED_S:
            return []
        if flown >= wanted or self._aircraft.custom_mode != self._before.mode:
            return []
        self._given_back_s = -math.inf
        adapter = self._adapter()
        return self._announcer.transmit([adapter.desk.ask(adapter.select_item(wanted), now_s)])

    def _asked(self) -> ModeRequest:
        if self._request is None:
            raise RuntimeError("no request under way: the supervisor must not get here")
        return self._request

    def _conflict(self) -> Event:
        return Event.INNER_CONFLICT if self._outlook.decision.layer is Layer.INNER else Event.OUTER_CONFLICT

    def answered(self, fact: CommandResult, now_s: float) -> None:
        """Take note of an acknowledgement."""
        adapter = self._adapter()
        if fact.command not in adapter.mode_commands:
            adapter.observe(fact, now_s)
        elif self._request is not None and fact.result == mavlink.MAV_RESULT_ACCEPTED:
            self._request.accepted(now_s)
        elif self._request is not None and fact.result != mavlink.MAV_RESULT_IN_PROGRESS:
            entering = self.supervisor.state is State.ENGAGING
            if entering and fact.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
                self._request.postponed(now_s)
                return
            self._request.refused(now_s)
            # Of several requests that were sent, another one may still be obeyed.
            if entering and self._request.refusals >= self._request.tries:
                self._strays.settled()

    def _adapter(self) -> Adapter:
        adapter = self._aircraft.adapter
        if adapter is None:
            raise RuntimeError("no autopilot: the supervisor must not get here")
        return adapter

    def _mode_before(self) -> str:
        return self._adapter().mode_name(self._before.mode)
