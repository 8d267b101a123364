"""What the operator may ask of us over MAVLink: our role (off, advise, fly), by parameter or by command."""

from collections.abc import Callable

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandRequest, Fact, ParameterRequest, ParameterSet, Sender
from companion.supervisor import Role

PARAMETER = "CA_ROLE"
_ALL_COMPONENTS = 0


class Operator:
    """Holds the role, and answers who asks for it. `address` is ours.

    The parameter CA_ROLE is 0 (off), 1 (advise) or 2 (fly); the command is MAV_CMD_DO_SET_MODE, addressed to
    our component and no other, with the role as its custom mode. HEARTBEAT.custom_mode shows it.
    """

    def __init__(self, role: Role, address: Callable[[], Sender]) -> None:
        self.role = role
        self.at_most = Role.FLY  # whatever anybody asks for
        self._configured = role
        self._address = address

    @property
    def changed_to(self) -> Role | None:
        """The role, if it is no more the one that was configured."""
        return None if self.role is self._configured else self.role

    def receive(self, fact: Fact) -> list[Message]:
        """Do what is asked; the answers to send. What is not for us is not answered."""
        match fact:
            case CommandRequest() if fact.target == self._address():
                return [self._command(fact)]
            case ParameterSet() if fact.target == self._address():
                if fact.name != PARAMETER:
                    return []
                self._assign(fact.value)
                return [self._value()]
            case ParameterRequest() if self._is_ours(fact.target) and self._is_meant(fact):
                return [self._value()]
            case _:
                return []

    def _command(self, fact: CommandRequest) -> Message:
        result = mavlink.MAV_RESULT_UNSUPPORTED
        if fact.command == mavlink.MAV_CMD_DO_SET_MODE:
            base, role = fact.params[0], fact.params[1]
            custom = base is not None and int(base) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            accepted = bool(custom) and role is not None and self._assign(role)
            result = mavlink.MAV_RESULT_ACCEPTED if accepted else mavlink.MAV_RESULT_DENIED
        return mavlink.MAVLink_command_ack_message(
            fact.command, result, 0, 0, fact.sender.system_id, fact.sender.component_id
        )

    def _assign(self, value: float) -> bool:
        if value not in list(Role) or value > self.at_most:
            return False
        self.role = Role(int(value))
        return True

    def _value(self) -> Message:
        return mavlink.MAVLink_param_value_message(
            PARAMETER.encode("ascii"), float(self.role), mavlink.MAV_PARAM_TYPE_REAL32, 1, 0
        )

    def _is_ours(self, target: Sender) -> bool:
        own = self._address()
        return target.system_id in (0, own.system_id) and target.component_id in (
            _ALL_COMPONENTS,
            own.component_id,
        )

    def _is_meant(self, fact: ParameterRequest) -> bool:
        """The list, or our one parameter; a read that is meant for every component is the autopilot's."""
        if fact.name is None and fact.index is None:
            return True
        return fact.target == self._address() and (fact.name == PARAMETER or fact.index == 0)
