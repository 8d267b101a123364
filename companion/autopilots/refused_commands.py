"""Commands that an autopilot refuses: single values of them, or altogether."""

from dataclasses import dataclass

# A command that is refused this many times in a row, with several values, is refused altogether.
_ALTOGETHER = 6


@dataclass(slots=True)
class _Refused:
    """A refused value: it is sent once more, moderated, and given up when it is refused again."""

    value: float
    given_up: bool = False


class RefusedCommands:
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
        if not known.given_up:
            known.given_up = True
            self._given_up.append((command, value))
        return False

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
