"""The command protocol: requests to us (COMMAND_LONG, COMMAND_INT) and answers to ours (COMMAND_ACK)."""

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import CommandRequest, CommandResult, Fact, Sender
from companion.mavlink.translate.wire import Translation, finite, target_of


def _command_request(message: Message, sender: Sender, _received_s: float) -> Fact:
    params = finite(message.param1), finite(message.param2), finite(message.param3), finite(message.param4)
    return CommandRequest(sender, target_of(message), message.command, params)


def _command_result(message: Message, sender: Sender, _received_s: float) -> Fact:
    """The target fields are 0 in MAVLink 1, and from senders that do not fill them in."""
    target = target_of(message) if message.target_system else None
    return CommandResult(sender, message.command, message.result, target)


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG: _command_request,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT: _command_request,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK: _command_result,
}
