"""Taking the aircraft over: the guided mode is requested until the heartbeat shows it."""

from companion.control.context import Claims, ControlContext, Outgoing
from companion.control.mode_request import ModeRequest
from companion.control.rejoin import mission_airspeed_mps, way_back
from companion.control.release import Release
from companion.control.requesting import ModeRequester
from companion.control.state_machine import OVERRIDES, Event, State
from companion.mavlink.dialect import mavlink
from companion.output.notice import ConflictNotice, Notice

_LONGEST_ENGAGING_S = 3.0
# A request that is obeyed shows in the heartbeat within this time, unless that is lost.
_ANSWERED_WITHIN_S = 1.2
# The wait after a refusal grows with the refusals in a row, up to this many times.
_LONGEST_WAIT = 5


class TakeOver:
    """Enters the guided mode, for a conflict or for the controller to recover."""

    def __init__(
        self, context: ControlContext, claims: Claims, requester: ModeRequester, release: Release
    ) -> None:
        self._context = context
        self._claims = claims
        self._requester = requester
        self._release = release
        self.engagements = 0  # take-overs since the start

    def begin(self, now_s: float) -> Outgoing:
        """Take the aircraft over from the mode that it is in."""
        context, data = self._context, self._context.data
        adapter = context.adapter
        context.supervisor.handle(context.conflict)
        adapter.choose_way()
        data.prior = context.aircraft.prior_flight_state(now_s)
        data.plan = context.aircraft.navigation.plan_changes
        data.guided_since_s = data.flown_since_s = None
        self._claims.begin(data)
        data.rejoin = way_back(
            data.prior, context.aircraft, context.control.rejoin, context.params.min_height_m
        )
        data.mission_airspeed_mps = mission_airspeed_mps(data.prior, context.aircraft)
        data.request = ModeRequest(data.prior.mode, adapter.guided_mode, now_s, delay_s=adapter.entry_s)
        adapter.drop_commands()
        return [*self._requester.send(now_s), ConflictNotice(flying=True)]

    def re_enter(self, now_s: float) -> Outgoing:
        """Enter the guided mode again for the controller to recover; then the aircraft is given back."""
        context, data = self._context, self._context.data
        adapter = context.adapter
        data.guided_since_s = None
        self._claims.begin(data, OVERRIDES)
        data.request = ModeRequest(
            context.aircraft.flight_state.custom_mode,
            adapter.guided_mode,
            now_s,
            delay_s=adapter.entry_s,
            in_failsafe=context.in_loss_mode,
        )
        text = "Avoidance: attitude setpoint lost, recovering"
        return [*self._requester.send(now_s), Notice(mavlink.MAV_SEVERITY_CRITICAL, text)]

    def enter_again(self, now_s: float) -> Outgoing:
        """Enter the guided mode again after a gap of ours, with the setpoints that it is entered with."""
        context, data, adapter = self._context, self._context.data, self._context.adapter
        data.request = ModeRequest(
            context.aircraft.flight_state.custom_mode,
            adapter.guided_mode,
            now_s,
            delay_s=adapter.entry_s,
            in_failsafe=context.in_loss_mode,
        )
        return self._requester.send(now_s)

    def settle(self, now_s: float) -> Outgoing:
        """Go on flying after a gap of ours, as the aircraft is still in the guided mode."""
        self._context.data.request = None
        return self._note_taken(Event.SETTLED, now_s)

    def give_up(self, now_s: float) -> Outgoing:
        """Wait, because the mode that was requested before a gap of ours is not entered."""
        context, data = self._context, self._context.data
        context.supervisor.handle(Event.REFUSED)
        data.wait_until_s = now_s + context.params.retry_s
        return []

    def go_on(self, now_s: float) -> Outgoing:
        """Request the guided mode until the heartbeat shows it, the conflict ends or the request fails."""
        context, data, request = self._context, self._context.data, self._requester.request
        # After a gap it may have been in the guided mode already, before our setpoints.
        entered = request.start != request.wanted or context.aircraft.contact.heartbeat_s >= request.asked_s
        if context.aircraft.guided and entered:
            return self._note_taken(Event.TAKEN, now_s)
        if context.clear and context.supervisor.handle(Event.CLEAR):
            return self._release.begin(now_s)
        if not (request.refusals or now_s - request.asked_s >= _LONGEST_ENGAGING_S):
            return self._requester.send(now_s)
        if not request.refusals and now_s - request.sent_s < _ANSWERED_WITHIN_S:
            return []  # the last request may just be obeyed
        if not request.refusals and context.aircraft.contact.heartbeat_s <= request.sent_s:
            # No heartbeat since: the aircraft may be in the guided mode by now, flown by no one.
            context.supervisor.handle(Event.UNKNOWN)
            return self._release.begin(now_s)
        context.supervisor.handle(Event.REFUSED)
        data.given_up += 1
        data.wait_until_s = now_s + context.params.retry_s * min(data.given_up, _LONGEST_WAIT)
        outcome = "refused" if request.refusals or request.postponements else "did not answer"
        return [Notice(mavlink.MAV_SEVERITY_CRITICAL, f"Avoidance: autopilot {outcome}")]

    def _note_taken(self, event: Event, now_s: float) -> Outgoing:
        context, data = self._context, self._context.data
        context.supervisor.handle(event)
        if data.guided_since_s is None:
            self.engagements += 1
            data.guided_since_s, data.left_in_prior_mode = now_s, True
        if data.flown_since_s is None:
            data.flown_since_s = now_s
        if context.supervisor.state is State.RECOVERING:
            data.invalid_s = now_s
        else:
            context.supervisor.handle(context.conflict)
        return []
