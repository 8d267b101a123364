"""An aircraft in the guided mode that no one flies: entered late, left by a crash, or abandoned."""

from companion.control.context import ControlContext
from companion.control.state_machine import Event
from companion.model import PriorFlightState
from companion.output.persisted_state import PersistedState

# A request that was given up may still arrive on a slow link.
_LATE_S = 6.0
# After this time it is known whether the attitude setpoint is valid.
_FOUND_AFTER_S = 1.0
# Another mode that is shown for no longer than this, between two heartbeats with the guided one, was not
# chosen by anyone: no pilot is that fast.
FLICKER_S = 1.5
# An aircraft that enters the guided mode again has a new target, further than this from the former one; a
# target much further away was given to it by someone.
_SAME_TARGET_M, _OTHER_TARGET_M = 20.0, 100.0

# The event, and the flight to go back to; `None`: the one in `StateData.prior`.
Found = tuple[Event, PriorFlightState | None]


class UnattendedGuided:
    """Looks for such an aircraft while it is not ours."""

    def __init__(self, context: ControlContext) -> None:
        self._context = context

    def note_mode(self, now_s: float) -> None:
        """Follow the modes while the aircraft is not ours: is it in the guided mode by our doing?"""
        aircraft, data = self._context.aircraft, self._context.data
        if aircraft.flight_state.custom_mode != data.fallback:
            data.fallback = None
        if not aircraft.guided:
            data.last_unguided_mode = aircraft.flight_state.custom_mode
            if data.left_guided_s is None:
                data.left_guided_s = aircraft.contact.heartbeat_s
            self._note_fall()
            return
        data.away_s = None
        if data.left_guided_s is None:
            data.seen_guided = data.guided_since_s is not None
            return
        # The guided mode came back: it is someone's choice, unless it had not been left at all.
        flickered = aircraft.contact.heartbeat_s - data.left_guided_s <= FLICKER_S
        moved_m = aircraft.navigation.from_guided_target_m(now_s)
        same_target = moved_m is not None and moved_m <= _SAME_TARGET_M
        if data.guided_since_s is not None and (flickered or same_target):
            data.seen_guided = True
        else:
            data.guided_since_s = None
        data.left_guided_s = None

    def _note_fall(self) -> None:
        """Follow whether the present mode is the one that followed the guided mode by itself."""
        aircraft, data = self._context.aircraft, self._context.data
        if aircraft.flight_state.custom_mode != self._context.loss_mode:
            if data.away_s is None:
                data.away_s = aircraft.contact.heartbeat_s
            return
        chosen = not aircraft.flight_state.failsafe  # the end of our setpoints is reported as one
        if chosen or (data.away_s is not None and aircraft.contact.heartbeat_s - data.away_s > FLICKER_S):
            data.seen_guided = data.fell_out = False
        data.away_s = None
        data.fell_out |= data.seen_guided

    def nothing_is_left(self, now_s: float) -> bool:
        """Whether no earlier take-over has left anything, so that another way of flying may be chosen."""
        data = self._context.data
        awaited = data.left_behind is not None or now_s - data.requested_s < _LATE_S
        return data.guided_since_s is None and not awaited

    def is_left(self, now_s: float) -> bool:
        """Whether the aircraft is in the guided mode, or in the one that follows, by our doing."""
        aircraft, data = self._context.aircraft, self._context.data
        if aircraft.adapter is None:
            return False
        navigation = aircraft.navigation
        moved_m, target = navigation.from_guided_target_m(now_s), navigation.reported_target(now_s)
        redirected = self._context.adapter.keeps_guided_target and (moved_m or 0.0) > _OTHER_TARGET_M
        redirected |= target is not None and self._context.adapter.is_foreign_target(target)
        if not aircraft.flight_state.armed or data.guided_since_s is None or redirected:
            return False
        if self._context.loss_mode is not None:
            # It leaves the guided mode by itself; while it stays there, someone else sends setpoints.
            return data.fell_out and aircraft.flight_state.custom_mode == self._context.loss_mode
        return aircraft.guided

    def prior_if_left(self, now_s: float) -> PriorFlightState | None:
        """The flight to go back to, if the aircraft is left in the guided mode or may enter it late."""
        data = self._context.data
        if self._context.aircraft.adapter is None:
            return None
        if now_s - data.requested_s < _LATE_S:
            return PriorFlightState(data.last_unguided_mode)
        return data.prior if self.is_left(now_s) else None

    def found(self, now_s: float) -> Found | None:
        """The event found now, if any, and the flight to go back to."""
        context, data = self._context, self._context.data
        aircraft = context.aircraft
        if data.left_behind is not None:
            return self._left_behind(data.left_behind, now_s)
        if aircraft.guided and aircraft.flight_state.armed and now_s - data.requested_s < _LATE_S:
            return Event.LATE, PriorFlightState(data.last_unguided_mode)
        if not self.is_left(now_s):
            since_s = data.left_guided_s if data.away_s is None else data.away_s
            if since_s is None or aircraft.contact.heartbeat_s - since_s > FLICKER_S:
                data.unattended_since_s = None
            return None
        # While the pilot flies with the sticks, the aircraft lands, or nothing is heard, it is not abandoned.
        attended = (
            not aircraft.contact.in_contact(now_s)
            or aircraft.sticks.in_use(now_s)
            or aircraft.flight_state.landing
            or aircraft.identity.is_ambiguous(now_s)
        )
        # Who moved the sticks may have chosen the mode, too, that the autopilot enters by itself; and with a
        # failsafe of another kind, its choice cannot be told from that entry.
        attended |= data.fell_out and data.let_go in (Event.STICKS, Event.FAILSAFE)
        if attended or data.unattended_since_s is None:
            data.unattended_since_s = now_s
        abandoned = now_s - data.unattended_since_s >= context.params.abandoned_s
        # In a silence, someone may give it another target, which is heard only some time after it.
        known = not aircraft.contact.just_regained(now_s)
        return (Event.ABANDONED, None) if abandoned and known else None

    def _left_behind(self, left: PersistedState, now_s: float) -> Found | None:
        """The event, if the aircraft is in a mode in which a companion that was killed left it."""
        data, aircraft = self._context.data, self._context.aircraft
        adapter = aircraft.adapter
        if not left.is_fresh(now_s) or left.before is None:
            data.left_behind = None
            return None
        if adapter is None or not aircraft.contact.heard(now_s):
            return None
        if data.left_behind_since_s is None:
            data.left_behind_since_s = now_s
        if now_s - data.left_behind_since_s < _FOUND_AFTER_S:
            return None
        data.left_behind = None
        state = aircraft.flight_state
        if not state.armed or state.custom_mode not in (adapter.guided_mode, left.left_behind):
            return None
        return Event.INVALID_OUTSIDE if adapter.setpoint_invalid(now_s) else Event.FOUND, left.before
