"""Gives the aircraft back after the engine has failed: without the engine, and never against the pilot."""

from collections.abc import Iterator

from companion.control.context import CLAIMS, Claim, Consequence
from companion.control.mode_request import EVIDENCE_S, ModeRequest
from companion.control.state_machine import FLYING, HELD, Event, State, Supervisor
from companion.mavlink.dialect import Message
from companion.mavlink.facts import Fact, Heartbeat
from companion.ownship.aircraft import Aircraft

# The mode is followed here without the engine; the other claims delay the release for as long as they hold.
_CLAIMS = tuple(
    claim
    for claim in CLAIMS
    if claim.consequence is Consequence.HANDS_OFF and claim.event is not Event.MODE_CHANGED
)


class EmergencyRelease:
    """Requests the former mode while the newest heartbeat shows the guided mode.

    It goes on observing facts: once the guided mode has been left, no mode is requested any more.
    """

    def __init__(self, aircraft: Aircraft, supervisor: Supervisor, now_s: float) -> None:
        self._aircraft = aircraft
        self._adapter = aircraft.adapter
        self._data = supervisor.data
        self._prior = supervisor.data.prior
        self._mode, self._heartbeat_s = aircraft.flight_state.custom_mode, aircraft.contact.heartbeat_s
        self._was_guided = supervisor.state in FLYING
        self._request: ModeRequest | None = None
        held = supervisor.state in HELD or supervisor.state is State.STOPPING
        if held and self._adapter is not None:
            self._adapter.drop_commands()
            self._request = ModeRequest(
                self._adapter.guided_mode, self._prior.mode, now_s, delay_s=self._adapter.exit_s
            )
        self._note_mode()

    @property
    def finished(self) -> bool:
        """Whether the aircraft is not ours any more, and all parameters that we changed are restored."""
        return self._request is None and not (self._adapter is not None and self._adapter.changed_parameters)

    def observe(self, fact: Fact, now_s: float) -> None:
        """Process a fact."""
        if self._adapter is None or fact.sender != self._adapter.target:
            return
        if isinstance(fact, Heartbeat):
            self._mode, self._heartbeat_s = fact.custom_mode, now_s
            self._note_mode()
        self._adapter.observe(fact, now_s)
        self._aircraft.observe(fact, now_s)  # last: it may be what failed

    def messages(self, now_s: float) -> Iterator[Message]:
        """The messages to send now, one by one, as any step may fail; call this ten times a second."""
        adapter, request = self._adapter, self._request
        if adapter is None:
            return
        fresh = 0.0 <= now_s - self._heartbeat_s <= EVIDENCE_S and self._aircraft.contact.resynchronized
        claimed = any(self._holds(claim, now_s) for claim in _CLAIMS)
        if request is not None and fresh and not claimed and adapter.is_guided(self._mode):
            if request.due(self._mode, self._heartbeat_s, now_s):
                yield from adapter.restore_mode(self._prior)
            level = self._aircraft.kinematics.command(self._aircraft.kinematics.guidance(), max_bank_rad=0.0)
            if level is not None:
                yield from adapter.leaving(level, now_s)
        yield from adapter.tick(now_s)

    def _holds(self, claim: Claim, now_s: float) -> bool:
        """Whether a claim holds; one that cannot be judged any more, as that may be what failed, does not."""
        if claim.event in self._data.overlooked:
            return False
        try:
            return claim.holds(self._aircraft, self._data, now_s)
        except Exception:  # noqa: BLE001 - after a bug, in the last seconds of the service
            return False

    def _note_mode(self) -> None:
        """End the request when the guided mode has been left, or someone chose another mode than ours."""
        guided = self._adapter is not None and self._adapter.is_guided(self._mode)
        if not guided and (self._was_guided or self._mode != self._prior.mode):
            self._request = None
        self._was_guided |= guided
