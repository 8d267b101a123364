"""The guided mode with nobody flying it: entered late, left behind by a crash, or abandoned."""

import math

from companion.control.state_machine import Event, State
from companion.gcs.settings import Settings
from companion.model import PriorFlightState
from companion.output.persisted_state import PersistedState
from companion.ownship.aircraft import Aircraft

# A request that was given up may still arrive, on a slow link.
_LATE_S = 6.0
# Time enough to hear whether the controller of an aircraft that was left behind is well.
_FOUND_AFTER_S = 1.0


class UnattendedGuided:
    """Looks for them while we have nothing to do with the aircraft. `before` is what to go back to."""

    def __init__(self, aircraft: Aircraft, settings: Settings) -> None:
        self._aircraft = aircraft
        self._settings = settings
        self._asked_s = -math.inf
        self._other_mode = 0  # the last one heard that was not the guided one
        self._abandoned_since_s: float | None = None
        self._held: PersistedState | None = None
        self._held_since_s: float | None = None
        self.before = PriorFlightState(0)

    def asked(self, now_s: float) -> None:
        """The guided mode was asked for."""
        self._asked_s = now_s

    def settled(self) -> None:
        """No request for the guided mode is under way any more."""
        self._asked_s = -math.inf

    def expect(self, held: PersistedState) -> None:
        """A former run was killed while it had the aircraft."""
        self._held = held if held.before is not None else None

    def observe(self) -> None:
        """Take note of the mode, at every tick."""
        if not self._aircraft.guided:
            self._other_mode = self._aircraft.custom_mode

    def seen(self, state: State, now_s: float, *, was_guided: bool) -> Event | None:
        """What is to be put right; `was_guided`: since our last take-over it never left the guided mode."""
        aircraft = self._aircraft
        if self._held is not None:
            return self._left_behind(self._held, now_s)
        if not aircraft.guided or not aircraft.armed:
            self._abandoned_since_s = None
            return None
        if now_s - self._asked_s < _LATE_S:
            self.before = PriorFlightState(self._other_mode)
            return Event.LATE
        if state is not State.HANDS_OFF or not was_guided:
            return None
        # As long as the pilot flies by his sticks, or it lands, it is not abandoned.
        busy = aircraft.sticks.moved or aircraft.landing()
        if busy or self._abandoned_since_s is None:
            self._abandoned_since_s = now_s
        return (
            Event.ABANDONED
            if now_s - self._abandoned_since_s >= self._settings.supervisor.abandoned_s
            else None
        )

    def _left_behind(self, held: PersistedState, now_s: float) -> Event | None:
        """Whether the aircraft is where a companion that was killed left it."""
        aircraft, adapter = self._aircraft, self._aircraft.adapter
        if not held.is_fresh(now_s) or held.before is None:
            self._held = None
            return None
        if adapter is None or not aircraft.heard(now_s):
            return None
        if self._held_since_s is None:
            self._held_since_s = now_s
        if now_s - self._held_since_s < _FOUND_AFTER_S:
            return None
        self._held = None
        if not aircraft.armed or aircraft.custom_mode not in (adapter.guided_mode, held.left_behind):
            return None
        self.before = held.before
        return Event.POISONED if adapter.setpoint_invalid(now_s) else Event.FOUND
