"""Commands of one value each: sent on change, repeated slowly, and given up when they are refused."""

from collections.abc import Mapping
from typing import NamedTuple

from companion.autopilots.adapter import RefusedValue
from companion.autopilots.commands import Outcome
from companion.avoidance import Control
from companion.geodesy import wrap_pi
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import CommandResult

# A command that is refused this many times in a row, with several values, is refused altogether.
_ALTOGETHER = 6


class _Sent(NamedTuple):
    value: float
    at_s: float


class _Refused(NamedTuple):
    """A refused value: it is sent once more, moderated, and given up when it is refused again."""

    value: float
    given_up: bool = False


class ValueCommands:
    """What was sent last of each command in `controls`, and what of it was refused.

    A refused value is sent once more, moderated, and then given up. A command that is unsupported, or refused
    with every value, is off until the autopilot restarts.
    """

    def __init__(self, controls: Mapping[int, Control]) -> None:
        self._controls = controls
        self._sent: dict[int, _Sent] = {}
        self._refused: dict[int, _Refused] = {}
        self._refusals_in_a_row: dict[int, int] = {}
        self._given_up: list[RefusedValue] = []  # not reported yet
        self._off: set[int] = set()

    @property
    def off(self) -> frozenset[int]:
        """The commands that are refused altogether."""
        return frozenset(self._off)

    def was_sent(self, command: int) -> bool:
        """Whether a value of this command was sent."""
        return command in self._sent

    def is_due(
        self,
        command: int,
        value: float,
        now_s: float,
        change: float,
        repeat_s: float,
        *,
        circular: bool = False,
    ) -> bool:
        """Whether to send a value, because it changed or was sent long ago; if so, stores it as sent.

        Never for a command that is refused altogether.
        """
        if command in self._off:
            return False
        sent = self._sent.get(command)
        if sent is not None and now_s - sent.at_s < repeat_s:
            off = value - sent.value
            if abs(wrap_pi(off) if circular else off) <= change:
                return False
        self._sent[command] = _Sent(value, now_s)
        return True

    def was_refused(self, command: int, value: float) -> bool:
        """Whether this value was refused last."""
        refused = self._refused.get(command)
        return refused is not None and refused.value == value

    def answered(self, fact: CommandResult, outcome: Outcome | None) -> None:
        """Process the answer to a command that was under way."""
        if fact.command not in self._controls:
            return
        if outcome is Outcome.ACCEPTED:
            self._refusals_in_a_row.pop(fact.command, None)
        elif outcome is Outcome.REFUSED and fact.result == mavlink.MAV_RESULT_UNSUPPORTED:
            self._off.add(fact.command)
        elif outcome is Outcome.REFUSED:
            self.refused(fact.command)

    def refused(self, command: int) -> None:
        """Note that the value sent last is refused."""
        sent = self._sent.get(command)
        if sent is None:
            return
        in_a_row = self._refusals_in_a_row.get(command, 0) + 1
        self._refusals_in_a_row[command] = in_a_row
        if in_a_row >= _ALTOGETHER:
            self._off.add(command)
        elif self.was_refused(command, sent.value):
            self.give_up(command)
        else:
            self._refused[command] = _Refused(sent.value)
            self.resend(command)

    def give_up(self, command: int) -> None:
        """Give up the value sent last, refused twice or acknowledged and not flown; it is reported once."""
        sent = self._sent.get(command)
        if sent is None:
            return
        given_up = _Refused(sent.value, given_up=True)
        if self._refused.get(command) != given_up:
            self._refused[command] = given_up
            self._given_up.append(RefusedValue(self._controls[command], sent.value))

    def resend(self, command: int) -> None:
        """Send the value again at the next opportunity."""
        self._sent.pop(command, None)

    def forget(self) -> None:
        """Forget the values sent and refused; what is refused altogether stays so."""
        self._sent.clear()
        self._refused.clear()
        self._refusals_in_a_row.clear()
        self._given_up.clear()

    def restarted(self) -> None:
        """Forget what is refused altogether."""
        self._off.clear()

    def refused_values(self) -> list[RefusedValue]:
        """Values that were given up since the last call."""
        given_up, self._given_up = self._given_up, []
        return given_up
