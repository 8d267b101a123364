"""Commands that are repeated until COMMAND_ACK answers them, and their outcomes."""

from dataclasses import dataclass
from enum import Enum

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandResult

_RESEND_S = 0.5
_TRIES = 6
# After IN_PROGRESS the autopilot works on the command: it is repeated only after this time.
_IN_PROGRESS_S = 5.0


_RESULTS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "temporarily rejected",
    mavlink.MAV_RESULT_DENIED: "denied: bad value",
    mavlink.MAV_RESULT_UNSUPPORTED: "unsupported",
    mavlink.MAV_RESULT_FAILED: "failed",
    6: "cancelled",
    7: "only as COMMAND_LONG",
    8: "only as COMMAND_INT",
    9: "wrong frame",
}


def _name(command: int) -> str:
    """The command's name without its prefixes."""
    entry = mavlink.enums["MAV_CMD"].get(command)
    return f"command {command}" if entry is None else str(entry.name).removeprefix("MAV_CMD_")


class Outcome(Enum):
    """The state of the last command of a kind."""

    PENDING = "pending"
    ACCEPTED = "accepted"
    REFUSED = "refused"
    UNANSWERED = "unanswered"


@dataclass(slots=True)
class _Pending:
    message: Message
    tries: int
    next_s: float


class CommandRetrier:
    """At most one command of each kind (MAV_CMD number) under way; a newer one replaces the older.

    The newer command inherits the number of tries; otherwise a command that is renewed often would never be
    found unanswered. COMMAND_LONG counts its repetitions in `confirmation`, as the protocol requires.
    """

    def __init__(self) -> None:
        self._pending: dict[int, _Pending] = {}
        self._outcomes: dict[int, Outcome] = {}
        # Commands that were refused or never answered, in words; the reader empties the list.
        self.refusals: list[str] = []

    def ask(self, message: Message, now_s: float) -> Message:
        """The message to send now; it is repeated until it is answered."""
        older = self._pending.get(message.command)
        tries = 1 if older is None else min(older.tries + 1, _TRIES)
        self._pending[message.command] = _Pending(message, tries, now_s + _RESEND_S)
        self._outcomes[message.command] = Outcome.PENDING
        return message

    def outcome(self, command: int) -> Outcome | None:
        """The outcome of the last command of this kind; `None` when none was sent."""
        return self._outcomes.get(command)

    def is_pending(self, command: int) -> bool:
        """Whether a command of this kind is under way."""
        return command in self._pending

    def answered(self, fact: CommandResult, now_s: float) -> None:
        """Process an acknowledgement; one without a command under way is ignored."""
        pending = self._pending.get(fact.command)
        if pending is None:
            return
        if fact.result == mavlink.MAV_RESULT_IN_PROGRESS:
            pending.next_s = now_s + _IN_PROGRESS_S
            return
        if fact.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
            return  # repeated at the usual rate until the tries are used up
        accepted = fact.result == mavlink.MAV_RESULT_ACCEPTED
        if not accepted:
            self.refusals.append(f"{_name(fact.command)} {_RESULTS.get(fact.result, fact.result)}")
        self._settle(fact.command, Outcome.ACCEPTED if accepted else Outcome.REFUSED)

    def due(self, now_s: float) -> list[Message]:
        """The commands to repeat now."""
        messages = []
        for command, pending in list(self._pending.items()):
            if now_s < pending.next_s:
                continue
            if pending.tries >= _TRIES:
                self.refusals.append(f"{_name(command)} not answered")
                self._settle(command, Outcome.UNANSWERED)
                continue
            if pending.message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_LONG:
                pending.message.confirmation = pending.tries
            pending.tries += 1
            pending.next_s = now_s + _RESEND_S
            messages.append(pending.message)
        return messages

    def drop(self, command: int) -> None:
        """Drop the command of this kind that is under way, if any."""
        self._pending.pop(command, None)

    def forget(self) -> None:
        """Drop all commands under way and all outcomes."""
        self._pending.clear()
        self._outcomes.clear()
        self.refusals.clear()

    def _settle(self, command: int, outcome: Outcome) -> None:
        self._pending.pop(command, None)
        self._outcomes[command] = outcome
