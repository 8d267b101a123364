"""Sends the mode request that is under way, and processes the autopilot's answers."""

from companion.control.context import ControlContext, Outgoing
from companion.control.mode_request import ModeRequest
from companion.control.state_machine import ENTERING
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import CommandResult


class ModeRequester:
    """Works on `StateData.request`."""

    def __init__(self, context: ControlContext) -> None:
        self._context = context

    @property
    def request(self) -> ModeRequest:
        """The request under way; RuntimeError while there is none."""
        request = self._context.data.request
        if request is None:
            raise RuntimeError("no request under way: the supervisor must not get here")
        return request

    def send(self, now_s: float) -> Outgoing:
        """The messages of the request, if it is due (see `ModeRequest.due`)."""
        context, data, request = self._context, self._context.data, self.request
        aircraft, adapter = context.aircraft, context.adapter
        mode, contact = aircraft.flight_state.custom_mode, aircraft.contact
        if not contact.resynchronized or not request.due(mode, contact.heartbeat_s, now_s):
            return []
        entering = context.supervisor.state in ENTERING
        if entering:
            data.requested_s = now_s
        if not entering and request.wanted == data.prior.mode:
            return [*adapter.restore_mode(data.prior)]
        return [adapter.set_mode(request.wanted)]

    def answered(self, fact: CommandResult, now_s: float) -> None:
        """Process an acknowledgement; those of commands that change no mode go to the adapter."""
        context, data = self._context, self._context.data
        course = context.adapter.commands.is_pending(fact.command)  # a course by DO_REPOSITION
        if course or fact.command not in context.adapter.mode_commands:
            context.adapter.observe(fact, now_s)
        elif data.request is not None and fact.result == mavlink.MAV_RESULT_ACCEPTED:
            data.request.accepted(now_s)
        elif data.request is not None and fact.result != mavlink.MAV_RESULT_IN_PROGRESS:
            self._refused(data.request, fact, now_s)

    def _refused(self, request: ModeRequest, fact: CommandResult, now_s: float) -> None:
        entering, adapter = self._context.supervisor.state in ENTERING, self._context.adapter
        postponed = entering and fact.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        if postponed:
            request.postponed(now_s)
        else:
            request.refused(now_s)
        # If several requests were sent, another one may still be obeyed.
        answered = request.refusals + request.postponements >= request.tries
        if entering and answered and adapter.fall_back(request.postponements if postponed else 0):
            self._context.data.request = ModeRequest(
                request.start,
                adapter.guided_mode,
                now_s,
                delay_s=adapter.entry_s,
                in_failsafe=request.in_failsafe,
            )
        elif entering and not postponed:
            adapter.guided_mode_unsupported |= fact.result == mavlink.MAV_RESULT_UNSUPPORTED
            if request.refusals >= request.tries:
                self._context.data.forget_request()
