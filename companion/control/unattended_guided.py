"""An aircraft in the guided mode that no one flies: entered late, left by a crash, or abandoned."""

from companion.control.context import ControlContext
from companion.control.state_machine import Event, State
from companion.model import PriorFlightState
from companion.output.persisted_state import PersistedState

# A request that was given up may still arrive on a slow link.
_LATE_S = 6.0
# After this time it is known whether the attitude setpoint is valid.
_FOUND_AFTER_S = 1.0

# The event, and the flight to go back to; `None`: the one in `StateData.prior`.
Found = tuple[Event, PriorFlightState | None]


class UnattendedGuided:
    """Looks for such an aircraft while it is not ours."""

    def __init__(self, context: ControlContext) -> None:
        self._context = context

    def note_mode(self) -> None:
        """Remember the newest mode that is not the guided one, while the aircraft is not ours."""
        aircraft = self._context.aircraft
        if not aircraft.guided:
            self._context.data.last_unguided_mode = aircraft.custom_mode

    def found(self, now_s: float) -> Found | None:
        """The event found now, if any, and the flight to go back to."""
        context, data = self._context, self._context.data
        aircraft = context.aircraft
        if data.left_behind is not None:
            return self._left_behind(data.left_behind, now_s)
        if not aircraft.guided or not aircraft.armed:
            data.unattended_since_s = None
            return None
        if now_s - data.requested_s < _LATE_S:
            return Event.LATE, PriorFlightState(data.last_unguided_mode)
        if context.supervisor.state is not State.HANDS_OFF or data.guided_since_s is None:
            return None
        # While the pilot flies with the sticks, or the aircraft lands, it is not abandoned.
        attended = aircraft.sticks.moved or aircraft.landing()
        if attended or data.unattended_since_s is None:
            data.unattended_since_s = now_s
        abandoned = now_s - data.unattended_since_s >= context.params.abandoned_s
        return (Event.ABANDONED, None) if abandoned else None

    def _left_behind(self, left: PersistedState, now_s: float) -> Found | None:
        """The event, if the aircraft is in a mode in which a companion that was killed left it."""
        data, aircraft = self._context.data, self._context.aircraft
        adapter = aircraft.adapter
        if not left.is_fresh(now_s) or left.before is None:
            data.left_behind = None
            return None
        if adapter is None or not aircraft.heard(now_s):
            return None
        if data.left_behind_since_s is None:
            data.left_behind_since_s = now_s
        if now_s - data.left_behind_since_s < _FOUND_AFTER_S:
            return None
        data.left_behind = None
        if not aircraft.armed or aircraft.custom_mode not in (adapter.guided_mode, left.left_behind):
            return None
        return Event.INVALID_OUTSIDE if adapter.setpoint_invalid(now_s) else Event.FOUND, left.before
