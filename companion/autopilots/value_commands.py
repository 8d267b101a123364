"""Commands of one value each: sent on change, repeated slowly, and given up when they are refused."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from companion.autopilots.adapter import RefusedValue
from companion.autopilots.commands import Outcome
from companion.avoidance.envelope import Control
from companion.mavlink.dialect import mavlink
from companion.mavlink.facts import CommandResult
from companion.units import wrap_pi

# A command that is refused this many times in a row, with several values, is refused altogether.
_ALTOGETHER = 6


class _Sent(NamedTuple):
    value: float
    at_s: float


@dataclass(slots=True)
class _Refused:
    """A refused value: it is sent once more, moderated, and given up when it is refused again."""

    value: float
    given_up: bool = False


class _RefusedCommands:
    """Refusals by command; those in `off` are refused altogether, until the autopilot restarts."""

    def __init__(self) -> None:
        self.off: set[int] = set()
        self._values: dict[int, _Refused] = {}
        self._in_a_row: dict[int, int] = {}
        self._given_up: list[tuple[int, float]] = []

    def accepted(self, command: int) -> None:
        """Note that a command was obeyed."""
        self._in_a_row.pop(command, None)

    def refused(self, command: int, value: float) -> bool:
        """Note a refusal; whether the value is to be sent again, moderated."""
        self._in_a_row[command] = self._in_a_row.get(command, 0) + 1
        if self._in_a_row[command] >= _ALTOGETHER:
            self.off.add(command)
            return False
        known = self._values.get(command)
        if known is None or known.value != value:
            self._values[command] = _Refused(value)
            return True
        self.give_up(command, value)
        return False

    def give_up(self, command: int, value: float) -> None:
        """Give a value up; it is reported once."""
        known = self._values.get(command)
        if known is None or known.value != value or not known.given_up:
            self._values[command] = _Refused(value, given_up=True)
            self._given_up.append((command, value))

    def was_refused(self, command: int, value: float) -> bool:
        """Whether this value was refused last."""
        known = self._values.get(command)
        return known is not None and known.value == value

    def take_given_up(self) -> list[tuple[int, float]]:
        """Commands and values that were given up since the last call."""
        given_up, self._given_up = self._given_up, []
        return given_up

    def forget_values(self) -> None:
        """Forget refused values; what is refused altogether stays so."""
        self._values.clear()
        self._in_a_row.clear()
        self._given_up.clear()


class ValueCommands:
    """What was sent last of each command in `controls`, and what of it was refused.

    A refused value is sent once more, moderated, and then given up. A command that is unsupported, or refused
    with every value, is off until the autopilot restarts.
    """

    def __init__(self, controls: Mapping[int, Control]) -> None:
        self._controls = controls
        self._sent: dict[int, _Sent] = {}
        self._refusals = _RefusedCommands()

    @property
    def off(self) -> frozenset[int]:
        """The commands that are refused altogether."""
        return frozenset(self._refusals.off)

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
        if command in self._refusals.off:
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
        return self._refusals.was_refused(command, value)

    def answered(self, fact: CommandResult, outcome: Outcome | None) -> None:
        """Process the answer to a command that was under way."""
        if fact.command not in self._controls:
            return
        if outcome is Outcome.ACCEPTED:
            self._refusals.accepted(fact.command)
        elif outcome is Outcome.REFUSED and fact.result == mavlink.MAV_RESULT_UNSUPPORTED:
            self._refusals.off.add(fact.command)
        elif outcome is Outcome.REFUSED:
            self.refused(fact.command)

    def refused(self, command: int) -> None:
        """Note that the value sent last is refused."""
        sent = self._sent.get(command)
        if sent is not None and self._refusals.refused(command, sent.value):
            del self._sent[command]  # so that it is sent again

    def give_up(self, command: int) -> None:
        """Note that the value sent last is acknowledged, and not flown."""
        sent = self._sent.get(command)
        if sent is not None:
            self._refusals.give_up(command, sent.value)

    def resend(self, command: int) -> None:
        """Send the value again at the next opportunity."""
        self._sent.pop(command, None)

    def forget(self) -> None:
        """Forget the values sent and refused; what is refused altogether stays so."""
        self._sent.clear()
        self._refusals.forget_values()

    def restarted(self) -> None:
        """Forget what is refused altogether."""
        self._refusals.off.clear()

    def refused_values(self) -> list[RefusedValue]:
        """Values that were given up since the last call."""
        return [RefusedValue(self._controls[kind], value) for kind, value in self._refusals.take_given_up()]
