"""The signs that someone else has the aircraft, each of which ends our control."""

from collections.abc import Iterable

from companion.control.mode_request import Progress
from companion.control.state_machine import Event, StateData
from companion.ownship.aircraft import Aircraft


class PilotOverrides:
    """Looks for overrides while we have the aircraft, or are about to take it or give it back."""

    def __init__(self, aircraft: Aircraft) -> None:
        self._aircraft = aircraft

    def begin(self, data: StateData, overlooked: Iterable[Event] = ()) -> None:
        """Start looking. An override that is `overlooked` counts only after it has ceased."""
        data.overlooked = frozenset(overlooked)
        self._aircraft.sticks.mark()
        self._aircraft.target_while_ours = None

    def current(self, data: StateData) -> list[Event]:
        """Every sign that someone else has the aircraft now."""
        aircraft = self._aircraft
        signs = (
            (Event.DISARMED, not aircraft.armed),
            (Event.LANDING, aircraft.landing()),
            (Event.FAILSAFE, aircraft.failsafe),
            (Event.FENCE, aircraft.fence_breached),
            (Event.STICKS, aircraft.sticks.moved),
            (Event.MODE_CHANGED, self._is_overruled(data)),
        )
        present = [event for event, is_present in signs if is_present]
        data.overlooked = data.overlooked.intersection(present)
        return [event for event in present if event not in data.overlooked]

    def _is_overruled(self, data: StateData) -> bool:
        """Whether someone else changed the mode, or gave the guided mode another target."""
        aircraft, adapter = self._aircraft, self._aircraft.adapter
        if data.request is not None:
            progress = data.request.progress(aircraft.custom_mode, aircraft.heartbeat_s)
            return progress is Progress.OVERRULED
        was_guided = adapter is not None and data.prior.mode == adapter.guided_mode
        if not aircraft.guided:
            return True
        target = aircraft.target_while_ours
        if adapter is not None and target is not None and adapter.is_own_target(target):
            return False
        return was_guided and aircraft.redirected_from(data.prior.target)
