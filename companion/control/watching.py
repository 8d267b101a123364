"""While the aircraft is not ours: it is given back if we left it, and taken over in a conflict."""

from companion.control.context import ControlContext, Outgoing
from companion.control.mode_request import EVIDENCE_S
from companion.control.readiness import Readiness
from companion.control.release import Release
from companion.control.state_machine import Event, State
from companion.control.take_over import TakeOver
from companion.control.unattended_guided import FLICKER_S, UnattendedGuided
from companion.mavlink.dialect import mavlink
from companion.model import PriorFlightState, Role
from companion.output.notice import ConflictNotice, Notice


class Watching:
    """Acts in the states of `WATCHING`."""

    def __init__(
        self,
        context: ControlContext,
        readiness: Readiness,
        unattended: UnattendedGuided,
        take_over: TakeOver,
        release: Release,
    ) -> None:
        self._context = context
        self._readiness = readiness
        self._unattended = unattended
        self._take_over = take_over
        self._release = release

    def step(self, now_s: float) -> Outgoing:
        """Give back what was left by us; take the aircraft over when it is ready and there is a conflict."""
        context, data, supervisor = self._context, self._context.data, self._context.supervisor
        if not context.aircraft.contact.resynchronized:
            advice = [] if context.clear else [ConflictNotice(flying=False)]
            return [*self._invalid_notices(now_s), *advice]
        if context.aircraft.adapter is not None and self._unattended.nothing_is_left(now_s):
            context.aircraft.adapter.choose_way()
        self._unattended.note_mode(now_s)
        self._note_choices()
        if self._is_invalid_outside(now_s) and supervisor.handle(Event.INVALID_OUTSIDE):
            return self._take_over.re_enter(now_s)
        found = self._unattended.found(now_s)
        if found is not None and supervisor.heeds(found[0]):
            return self._reclaim(*found, now_s)
        outgoing = self._invalid_notices(now_s)
        ready = not self._readiness.hindrances(now_s, context.role) and now_s >= data.wait_until_s
        if not ready and not context.clear:
            outgoing.append(ConflictNotice(flying=False))
        # The pilot resumed the mission while we flew: this conflict is not avoided.
        if not ready or (supervisor.state is State.SUPPRESSED and not context.clear):
            data.ready_since_s = None
            if not ready:
                supervisor.handle(Event.NOT_READY)
            return outgoing
        if supervisor.state in (State.HANDS_OFF, State.SUPPRESSED) and not self._has_settled(now_s):
            return outgoing
        supervisor.handle(Event.READY)
        if now_s - context.aircraft.contact.heartbeat_s > EVIDENCE_S:
            return outgoing
        outgoing += self._release.restore_speed(now_s)
        outgoing += self._release.restore_item(now_s)
        # A single heartbeat with another mode may be wrong.
        certain = now_s - context.aircraft.flight_state.mode_since_s >= FLICKER_S
        # The advice may last longer than its threats, while they fly away: that is nothing to take over for.
        in_conflict = not context.clear and bool(context.decision.threats)
        return [*outgoing, *self._take_over.begin(now_s)] if in_conflict and certain else outgoing

    def _has_settled(self, now_s: float) -> bool:
        """Whether it has been ready for `settle_s`."""
        data = self._context.data
        if data.ready_since_s is None:
            data.ready_since_s = now_s
        return now_s - data.ready_since_s >= self._context.params.settle_s

    def _note_choices(self) -> None:
        """Note a mode that someone else has chosen: our commands and the mission item are then dropped."""
        aircraft, data = self._context.aircraft, self._context.data
        in_prior_mode = aircraft.flight_state.custom_mode == data.prior.mode
        if not aircraft.guided:
            data.left_in_prior_mode &= in_prior_mode
        if aircraft.adapter is not None and not in_prior_mode:
            aircraft.adapter.commands.forget()
            data.forget_item()

    def _is_invalid_outside(self, now_s: float) -> bool:
        """Whether the setpoint became invalid while we flew, but is reported only now."""
        aircraft, data = self._context.aircraft, self._context.data
        if aircraft.adapter is None or not data.left_in_prior_mode or self._context.role is not Role.FLY:
            return False
        in_prior_mode = aircraft.flight_state.custom_mode == data.prior.mode
        return in_prior_mode and aircraft.adapter.setpoint_invalid(now_s)

    def _invalid_notices(self, now_s: float) -> Outgoing:
        """Warns the pilot that the controller has no valid setpoint: only the sticks fly the aircraft."""
        adapter = self._context.aircraft.adapter
        if adapter is None or not adapter.setpoint_invalid(now_s):
            return []
        text = "Avoidance: attitude setpoint lost, fly MANUAL or STABILIZED"
        return [Notice(mavlink.MAV_SEVERITY_EMERGENCY, text)]

    def _reclaim(self, event: Event, prior: PriorFlightState | None, now_s: float) -> Outgoing:
        """Give back an aircraft that is in the guided mode and flown by no one."""
        self._context.supervisor.handle(event)
        data = self._context.data
        if prior is not None:
            data.prior = prior
        if event is Event.INVALID_OUTSIDE:
            return self._take_over.re_enter(now_s)
        data.reclaiming = event is Event.ABANDONED
        return self._release.begin_found(event, now_s)
