"""Taking the aircraft over and giving it back: the supervisor's table, driven by what is heard and decided.

The heartbeat says who has the aircraft (see `ModeRequest`); a mode that we did not ask for ends ours at once.
"""

import math

from companion.autopilots.adapter import Adapter
from companion.engine.aircraft import Aircraft
from companion.engine.announcer import Announcer, Outlook
from companion.engine.effects import Effect
from companion.engine.mode_request import ModeRequest, Progress
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult
from companion.model import Decision, Layer
from companion.supervisor import WATCHING, Event, State, Supervisor, SupervisorParams

# The mode is taken over only from one that was heard just now.
_FRESH_HEARTBEAT_S = 1.5
_LONGEST_ENGAGING_S = 3.0
# A request that was given up may still arrive, on a slow link.
_LATE_S = 6.0
# Without heartbeats nobody knows whose the aircraft is: one try to give it back, more when we are going.
_BLIND_RELEASES, _BLIND_RELEASES_AT_END = 1, 3
_SETTLE_S = 1.0
_REFUSALS_BEFORE_FALLBACK = 3
_ASKING = frozenset({State.ENGAGING, State.RELEASING, State.STOPPING})


class Authority:
    """Holds the supervisor, and the request for a mode that is under way."""

    def __init__(
        self, aircraft: Aircraft, rules: SupervisorParams, announcer: Announcer, *, position_stale_s: float
    ) -> None:
        self.supervisor = Supervisor()
        self._aircraft = aircraft
        self._rules = rules
        self._announcer = announcer
        self._position_stale_s = position_stale_s
        self._outlook = Outlook(Decision(Layer.CLEAR), None, ())
        self._mode_before = 0
        self._request: ModeRequest | None = None
        self._was_guided = False  # since the last take-over was begun
        self._against_us = False  # somebody sent the aircraft on its mission while we flew it
        self._abandoned = 0
        self._guided_sent_s = -math.inf
        self._other_mode = 0  # the last one heard that was not ours
        self._ready_since_s: float | None = None
        self._not_before_s = -math.inf

    def request_stop(self, now_s: float) -> list[Effect]:
        """The service ends: give the aircraft back first. Tick on until `finished`."""
        held = self.supervisor.flying or self.supervisor.state is State.ENGAGING
        if not self.supervisor.handle(Event.STOP) or not held:
            return []
        ending = f"Avoidance ends, back to {self._before()}"
        return [*self._release(now_s), *self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, ending, now_s)]

    def emergency_release(self) -> list[Message]:
        """Messages that ask for the former mode, when the engine itself cannot be trusted any more."""
        adapter = self._aircraft.adapter
        held = self.supervisor.flying or self.supervisor.state in _ASKING
        return [adapter.set_mode(self._mode_before)] if adapter is not None and held else []

    def step(self, outlook: Outlook, now_s: float) -> list[Effect]:
        """Act on what is heard and decided, by the supervisor's table."""
        self._outlook = outlook
        if not self._aircraft.guided:
            self._other_mode = self._aircraft.custom_mode
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
        aircraft, request = self._aircraft, self._request
        if aircraft.landed():
            return True
        if request is None:
            return not aircraft.guided
        return request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is Progress.OVERRULED

    def _while_watching(self, now_s: float) -> list[Effect]:
        if self._came_late(now_s):
            self.supervisor.handle(Event.LATE)
            self._mode_before = self._other_mode
            return self._release(now_s)
        clear = self._outlook.decision.layer is Layer.CLEAR
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
        fresh = now_s - self._aircraft.heartbeat_s <= _FRESH_HEARTBEAT_S
        if clear or not fresh:
            return []
        self.supervisor.handle(self._conflict())
        self._mode_before = self._aircraft.custom_mode
        self._was_guided = False
        self._request = ModeRequest(self._mode_before, self._adapter().guided_mode, now_s)
        self._adapter().stand_back()
        return [*self._ask(now_s), *self._announcer.conflict(self._outlook, now_s)]

    def _while_engaging(self, now_s: float) -> list[Effect]:
        aircraft, request = self._aircraft, self._asked()
        if aircraft.guided:
            self._request, self._was_guided = None, True
            self.supervisor.handle(Event.TAKEN)
            self.supervisor.handle(self._conflict())
            return []
        if self._outlook.decision.layer is Layer.CLEAR:
            self.supervisor.handle(Event.CLEAR)
            return self._release(now_s)
        if request.refusals or now_s - request.made_s >= _LONGEST_ENGAGING_S:
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
        words = "refused" if request.refusals else "did not answer"
        return self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: autopilot {words}", now_s)

    def _came_late(self, now_s: float) -> bool:
        """The guided mode, entered on a request that we had given up: nobody else flies it."""
        late = self._aircraft.guided and now_s - self._guided_sent_s < _LATE_S
        return late and self.supervisor.state in (State.STANDBY, State.HANDS_OFF)

    def _while_flying(self, now_s: float) -> list[Effect]:
        self._abandoned = 0
        if self._aircraft.blind(now_s):
            self.supervisor.handle(Event.CLEAR)
            lost = self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, "Avoidance: own position lost", now_s)
            return [*self._release(now_s), *lost]
        refused = [
            effect
            for words in self._adapter().refusals()
            for effect in self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {words}", now_s)
        ]
        if self._outlook.decision.layer is Layer.CLEAR:
            self.supervisor.handle(Event.CLEAR)
            told = self._announcer.tell(mavlink.MAV_SEVERITY_NOTICE, self._returned(), now_s)
            return [*refused, *self._release(now_s), *told]
        if self.supervisor.handle(self._conflict()):
            return [*refused, *self._announcer.conflict(self._outlook, now_s)]
        return refused

    def _while_releasing(self, now_s: float) -> list[Effect]:
        aircraft, request = self._aircraft, self._asked()
        if request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is Progress.CONFIRMED:
            self._request = None
            self.supervisor.handle(Event.GIVEN_BACK)
            return []
        stuck = request.refusals and aircraft.guided and self.supervisor.state is State.RELEASING
        if stuck and self._outlook.decision.layer is not Layer.CLEAR:
            # It cannot leave, and there is traffic: better flown by us than by nobody.
            self.supervisor.handle(self._conflict())
            return self._while_engaging(now_s)
        if request.refusals >= _REFUSALS_BEFORE_FALLBACK:
            return self._try_other_mode(now_s)
        return self._ask(now_s)

    def _try_other_mode(self, now_s: float) -> list[Effect]:
        """The former mode and the fallback in turn, while the autopilot refuses both."""
        adapter, request = self._adapter(), self._asked()
        text = "Avoidance: cannot leave GUIDED, take over"
        other = self._mode_before
        if request.wanted == self._mode_before:
            other = adapter.fallback_mode
            text = f"Avoidance: {self._before()} refused, {adapter.mode_name(other)} instead"
        self._request = ModeRequest(request.start, other, now_s)
        return [*self._ask(now_s), *self._announcer.tell(mavlink.MAV_SEVERITY_CRITICAL, text, now_s)]

    def _ready(self, now_s: float) -> bool:
        aircraft = self._aircraft
        return (
            aircraft.adapter is not None
            and aircraft.adapter.can_fly
            and aircraft.fixed_wing
            and aircraft.heard(now_s)
            and now_s - aircraft.position_s <= self._position_stale_s
            and aircraft.mode in self._rules.take_over_from
            and aircraft.flying(self._rules.min_height_m)
            and now_s >= self._not_before_s
        )

    def _hands_off(self, now_s: float) -> list[Effect]:
        self._adapter().stand_back()
        self.supervisor.handle(Event.LOST)
        self._request, self._ready_since_s = None, None
        self._against_us = self._aircraft.mode in self._rules.take_over_from
        mode = self._aircraft.mode if self._aircraft.armed else "disarmed"
        return self._announcer.tell(mavlink.MAV_SEVERITY_WARNING, f"Avoidance: hands off, {mode}", now_s)

    def _release(self, now_s: float) -> list[Effect]:
        adapter = self._adapter()
        adapter.stand_back()
        # Our own request for the guided mode may still be under way: then the former mode, seen too soon, is
        # what it was before that arrived.
        settle_s = 0.0 if self._was_guided else _SETTLE_S
        ending = self.supervisor.state is State.STOPPING
        self._request = ModeRequest(
            adapter.guided_mode,
            self._mode_before,
            now_s,
            settle_s=settle_s,
            blind_tries=_BLIND_RELEASES_AT_END if ending else _BLIND_RELEASES,
        )
        return self._ask(now_s)

    def _ask(self, now_s: float) -> list[Effect]:
        """Send the request for a mode, if the heartbeats allow it."""
        aircraft, request = self._aircraft, self._asked()
        if not request.due(aircraft.custom_mode, aircraft.heartbeat_s, now_s):
            return []
        if request.wanted == self._adapter().guided_mode:
            self._guided_sent_s = now_s
        return self._announcer.transmit([self._adapter().set_mode(request.wanted)])

    def _asked(self) -> ModeRequest:
        if self._request is None:
            raise RuntimeError("no request under way: the supervisor must not get here")
        return self._request

    def _conflict(self) -> Event:
        return Event.INNER_CONFLICT if self._outlook.decision.layer is Layer.INNER else Event.OUTER_CONFLICT

    def answered(self, fact: CommandResult, now_s: float) -> None:
        """Take note of an acknowledgement."""
        adapter = self._adapter()
        if fact.command != adapter.mode_command:
            adapter.observe(fact, now_s)
        elif self._request is not None and fact.result == mavlink.MAV_RESULT_ACCEPTED:
            self._request.accepted(now_s)
        elif self._request is not None and fact.result != mavlink.MAV_RESULT_IN_PROGRESS:
            self._request.refused(now_s)
            if self.supervisor.state is State.ENGAGING:
                self._guided_sent_s = -math.inf  # nothing is under way any more

    def _adapter(self) -> Adapter:
        adapter = self._aircraft.adapter
        if adapter is None:
            raise RuntimeError("no autopilot: the supervisor must not get here")
        return adapter

    def _before(self) -> str:
        return self._adapter().mode_name(self._mode_before)

    def _returned(self) -> str:
        return f"Clear of traffic, back to {self._before()}"
