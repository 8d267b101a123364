"""The context that all parts of the control room share on one tick."""

from dataclasses import dataclass

from companion.autopilots.adapter import Adapter
from companion.control import suppressed_threats
from companion.control.mode_request import ModeRequest
from companion.control.rejoin import ControlParams
from companion.control.state_machine import Event, StateData, Supervisor, SupervisorParams
from companion.mavlink.dialect import Message
from companion.model import Decision, Layer, Role
from companion.output.notice import AnyNotice
from companion.ownship.aircraft import Aircraft

# Messages for the autopilot and notices for the operator, in the order of sending.
Outgoing = list[Message | AnyNotice]


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
