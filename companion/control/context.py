"""The aircraft on one tick, as all of the control room sees it, and what is sent to it while it is ours."""

from dataclasses import dataclass, replace

from companion.autopilots.adapter import Adapter, RefusedValue
from companion.control import suppressed_threats
from companion.control.mode_request import ModeRequest
from companion.control.rejoin import ControlParams
from companion.control.state_machine import ENTERING, Event, State, StateData, Supervisor, SupervisorParams
from companion.mavlink.dialect import Message
from companion.model import Decision, Guidance, Layer, Role
from companion.output.notice import AnyNotice
from companion.ownship.aircraft import Aircraft

# Messages for the autopilot and notices for the operator, in the order of sending.
Outgoing = list[Message | AnyNotice]

# Heartbeats come at least once a second; two may be lost.
_HEARTBEAT_RECENT_S = 3.2


@dataclass(slots=True)
class ControlContext:
    """The aircraft, the state machine, the operator's role and the present decision."""

    aircraft: Aircraft
    supervisor: Supervisor
    params: SupervisorParams
    role: Role
    decision: Decision
    control: ControlParams
    unheard: str | None = None  # in words: the last threat is not heard any more

    @property
    def data(self) -> StateData:
        """The data of the present state."""
        return self.supervisor.data

    @property
    def adapter(self) -> Adapter:
        """The adapter of our autopilot; RuntimeError while there is none."""
        adapter = self.aircraft.adapter
        if adapter is None:
            raise RuntimeError("no autopilot: the supervisor must not get here")
        return adapter

    @property
    def prior_mode(self) -> str:
        """Name of the mode in which the aircraft is given back."""
        return self.adapter.mode_name(self.data.prior.mode)

    @property
    def loss_mode(self) -> int | None:
        """The mode that the autopilot enters by itself without our setpoints; `None`: it stays in guided."""
        adapter = self.aircraft.adapter
        mode = None if adapter is None else adapter.setpoint_loss_mode()
        return None if adapter is None or mode == adapter.guided_mode else mode

    @property
    def in_loss_mode(self) -> bool:
        """Whether the autopilot entered the present mode by itself: it reports that as a failsafe."""
        aircraft = self.aircraft
        return aircraft.custom_mode == self.loss_mode and aircraft.flight_state.failsafe

    def fell_out(self, request: ModeRequest | None) -> bool:
        """Whether a change of mode began in the mode that the autopilot enters by itself."""
        return request is not None and request.start == self.loss_mode

    @property
    def clear(self) -> bool:
        """Whether nothing has to be avoided: no conflict, or only suppressed ones."""
        if self.decision.layer is Layer.CLEAR:
            return True
        return bool(self.data.suppressed_s) and suppressed_threats.covers(self.data, self.decision)

    @property
    def conflict(self) -> Event:
        """The event of the present conflict."""
        return Event.INNER_CONFLICT if self.decision.layer is Layer.INNER else Event.OUTER_CONFLICT


class Commanding:
    """Turns guidance into the adapter's messages, when they may be sent."""

    def __init__(self, context: ControlContext) -> None:
        self._context = context
        self._refused: list[RefusedValue] = []
        self.commanded: Guidance | None = None  # on this tick, while there is more to fly than straight on

    @property
    def may_fly(self) -> bool:
        """Whether guidance may be sent: we fly, and the heartbeat shows the guided mode."""
        return self._context.supervisor.flying and self._context.aircraft.guided

    def in_contact(self, now_s: float) -> bool:
        """Whether it is known now who has the aircraft; without contact nothing acts on it."""
        aircraft = self._context.aircraft
        recent = now_s - aircraft.heartbeat_s <= _HEARTBEAT_RECENT_S
        return recent and aircraft.resynchronized and aircraft.in_contact(now_s)

    def messages(
        self, guidance: Guidance | None, now_s: float, *, max_bank_rad: float, urgent: bool
    ) -> list[Message]:
        """The messages of this tick; without `guidance`, those that the state needs.

        `urgent`: a report of a threat was received since the last tick.
        """
        self.commanded = None
        aircraft, supervisor = self._context.aircraft, self._context.supervisor
        adapter, state = aircraft.adapter, supervisor.state
        if adapter is None or not supervisor.holds:
            return []
        level = aircraft.guidance_command(aircraft.present_guidance(), max_bank_rad=max_bank_rad)
        if level is None:
            return []
        if not self.in_contact(now_s) or now_s < supervisor.data.yields_until_s:
            return []
        if state in ENTERING:
            return adapter.entering(level, now_s)
        if state in (State.RELEASING, State.STOPPING) and aircraft.guided:
            return adapter.leaving(level, now_s)
        guidance = guidance or self._without_conflict()
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

    def _without_conflict(self) -> Guidance | None:
        """Guidance without a conflict: straight on to recover, or to where the former mode is entered."""
        context, state, rejoin = self._context, self._context.supervisor.state, self._context.data.rejoin
        if state is State.RECOVERING:
            return context.aircraft.present_guidance()
        return rejoin.guidance(context.aircraft) if state is State.RETURNING and rejoin is not None else None
