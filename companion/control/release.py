"""Giving the aircraft back: the former mode is requested until the heartbeat shows it."""

import math

from companion.control.context import Claims, ControlContext, Outgoing
from companion.control.mode_request import CERTAIN_S, ModeRequest, Progress
from companion.control.requesting import ModeRequester
from companion.control.state_machine import OVERLOOKED_WHEN_FOUND, Event, State
from companion.mavlink.dialect import mavlink
from companion.model import Role
from companion.output.notice import Notice

_SETTLE_S = 1.0
# If the former mode is the guided one, the heartbeat shows no change: time to send the target again.
_RETARGET_S = 2.5
_REFUSALS_BEFORE_FALLBACK = 3
# An autopilot that restarts its mission does so within this time; the former item is selected again then.
_ITEM_CHECKED_S = 8.0
# Item 0 is home with ArduPilot.
_FIRST_ITEM = 1


class Release:
    """Leaves the guided mode for the former mode, or for the fallback mode when that is refused."""

    def __init__(self, context: ControlContext, claims: Claims, requester: ModeRequester) -> None:
        self._context = context
        self._claims = claims
        self._requester = requester

    def begin(self, now_s: float, *, found: bool = False) -> Outgoing:
        """Request the former mode; call this in the state RELEASING or STOPPING.

        `found`: the present mode is the one in which the aircraft was left.
        """
        context, data = self._context, self._context.data
        aircraft, adapter = context.aircraft, context.adapter
        adapter.drop_commands()
        # Our request for the guided mode may still be under way. A heartbeat with the former mode may then be
        # from before that request arrived.
        asked = data.request is None or data.request.tries > 0
        settle_s = 0.0 if data.guided_since_s is not None or not asked else _SETTLE_S
        if data.prior.mode == adapter.guided_mode:
            settle_s = _RETARGET_S
        found |= aircraft.flight_state.custom_mode == context.loss_mode
        start = aircraft.flight_state.custom_mode if found else adapter.guided_mode
        data.request = ModeRequest(
            start,
            data.prior.mode,
            now_s,
            delay_s=adapter.exit_s if aircraft.guided else 0.0,
            settle_s=settle_s,
            in_failsafe=context.in_loss_mode,
        )
        return self._requester.send(now_s)

    def begin_found(self, event: Event, now_s: float) -> Outgoing:
        """Give back an aircraft that was found in a mode in which it was left, for the reason `event`."""
        self._claims.begin(self._context.data, OVERLOOKED_WHEN_FOUND)
        text = f"Avoidance: {event}, giving back to {self._context.prior_mode}"
        return [*self.begin(now_s, found=True), Notice(mavlink.MAV_SEVERITY_WARNING, text)]

    def confirm(self, now_s: float) -> bool:
        """End the release when the heartbeat shows the requested mode; true when it has ended."""
        context, data, request = self._context, self._context.data, self._requester.request
        aircraft = context.aircraft
        progress = request.progress(aircraft.flight_state.custom_mode, aircraft.contact.heartbeat_s)
        if progress is not Progress.CONFIRMED:
            return False
        ending = context.supervisor.state is State.STOPPING
        if ending and aircraft.contact.heartbeat_s - aircraft.flight_state.mode_since_s < CERTAIN_S:
            return False
        if data.guided_since_s is not None:
            data.forget_request()
        if data.reclaiming:
            data.wait_until_s = now_s + context.params.settle_s
        waits = data.wait_until_s > now_s
        refused = request.wanted if request.wanted != data.prior.mode else None
        context.supervisor.handle(Event.RECLAIMED if waits else Event.GIVEN_BACK)
        # The heartbeat that shows the wanted mode may be wrong, and another mode follow.
        data.fallback, data.fell_out = refused, context.fell_out(request)
        if context.supervisor.state is not State.STOPPED:
            data.given_back_s = now_s
        return True

    def go_on(self, now_s: float) -> Outgoing:
        """Request the former mode again, or another one after refusals."""
        if self._requester.request.refusals >= _REFUSALS_BEFORE_FALLBACK:
            return self._try_other_mode(now_s)
        return self._requester.send(now_s)

    @property
    def stuck(self) -> bool:
        """Whether the autopilot refuses to leave the guided mode while there is traffic to avoid.

        We go on flying then, as no one else would avoid the traffic.
        """
        context, data = self._context, self._context.data
        refused = data.request is not None and data.request.refusals > 0
        releasing = context.supervisor.state is State.RELEASING and not data.overlooked
        stuck = refused and releasing and context.aircraft.guided
        return stuck and not context.clear and context.role is Role.FLY

    def restore_item(self, now_s: float) -> Outgoing:
        """Select the mission's former item, if the autopilot restarted the mission by itself.

        After a jump, another mission or another item that someone selected, the former item is history.
        """
        context, data = self._context, self._context.data
        wanted, present = data.prior.sequence, context.aircraft.navigation.sequence
        if wanted is None or present is None or now_s - data.given_back_s > _ITEM_CHECKED_S:
            return []
        if present >= wanted or context.aircraft.flight_state.custom_mode != data.prior.mode:
            return []
        own_restart = present <= _FIRST_ITEM and context.adapter.restarts_mission
        if not own_restart or context.aircraft.navigation.plan_changes != data.plan:
            return []
        data.given_back_s = -math.inf
        adapter = context.adapter
        return [adapter.commands.ask(adapter.select_item(wanted), now_s)]

    def restore_speed(self, now_s: float) -> Outgoing:
        """Command the mission's own airspeed again, which the autopilot forgot at the mode change."""
        context, data = self._context, self._context.data
        airspeed_mps, data.mission_airspeed_mps = data.mission_airspeed_mps, None
        late = now_s - data.given_back_s > _ITEM_CHECKED_S
        if airspeed_mps is None or late or context.aircraft.flight_state.custom_mode != data.prior.mode:
            return []
        mission, sequence = context.aircraft.navigation.mission, context.aircraft.navigation.sequence
        if mission is None or sequence is None:
            return []
        if airspeed_mps not in [item.params[1] for item in mission.speed_changes(sequence)]:
            return []
        adapter = context.adapter
        return [adapter.commands.ask(adapter.change_speed(airspeed_mps), now_s)]

    def _try_other_mode(self, now_s: float) -> Outgoing:
        """Request the former mode and the fallback in turn, while the autopilot refuses both."""
        context, data, request = self._context, self._context.data, self._requester.request
        adapter = context.adapter
        text = f"Avoidance: cannot leave {adapter.mode_name(request.start)}, take over"
        other = data.prior.mode
        if request.wanted == data.prior.mode:
            other = adapter.fallback_mode
            text = f"Avoidance: {context.prior_mode} refused, {adapter.mode_name(other)} instead"
        data.request = ModeRequest(request.start, other, now_s, in_failsafe=request.in_failsafe)
        return [*self._requester.send(now_s), Notice(mavlink.MAV_SEVERITY_CRITICAL, text)]
