"""Settles on each tick who has the aircraft: facts and decisions drive the state machine.

The heartbeat shows who has the aircraft (see `ModeRequest`). After a mode that we did not request, and after
any other of the `OVERRIDES`, the aircraft is not ours: nothing more is decided or sent. After a gap of ours
nothing is sent before a heartbeat from after the gap.
"""

import math
from typing import NamedTuple

from companion.control import suppressed_threats
from companion.control.alarms import conditions
from companion.control.context import Claims, Commanding, ControlContext, Outgoing, Unheard
from companion.control.mode_request import CERTAIN_S, ModeRequest
from companion.control.readiness import Readiness
from companion.control.rejoin import ControlParams, LegRejoin
from companion.control.release import Release
from companion.control.requesting import ModeRequester
from companion.control.state_machine import (
    ENTERING,
    HELD,
    OVERLOOKED_WHEN_FOUND,
    WATCHING,
    YIELDED_TO,
    Event,
    State,
    Supervisor,
    SupervisorParams,
)
from companion.control.take_over import TakeOver
from companion.control.unattended_guided import UnattendedGuided
from companion.control.watching import Watching
from companion.geodesy import GeoPoint
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import CommandResult
from companion.model import Decision, Layer, Role
from companion.output.notice import Condition, ConflictNotice, Notice, ResumeNotice
from companion.output.persisted_state import PersistedState
from companion.ownship.aircraft import Aircraft
from companion.ownship.legs import Leg

# Datagrams overtake each other: a heartbeat from before the take-over may arrive this long after it.
_OVERTAKEN_S = 1.5
# A failsafe, a fence breach or rotors delay the release for no longer when the service ends.
_LONGEST_YIELD_S = 5.0
# PX4 stays in its guided mode for a second without setpoints: heartbeats that come more often show it.
_LEFT_UNSEEN_S = 0.9
# Setpoints flown for this long after the last invalid one mean that the controller has recovered.
_RECOVERED_AFTER_S = 3.0


class Orders(NamedTuple):
    """The operator's orders: the role, and whether to resume the mission now."""

    role: Role
    resume: bool


class Handover:
    """Takes the aircraft over, flies it, gives it back, and lets go at once when someone else has it."""

    def __init__(
        self,
        aircraft: Aircraft,
        params: SupervisorParams,
        readiness: Readiness,
        control: ControlParams | None = None,
    ) -> None:
        self.supervisor = Supervisor()
        self.rejections = 0  # commands that were refused, or never answered
        role = Role[params.role.upper()]
        self._context = ControlContext(
            aircraft, self.supervisor, params, role, Decision(Layer.CLEAR), control or ControlParams()
        )
        self.commanding = Commanding(self._context)
        self._readiness = readiness
        self._claims = Claims(aircraft)
        self._unattended = UnattendedGuided(self._context)
        self._requester = ModeRequester(self._context)
        self._release = Release(self._context, self._claims, self._requester)
        self._take_over = TakeOver(self._context, self._claims, self._requester, self._release)
        self._watching = Watching(self._context, readiness, self._unattended, self._take_over, self._release)

    # --- interface

    @property
    def suppresses(self) -> bool:
        """Whether the operator's decision suppresses any conflict."""
        return bool(self.supervisor.data.suppressed_s)

    @property
    def engagements(self) -> int:
        """Number of take-overs so far."""
        return self._take_over.engagements

    def retune(self, params: SupervisorParams) -> None:
        """Use other parameters from now on."""
        self._context.params = params
        self._readiness.params = params

    def recover(self, left: PersistedState) -> None:
        """Store the state of a former run: the aircraft that it was flying is given back when it is found."""
        self.supervisor.data.left_behind = left if left.before is not None else None

    def persisted(self, now_s: float, changed_role: Role | None) -> PersistedState | None:
        """The state that the next run needs if this one is killed now; `None`: none."""
        adapter, holds = self._context.aircraft.adapter, self.supervisor.holds
        if adapter is None or not (holds or adapter.changed_parameters or changed_role is not None):
            return None
        prior = self.supervisor.data.prior if holds else None
        left_behind = adapter.setpoint_loss_mode()
        system_id = adapter.target.system_id
        return PersistedState(now_s, system_id, prior, changed_role, left_behind, adapter.changed_parameters)

    def goes_on_to(self) -> GeoPoint | None:
        """The mission's destination after the release; `None`: unknown, or the aircraft is not ours."""
        if not self.supervisor.holds:
            return None
        return self._context.aircraft.mission_destination(self.supervisor.data.prior)

    def leg(self) -> Leg | None:
        """The leg that is flown back to; `None`: none, or the aircraft is not ours."""
        rejoin = self.supervisor.data.rejoin if self.supervisor.holds else None
        if not isinstance(rejoin, LegRejoin):
            return None
        navigation = self._context.aircraft.navigation
        if rejoin.leg_of == (navigation.mission, navigation.sequence):
            return rejoin.leg
        return rejoin.present_leg(self._context.aircraft)

    def answered(self, fact: CommandResult, now_s: float) -> None:
        """Process an acknowledgement."""
        self._requester.answered(fact, now_s)

    def request_stop(self, now_s: float) -> Outgoing:
        """Give the aircraft back because the service ends; STOPPED is reached when that is confirmed."""
        supervisor, data = self.supervisor, self.supervisor.data
        watching = supervisor.state in WATCHING
        held = supervisor.state in HELD and supervisor.state is not State.RELEASING
        prior = self._unattended.prior_if_left(now_s) if watching else None
        if not supervisor.handle(Event.STOP if prior is None else Event.STOP_UNATTENDED):
            return []
        if prior is not None:
            data.prior = prior
            self._claims.begin(data, OVERLOOKED_WHEN_FOUND)
        if not (held or prior is not None):
            return []
        text = f"Avoidance ends, back to {self._context.prior_mode}"
        return [*self._release.begin(now_s), Notice(mavlink.MAV_SEVERITY_WARNING, text)]

    def note_gap(self, now_s: float) -> None:
        """Note that we did nothing until now: commands under way are dropped, what is known is of before."""
        aircraft = self._context.aircraft
        aircraft.contact.note_gap(now_s)
        if aircraft.adapter is not None and self.supervisor.state not in WATCHING:
            aircraft.adapter.drop_commands()
        self.supervisor.handle(Event.GAP)

    def conditions(self, now_s: float) -> list[Condition]:
        """What the pilot must know for as long as it lasts."""
        return conditions(self._context, self._unattended, now_s)

    # --- each tick, first: who has the aircraft

    def check_overrides(self, now_s: float) -> Outgoing | None:
        """Act on an override and return what to send; `None` when there is none.

        Call this first on every tick: it depends only on what the autopilot reports.
        """
        supervisor, aircraft = self.supervisor, self._context.aircraft
        if supervisor.state not in HELD and supervisor.state is not State.STOPPING:
            return None
        if not aircraft.contact.resynchronized:
            return None
        present = self._claims.current(supervisor.data, now_s)
        override = next((event for event in present if supervisor.heeds(event)), None)
        if supervisor.state is State.STOPPING and override is None:
            self._yield_to(YIELDED_TO.intersection(present), now_s)
        if override is None:
            return None
        if override is Event.COMPANION:
            return self._make_way(now_s)
        stopping = supervisor.state is State.STOPPING
        in_mode_s = now_s - aircraft.flight_state.mode_since_s
        if override is Event.MODE_CHANGED and stopping and in_mode_s < CERTAIN_S:
            return None  # nothing is requested meanwhile, and the service ends only when it is certain
        if override is Event.MODE_CHANGED and stopping and self._fell_while_yielding():
            return self._release.begin_found(Event.FOUND, now_s)
        # PX4 reports the end of our setpoints as a failsafe, until a mode is chosen.
        if override in (Event.MODE_CHANGED, Event.FAILSAFE) and self._left_guided_by_itself(now_s):
            # Just after a silence, the state of the aircraft is not known yet: wait.
            return None if aircraft.contact.just_regained(now_s) else self._fell_out(now_s)
        return self._hands_off(override, now_s)

    def _yield_to(self, claims: frozenset[Event], now_s: float) -> None:
        """Delay the release once for some seconds after a claim; for as long as a lasting one holds.

        Lasting are sticks that move, and a second vehicle with the same system id. The service may then end
        without having given the aircraft back.
        """
        data, delay_s = self.supervisor.data, min(self._context.params.abandoned_s, _LONGEST_YIELD_S)
        aircraft = self._context.aircraft
        lasting = aircraft.sticks.in_use(now_s) or aircraft.identity.is_ambiguous(now_s)
        if claims and (lasting or data.yields_until_s == -math.inf):
            data.yields_until_s = now_s + delay_s

    def _make_way(self, now_s: float) -> Outgoing:
        """Give the aircraft back, because another companion avoids too."""
        self.supervisor.handle(Event.COMPANION)
        text = f"Avoidance: another companion, back to {self._context.prior_mode}"
        return [*self._release.begin(now_s), Notice(mavlink.MAV_SEVERITY_WARNING, text)]

    def _hands_off(self, override: Event, now_s: float) -> Outgoing:
        """Let go of the aircraft: drop all commands, and send nothing from now on."""
        context, data, supervisor = self._context, self.supervisor.data, self.supervisor
        context.adapter.drop_commands()
        changed = override in (Event.MODE_CHANGED, Event.TARGET)
        if data.guided_since_s is not None and not (changed and self._may_be_overtaken(now_s)):
            data.forget_request()
        if override is Event.TARGET:
            data.guided_since_s = None  # it flies to someone's target
        request = data.request  # before it is forgotten
        sent_back = changed and context.aircraft.mode in context.params.take_over_from
        if not (sent_back and supervisor.handle(Event.SENT_BACK)):
            supervisor.handle(override)
        unseen = data.guided_since_s is None and self._may_have_been_entered(request, now_s)
        if unseen:
            data.guided_since_s = data.requested_s
        # A failsafe that is shown with the mode entered in it may be the end of our setpoints alone.
        fell = override is Event.FAILSAFE and context.in_loss_mode
        data.let_go = Event.MODE_CHANGED if fell else override
        data.fell_out = context.fell_out(request)
        data.seen_guided = unseen or context.aircraft.guided
        if not context.aircraft.guided:
            # The next heartbeat may already show the guided mode, of a request that arrives late.
            data.last_unguided_mode = context.aircraft.flight_state.custom_mode
        text = f"Avoidance: hands off, {override}, {context.aircraft.mode}"
        return [Notice(mavlink.MAV_SEVERITY_WARNING, text)]

    def _may_have_been_entered(self, request: ModeRequest | None, now_s: float) -> bool:
        """Whether the guided mode may have been entered as requested, and left, while it was not heard.

        `request` is the one under way: for the guided mode, or to give back what may have been entered.
        """
        aircraft, requested_s = self._context.aircraft, self.supervisor.data.requested_s
        if request is None or not math.isfinite(requested_s):
            return False
        sent = request.tries > 0 or request.wanted != self._context.adapter.guided_mode
        contact = aircraft.contact
        interrupted = contact.just_regained(now_s) or contact.uplink_interrupted(now_s)
        # The newest heartbeat may be from before the silence: then the mode of now is not known yet.
        unseen_s = max(aircraft.unseen_before_mode_s, now_s - aircraft.contact.heartbeat_s)
        return sent and interrupted and unseen_s >= _LEFT_UNSEEN_S

    def _left_guided_by_itself(self, now_s: float) -> bool:
        """Whether the link was lost just now, and the mode is the one that the autopilot enters then."""
        return self._context.aircraft.left_guided_by_itself(now_s) and self.supervisor.heeds(Event.FOUND)

    def _fell_while_yielding(self) -> bool:
        """Whether the release was delayed, and the autopilot left the guided mode by itself meanwhile."""
        context = self._context
        yielded = context.data.yields_until_s > -math.inf
        return (
            yielded
            and context.aircraft.flight_state.custom_mode == context.loss_mode
            and not context.fell_out(context.data.request)
        )

    def _fell_out(self, now_s: float) -> Outgoing:
        """Give back an aircraft that left the guided mode by itself, or let its controller recover first."""
        invalid = self._context.adapter.setpoint_invalid(now_s)
        invalid &= self.supervisor.heeds(Event.INVALID_OUTSIDE)
        event = Event.INVALID_OUTSIDE if invalid else Event.FOUND
        self.supervisor.handle(event)
        return self._take_over.re_enter(now_s) if invalid else self._release.begin_found(event, now_s)

    def _may_be_overtaken(self, now_s: float) -> bool:
        """Whether the heartbeat may be from before the take-over, overtaken on its way by a newer one."""
        aircraft, data = self._context.aircraft, self.supervisor.data
        if data.guided_since_s is None or aircraft.guided:
            return False
        in_prior_mode = aircraft.flight_state.custom_mode == data.prior.mode
        return in_prior_mode and now_s - data.guided_since_s < _OVERTAKEN_S

    # --- each tick, after the decision

    def step(
        self, decision: Decision, orders: Orders, now_s: float, unheard: Unheard | None = None
    ) -> Outgoing:
        """Act on the decision and on the operator's orders, by the state machine.

        `unheard` returns, in words, that the last threat is not heard any more; `None` while it is.
        """
        context, supervisor = self._context, self.supervisor
        context.decision, context.role = decision, orders.role
        context.unheard = unheard or context.unheard
        if supervisor.data.suppressed_s:
            suppressed_threats.update(supervisor.data, decision, context.params.settle_s, now_s)
        if orders.role is not Role.FLY:
            supervisor.data.suppressed_s = {}  # when the role is fly again, all are avoided
        if supervisor.state in WATCHING:
            return self._watching.step(now_s)
        if supervisor.state is State.STOPPED or self._is_just_back(now_s):
            return []
        if orders.role is not Role.FLY and supervisor.handle(Event.ADVISE):
            text = f"Avoidance ended by operator, back to {context.prior_mode}"
            return [*self._release.begin(now_s), Notice(mavlink.MAV_SEVERITY_NOTICE, text)]
        if orders.resume:
            return self._resume(now_s)
        if supervisor.state is State.RESYNCHRONISING:
            return self._resynchronize(now_s)
        if supervisor.state in ENTERING:
            return self._take_over.go_on(now_s)
        if supervisor.flying:
            return self._fly(now_s)
        return self._give_back(now_s)

    def _is_just_back(self, now_s: float) -> bool:
        """Whether it left the guided mode in a silence that ended too recently to know its state."""
        if not (self._context.aircraft.contact.just_regained(now_s) and self._left_guided_by_itself(now_s)):
            return False
        return Event.MODE_CHANGED in self._claims.current(self.supervisor.data, now_s)

    def _resume(self, now_s: float) -> Outgoing:
        """Give the aircraft back now, whatever the traffic, as the operator decided."""
        context = self._context
        suppressed_threats.suppress(context.data, context.decision, now_s)
        if not self.supervisor.handle(Event.RESUME):
            return []
        return [*self._release.begin(now_s), ResumeNotice(context.prior_mode)]

    def _resynchronize(self, now_s: float) -> Outgoing:
        """Go on after a gap, once a heartbeat shows what the aircraft does now."""
        context, supervisor, aircraft = self._context, self.supervisor, self._context.aircraft
        if not aircraft.contact.heard(now_s):
            return self._lose("autopilot lost", now_s)
        if not aircraft.contact.resynchronized:
            return []
        if aircraft.flight_state.custom_mode == context.loss_mode != context.data.prior.mode:
            return self._fell_out(now_s)
        if not aircraft.guided:
            return self._take_over.give_up(now_s)  # asked for before the gap, and not entered
        if context.adapter.setpoint_invalid(now_s):
            return self._fell_out(now_s)
        if context.adapter.entry_s == 0.0:
            return self._take_over.settle(now_s)
        # The autopilot may have left the guided mode by now, and would enter it again by our first setpoint.
        if context.clear:
            supervisor.handle(Event.CLEAR)
            return self._release.begin(now_s)
        supervisor.handle(context.conflict)
        return self._take_over.enter_again(now_s)

    def _lose(self, lost: str, now_s: float) -> Outgoing:
        """Give the aircraft back, because own position or autopilot is lost."""
        self.supervisor.handle(Event.LOST)
        return [*self._release.begin(now_s), Notice(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {lost}")]

    def _fly(self, now_s: float) -> Outgoing:
        context, data, supervisor = self._context, self.supervisor.data, self.supervisor
        aircraft, adapter = context.aircraft, context.adapter
        data.given_up = 0
        lost = "own position lost" if aircraft.kinematics.position_lost(now_s) else None
        if not aircraft.contact.heard(now_s):
            lost = "autopilot lost"  # then it is unknown who has the aircraft
        if lost is not None:
            return self._lose(lost, now_s)
        refusals = adapter.refusals()
        self.rejections += len(refusals)
        refused = [Notice(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: {text}") for text in refusals]
        if adapter.setpoint_invalid(now_s):
            supervisor.handle(Event.INVALID_GUIDED)
            data.invalid_s = now_s
        elif supervisor.state is State.RECOVERING and now_s - data.invalid_s >= _RECOVERED_AFTER_S:
            supervisor.handle(Event.RECOVERED)
        if supervisor.state is State.RECOVERING:
            return [*refused]
        if context.clear:
            return [*refused, *self._fly_clear(now_s)]
        changed = supervisor.handle(context.conflict)
        return [*refused, ConflictNotice(flying=True)] if changed else [*refused]

    def _fly_clear(self, now_s: float) -> Outgoing:
        """Give the aircraft back if the former mode can be entered here; otherwise fly to where it can."""
        context, rejoin = self._context, self.supervisor.data.rejoin
        if rejoin is not None and not rejoin.is_done(context.aircraft, now_s):
            if not self.supervisor.handle(Event.FAR):
                return []
            clear = context.unheard(now_s) or "Clear of traffic"
            text = f"{clear}, returning to {rejoin.destination(context.aircraft)}"
            return [Notice(mavlink.MAV_SEVERITY_NOTICE, text)]
        self.supervisor.handle(Event.CLEAR)
        others = "" if context.decision.layer is Layer.CLEAR else "other "
        text = f"{context.unheard(now_s) or f'Clear of {others}traffic'}, back to {context.prior_mode}"
        return [*self._release.begin(now_s), Notice(mavlink.MAV_SEVERITY_NOTICE, text)]

    def _give_back(self, now_s: float) -> Outgoing:
        if not self._context.aircraft.contact.resynchronized or self._release.confirm(now_s):
            return []
        if now_s < self.supervisor.data.yields_until_s:
            return []
        if self._release.stuck:
            self.supervisor.handle(self._context.conflict)
            return self._take_over.go_on(now_s)
        return self._release.go_on(now_s)
