"""Messages about who controls what, to facts: sticks, attitude targets, times, and what others ask of us."""

import math

from companion.mavlink.dialect import Message, mavlink
from companion.mavlink.facts import (
    AttitudeTarget,
    AutopilotVersion,
    CommandRequest,
    Fact,
    ParameterRequest,
    ParameterSet,
    RcChannels,
    Sender,
    SystemTime,
)
from companion.mavlink.translate.answers import parameter_value
from companion.mavlink.translate.wire import Translation, printable

_NO_PULSE = (0, 65_535)
_CHANNELS = tuple(f"chan{number}_raw" for number in range(1, 19))
_YEAR_2015_S = 1_420_070_400.0  # a clock that says less was never set
_RELEASES = {0: "dev", 64: "alpha", 128: "beta", 192: "rc", 255: ""}


def _rc_channels(message: Message, sender: Sender, _received_s: float) -> Fact:
    pulses = (getattr(message, name) for name in _CHANNELS[: message.chancount])
    return RcChannels(sender, tuple(None if pulse in _NO_PULSE else pulse for pulse in pulses))


def _attitude_target(message: Message, sender: Sender, _received_s: float) -> Fact:
    return AttitudeTarget(sender, all(math.isfinite(part) for part in message.q))


def _system_time(message: Message, sender: Sender, _received_s: float) -> Fact:
    unix_s = message.time_unix_usec / 1e6
    return SystemTime(sender, unix_s if unix_s > _YEAR_2015_S else None)


def _autopilot_version(message: Message, sender: Sender, _received_s: float) -> Fact:
    number = message.flight_sw_version
    release = _RELEASES.get(number & 0xFF, "")
    major, minor = number >> 24 & 0xFF, number >> 16 & 0xFF
    version = f"{major}.{minor}.{number >> 8 & 0xFF}{release}"
    return AutopilotVersion(sender, version, major, minor, message.capabilities)


def _command_request(message: Message, sender: Sender, _received_s: float) -> Fact:
    first, second, third, fourth = (
        param if math.isfinite(param) else None
        for param in (message.param1, message.param2, message.param3, message.param4)
    )
    return CommandRequest(sender, _target(message), message.command, (first, second, third, fourth))


def _parameter_list(message: Message, sender: Sender, _received_s: float) -> Fact:
    return ParameterRequest(sender, _target(message), None, None)


def _parameter_read(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    if message.param_index >= 0:
        return ParameterRequest(sender, _target(message), None, message.param_index)
    name = printable(message.param_id)
    return None if name is None else ParameterRequest(sender, _target(message), name, None)


def _parameter_set(message: Message, sender: Sender, _received_s: float) -> Fact | None:
    name = printable(message.param_id)
    if name is None:
        return None
    value = parameter_value(message.param_value, message.param_type)
    return ParameterSet(sender, _target(message), name, value)


def _target(message: Message) -> Sender:
    return Sender(message.target_system, message.target_component)


TRANSLATIONS: dict[int, Translation] = {
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: _rc_channels,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: _attitude_target,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _autopilot_version,
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG: _command_request,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT: _command_request,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: _parameter_list,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: _parameter_read,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: _parameter_set,
}
