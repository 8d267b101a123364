"""Messages to the autopilot while the aircraft is ours: guidance, and setpoints around a mode change."""

from dataclasses import replace

from companion.autopilots.adapter import RefusedValue
from companion.control.handover import Handover
from companion.control.state_machine import ENTERING, State
from companion.mavlink.dialect import Message
from companion.model import Guidance
from companion.ownship.aircraft import Aircraft

# Heartbeats come at least once a second; two may be lost.
_HEARTBEAT_RECENT_S = 3.2


class Commanding:
    """Turns guidance into the adapter's messages, when they may be sent."""

    def __init__(self, aircraft: Aircraft, handover: Handover) -> None:
        self._aircraft = aircraft
        self._handover = handover
        self._refused: list[RefusedValue] = []
        self.commanded: Guidance | None = None  # on this tick, while there is more to fly than straight on

    @property
    def may_fly(self) -> bool:
        """Whether guidance may be sent: we fly, and the heartbeat shows the guided mode."""
        return self._handover.supervisor.flying and self._aircraft.guided

    def in_contact(self, now_s: float) -> bool:
        """Whether it is known now who has the aircraft; without contact nothing acts on it."""
        aircraft = self._aircraft
        recent = now_s - aircraft.heartbeat_s <= _HEARTBEAT_RECENT_S
        return recent and aircraft.resynchronized and aircraft.in_contact(now_s)

    def messages(
        self, guidance: Guidance | None, now_s: float, *, max_bank_rad: float, urgent: bool
    ) -> list[Message]:
        """The messages of this tick; without `guidance`, those that the state needs.

        `urgent`: a report of a threat was received since the last tick.
        """
        self.commanded = None
        adapter, aircraft, state = self._aircraft.adapter, self._aircraft, self._handover.supervisor.state
        if adapter is None or not self._handover.holds:
            return []
        level = aircraft.guidance_command(aircraft.present_guidance(), max_bank_rad=max_bank_rad)
        if level is None:
            return []
        if not self.in_contact(now_s) or now_s < self._handover.supervisor.data.yields_until_s:
            return []
        if state in ENTERING:
            return adapter.entering(level, now_s)
        if state in (State.RELEASING, State.STOPPING) and aircraft.guided:
            return adapter.leaving(level, now_s)
        guidance = guidance or self._handover.guidance()
        if not self.may_fly or guidance is None:
            return []
        self.commanded = None if state is State.RECOVERING else guidance
        messages = adapter.command(replace(level, guidance=guidance), now_s, urgent=urgent)
        self._refused += adapter.refused_values()
        return messages

    def take_refused(self) -> list[RefusedValue]:
        """The values that the autopilot has refused since the last call."""
        refused, self._refused = self._refused, []
        return refused
