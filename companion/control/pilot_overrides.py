"""Who else has the aircraft: everything that ends ours."""

from collections.abc import Iterable

from companion.control.mode_request import ModeRequest, Progress
from companion.control.state_machine import Event
from companion.model import PriorFlightState
from companion.ownship.aircraft import Aircraft


class PilotOverrides:
    """Watches for it while we have the aircraft, or are on our way from or to that."""

    def __init__(self, aircraft: Aircraft) -> None:
        self._aircraft = aircraft
        self._ignored: frozenset[Event] = frozenset()

    def begin(self, ignored: Iterable[Event] = ()) -> None:
        """From now on. What is `ignored` counts only when it has ceased and come again."""
        self._ignored = frozenset(ignored)
        self._aircraft.sticks.mark()
        self._aircraft.target_while_ours = None

    @property
    def overlooked(self) -> bool:
        """Whether somebody else has it by what is ignored, so that it may be given back, but not flown."""
        return bool(self._ignored)

    def made(self, request: ModeRequest | None, before: PriorFlightState) -> list[Event]:
        """All that says that somebody else has the aircraft now; `request` is ours that is under way."""
        aircraft = self._aircraft
        claims = (
            (Event.DISARMED, not aircraft.armed),
            (Event.LANDING, aircraft.landing()),
            (Event.FAILSAFE, aircraft.failsafe),
            (Event.FENCE, aircraft.fence_breached),
            (Event.STICKS, aircraft.sticks.moved),
            (Event.MODE_CHANGED, self._overruled(request, before)),
        )
        happened = [event for event, is_so in claims if is_so]
        self._ignored = self._ignored.intersection(happened)
        return [event for event in happened if event not in self._ignored]

    def _overruled(self, request: ModeRequest | None, before: PriorFlightState) -> bool:
        """Whether somebody else changed the mode, or, in the guided one, what it flies to."""
        aircraft, adapter = self._aircraft, self._aircraft.adapter
        if request is not None:
            return request.progress(aircraft.custom_mode, aircraft.heartbeat_s) is Progress.OVERRULED
        was_guided = adapter is not None and before.mode == adapter.guided_mode
        return not aircraft.guided or (was_guided and aircraft.sent_elsewhere(before.target))
