"""Giving the aircraft back: the former mode is asked for until the heartbeat shows it."""

import math

from companion.control.context import ControlContext, Outgoing
from companion.control.mode_request import ModeRequest, Progress
from companion.control.requesting import ModeRequester
from companion.control.state_machine import Event, State
from companion.mavlink.dialect import mavlink
from companion.model import Role
from companion.output.notice import Notice

# Without heartbeats it is unknown who has the aircraft: so many requests are sent, at the end more.
_BLIND_RELEASES, _BLIND_RELEASES_AT_END = 1, 3
_SETTLE_S = 1.0
# Given back to the guided mode, the heartbeat shows no change: time for the former target to be sent again.
_RETARGET_S = 2.5
_REFUSALS_BEFORE_FALLBACK = 3
# The mission goes on with the item that it was at; an autopilot that restarts it does so within this time.
_ITEM_CHECKED_S = 8.0


class Release:
    """Out of the guided mode."""

    def __init__(self, context: ControlContext, requester: ModeRequester) -> None:
        self._context = context
        self._requester = requester

    def begin(self, now_s: float) -> Outgoing:
        """Ask for the former mode; to be called in the state RELEASING or STOPPING."""
        context, data = self._context, self._context.data
        aircraft, adapter = context.aircraft, context.adapter
        adapter.drop_commands()
        # Our own request for the guided mode may still be under way. The former mode, seen too soon, is then
        # the one from before that request arrived.
        asked = data.request is None or data.request.tries > 0
        settle_s = 0.0 if data.guided_since_s is not None or not asked else _SETTLE_S
        if data.prior.mode == adapter.guided_mode:
            settle_s = _RETARGET_S
        left = adapter.setpoint_loss_mode()
        start = adapter.guided_mode if aircraft.custom_mode != left else aircraft.custom_mode
        ending = context.supervisor.state is State.STOPPING
        blind_tries = _BLIND_RELEASES_AT_END if ending else _BLIND_RELEASES
        data.request = ModeRequest(
            start,
            data.prior.mode,
            now_s,
            delay_s=adapter.exit_s if aircraft.guided else 0.0,
            settle_s=settle_s,
            blind_tries=blind_tries if asked else 0,
        )
        return self._requester.send(now_s)

    def confirm(self, now_s: float) -> bool:
        """End the release when the heartbeat shows the mode that was asked for."""
        context, data, request = self._context, self._context.data, self._requester.request
        aircraft = context.aircraft
        if request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is not Progress.CONFIRMED:
            return False
        if data.guided_since_s is not None:
            data.forget_request()
        context.supervisor.handle(Event.RECLAIMED if data.reclaiming else Event.GIVEN_BACK)
        if context.supervisor.state is not State.STOPPED:
            data.given_back_s = now_s
        if context.supervisor.state is State.WAITING:
            data.wait_until_s = now_s + context.params.settle_s
        return True

    def go_on(self, now_s: float) -> Outgoing:
        """Ask again for the former mode; for another one when it is refused."""
        if self._requester.request.refusals >= _REFUSALS_BEFORE_FALLBACK:
            return self._try_other_mode(now_s)
        return self._requester.send(now_s)

    @property
    def stuck(self) -> bool:
        """Whether the autopilot refuses to leave the guided mode while there is traffic to avoid.

        We go on flying then, which is better than that no one does.
        """
        context, data = self._context, self._context.data
        refused = data.request is not None and data.request.refusals > 0
        releasing = context.supervisor.state is State.RELEASING and not data.overlooked
        stuck = refused and releasing and context.aircraft.guided
        return stuck and not context.clear and context.role is Role.FLY

    def restore_item(self, now_s: float) -> Outgoing:
        """Send the mission to the item that it was at, when the autopilot restarted it."""
        context, data = self._context, self._context.data
        wanted, present = data.prior.sequence, context.aircraft.sequence
        if wanted is None or present is None or now_s - data.given_back_s > _ITEM_CHECKED_S:
            return []
        if present >= wanted or context.aircraft.custom_mode != data.prior.mode:
            return []
        data.given_back_s = -math.inf
        adapter = context.adapter
        return [adapter.commands.ask(adapter.select_item(wanted), now_s)]

    def _try_other_mode(self, now_s: float) -> Outgoing:
        """The former mode and the fallback in turn, while the autopilot refuses both."""
        context, data, request = self._context, self._context.data, self._requester.request
        adapter = context.adapter
        text = f"Avoidance: cannot leave {adapter.mode_name(adapter.guided_mode)}, take over"
        other = data.prior.mode
        if request.wanted == data.prior.mode:
            other = adapter.fallback_mode
            text = f"Avoidance: {context.prior_mode} refused, {adapter.mode_name(other)} instead"
        data.request = ModeRequest(request.start, other, now_s)
        return [*self._requester.send(now_s), Notice(mavlink.MAV_SEVERITY_CRITICAL, text)]
