"""Requests of the operator over MAVLink: settings as parameters, our role, resuming the mission."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace

from companion.gcs.parameters import BY_NAME, GCS_PARAMETERS, INDEX, GcsParam
from companion.gcs.settings import Settings
from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandRequest, Fact, ParameterRequest, ParameterSet, Sender
from companion.model import Role

ROLE = "CA_ROLE"
_ALL_COMPONENTS = 0
# On a slow link the list must leave room for everything else: at most this many parameters in one tick.
_LISTED_AT_ONCE = 10
_LIST_INTERVAL_S = 0.1
# Commands whose results are known, for copies of them.
_RESULTS_KNOWN = 64


def role_request(us: Sender, role: Role) -> Message:
    """MAV_CMD_DO_SET_MODE with our role, as a ground station sends it to us."""
    custom_mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return mavlink.MAVLink_command_long_message(
        us.system_id, us.component_id, mavlink.MAV_CMD_DO_SET_MODE, 0, custom_mode, role, *[0.0] * 5
    )


class GcsRequests:
    """Holds the role and answers requests; `address` returns our own address.

    The parameters are those of `GCS_PARAMETERS`. Two commands are accepted when they are addressed to our
    component: MAV_CMD_DO_SET_MODE with the role as its custom mode, which HEARTBEAT.custom_mode shows, and
    MAV_CMD_DO_PAUSE_CONTINUE with 1, which resumes the mission now, conflict or not. A repeated command has
    the same effect and the same answer, so that a lost answer does no harm.
    """

    def __init__(
        self,
        settings: Settings,
        address: Callable[[], Sender],
        may_resume: Callable[[], bool] = lambda: False,
    ) -> None:
        self.settings = settings
        self.role = Role[settings.supervisor.role.upper()]
        self.at_most = Role.FLY  # the highest role that may be requested
        self.refusals: list[str] = []  # for the operator, until they are announced
        self.changes: list[str] = []
        self._configured = self.role
        self._address = address
        self._may_resume = may_resume
        self._resumes = False
        self._listing: deque[GcsParam] = deque()
        self._list_again = False  # the list was requested while it was sent
        self._results: deque[tuple[CommandRequest, int]] = deque(maxlen=_RESULTS_KNOWN)
        self._listed_s = -math.inf

    @property
    def changed_to(self) -> Role | None:
        """The role, if it differs from the configured one."""
        return None if self.role is self._configured else self.role

    def receive(self, fact: Fact) -> list[Message]:
        """Carry out a request; returns the answers to send, none to a request that is not for us."""
        match fact:
            case CommandRequest() if fact.target == self._address():
                result = self._known_result(fact) if fact.is_copy else self._command(fact)
                return [] if result is None else [_acknowledgement(fact, result)]
            case ParameterSet() if fact.target == self._address() and fact.name in BY_NAME:
                parameter = BY_NAME[fact.name]
                self._put(parameter, fact.value)
                return [self._value(parameter)]
            case ParameterRequest(name=None, index=None) if self._is_ours(fact.target):
                # A list is finished before it begins again: stations that ask often would never get its end.
                self._list_again = bool(self._listing)
                self._listing = self._listing or deque(GCS_PARAMETERS)
            case ParameterRequest() if fact.target == self._address():
                # A read that is addressed to all components is for the autopilot.
                return [self._value(parameter) for parameter in _meant(fact)]
            case _:
                pass
        return []

    def listed(self, now_s: float) -> list[Message]:
        """The next parameters of a requested list."""
        if not self._listing or 0.0 <= now_s - self._listed_s < _LIST_INTERVAL_S - 1e-3:
            return []
        self._listed_s = now_s
        due = min(_LISTED_AT_ONCE, len(self._listing))
        values = [self._value(self._listing.popleft()) for _ in range(due)]
        if not self._listing and self._list_again:
            self._listing, self._list_again = deque(GCS_PARAMETERS), False
        return values

    def take_resume(self) -> bool:
        """Whether the mission is to be resumed now; true once for each request."""
        resumes, self._resumes = self._resumes, False
        return resumes

    def _command(self, fact: CommandRequest) -> int:
        """Carry out a command, and remember its MAV_RESULT for copies of it."""
        match fact.command:
            case mavlink.MAV_CMD_DO_SET_MODE:
                result = _accepted(self._set_mode(*fact.params[:2]))
            case mavlink.MAV_CMD_DO_PAUSE_CONTINUE:
                result = _accepted(self._resume(fact.params[0]))
            case _:
                result = mavlink.MAV_RESULT_UNSUPPORTED
        self._results.append((fact, result))
        return result

    def _known_result(self, copy: CommandRequest) -> int | None:
        """The result of the command of which this is a copy; `None` if it is not known any more.

        When another role was set since, this one is not accepted now.
        """
        found = [result for fact, result in self._results if replace(fact, is_copy=True) == copy]
        if not found:
            return None
        undone = copy.command == mavlink.MAV_CMD_DO_SET_MODE and copy.params[1] != self.role
        accepted = found[-1] == mavlink.MAV_RESULT_ACCEPTED
        return mavlink.MAV_RESULT_TEMPORARILY_REJECTED if accepted and undone else found[-1]

    def _set_mode(self, base: float | None, role: float | None) -> bool:
        """Set the role for this run; the parameter sets it for later runs too."""
        custom = base is not None and int(base) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if not custom or role not in list(Role) or role > self.at_most:
            return False
        self.role = Role(int(role))
        return True

    def _resume(self, continues: float | None) -> bool:
        if continues != 1.0 or not self._may_resume():
            return False  # pausing is not offered: the pilot can take the aircraft
        self._resumes = True
        return True

    def _put(self, parameter: GcsParam, value: float | None) -> None:
        before = self._shown(parameter)
        try:
            if parameter.name == ROLE and value in list(Role) and value > self.at_most:
                raise ValueError(f"at most {self.at_most:d}")
            self.settings.put(parameter, value)
        except ValueError as error:
            got = "no number" if value is None else f"{value:g}"
            self.refusals.append(f"{parameter.name} {got} refused: {error}")
            return
        if parameter.name == ROLE:
            self.role = Role[self.settings.supervisor.role.upper()]
        after = self._shown(parameter)
        if after != before:
            self.changes.append(f"{parameter.name} {parameter.shown(after)}, was {before:g}")

    def _shown(self, parameter: GcsParam) -> float:
        return float(self.role) if parameter.name == ROLE else parameter.value(self.settings.config)

    def _value(self, parameter: GcsParam) -> Message:
        return mavlink.MAVLink_param_value_message(
            parameter.name.encode("ascii"),
            self._shown(parameter),
            mavlink.MAV_PARAM_TYPE_REAL32,
            len(GCS_PARAMETERS),
            INDEX[parameter.name],
        )

    def _is_ours(self, target: Sender) -> bool:
        own = self._address()
        return target.system_id in (0, own.system_id) and target.component_id in (
            _ALL_COMPONENTS,
            own.component_id,
        )


def _acknowledgement(fact: CommandRequest, result: int) -> Message:
    sender = fact.sender
    return mavlink.MAVLink_command_ack_message(
        fact.command, result, 0, 0, sender.system_id, sender.component_id
    )


def _meant(fact: ParameterRequest) -> list[GcsParam]:
    """The parameter that is requested, if there is one of that name or index."""
    if fact.name is not None:
        return [BY_NAME[fact.name]] if fact.name in BY_NAME else []
    assert fact.index is not None
    return [GCS_PARAMETERS[fact.index]] if fact.index < len(GCS_PARAMETERS) else []


def _accepted(done: bool) -> int:
    result: int = mavlink.MAV_RESULT_ACCEPTED if done else mavlink.MAV_RESULT_DENIED
    return result
