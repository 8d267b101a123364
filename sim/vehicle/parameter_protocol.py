"""The parameter protocol: list, read and set; each autopilot encodes values in its own way."""

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from companion.mavlink.dialect import Message, mavlink
from sim.vehicle.parameters import REAL32, Parameter, Parameters

_NO_INDEX = 65535  # PARAM_VALUE.param_index of a value that was not requested by index


class ParameterCoding(ABC):
    """Converts a parameter's value to and from the float of PARAM_VALUE and PARAM_SET."""

    # True: a changed value is announced with its index
    announces_index: ClassVar[bool] = False

    @abstractmethod
    def encode(self, parameter: Parameter) -> float:
        """The float in the message."""

    @abstractmethod
    def decode(self, parameter: Parameter, value: float, kind: int) -> float | None:
        """The value in a PARAM_SET of MAV_PARAM_TYPE `kind`; None if it is refused."""


class AsFloat(ParameterCoding):
    """ArduPilot's encoding: a value of any type as the number itself."""

    def encode(self, parameter: Parameter) -> float:
        """The value."""
        return parameter.value

    def decode(self, _parameter: Parameter, value: float, _kind: int) -> float | None:
        """The value."""
        return value


class Bytewise(ParameterCoding):
    """PX4's encoding: the four bytes of an integer in place of the float; the type must match."""

    announces_index: ClassVar[bool] = True

    def encode(self, parameter: Parameter) -> float:
        """The value, or the float with the integer's bytes."""
        if parameter.type == REAL32:
            return parameter.value
        (value,) = struct.unpack("<f", struct.pack("<i", int(parameter.value)))
        return float(value)

    def decode(self, parameter: Parameter, value: float, kind: int) -> float | None:
        """The value, or the integer with the float's bytes."""
        if kind != parameter.type:
            return None
        if kind == REAL32:
            return value
        (integer,) = struct.unpack("<i", struct.pack("<f", value))
        return float(integer)


class ParameterProtocol:
    """Serves one vehicle's parameters."""

    def __init__(
        self,
        parameters: Parameters,
        coding: ParameterCoding,
        send: Callable[[int, Message], None],
        send_all: Callable[[Message], None],
    ) -> None:
        """`send(channel, message)` answers, `send_all(message)` announces a changed parameter."""
        self._parameters = parameters
        self._coding = coding
        self._send = send
        self._send_all = send_all

    def receive(self, message: Message, channel: int) -> bool:
        """Handle a parameter message; True if it was a PARAM_SET of a known parameter."""
        kind = message.get_type()
        if kind == "PARAM_REQUEST_LIST":
            for parameter in self._parameters:
                self._send(channel, self._message(parameter, parameter.index))
        elif kind == "PARAM_REQUEST_READ":
            found = self._requested(message)
            if found is not None:
                self._send(channel, self._message(found, found.index))
        elif kind == "PARAM_SET":
            return self._set(message)
        return False

    def announce(self, parameter: Parameter) -> None:
        """Send a value on all channels."""
        index = parameter.index if self._coding.announces_index else _NO_INDEX
        self._send_all(self._message(parameter, index))

    def _requested(self, message: Message) -> Parameter | None:
        if message.param_index < 0:
            return self._parameters.find(message.param_id)
        return self._parameters.at(message.param_index)

    def _set(self, message: Message) -> bool:
        parameter = self._parameters.find(message.param_id)
        if parameter is None:
            return False
        value = self._coding.decode(parameter, message.param_value, message.param_type)
        if value is not None:
            self._parameters.set(parameter.name, value)
        self.announce(parameter)  # the answer is the present value, even if the new one was refused
        return True

    def _message(self, parameter: Parameter, index: int) -> Message:
        return mavlink.MAVLink_param_value_message(
            param_id=parameter.name.encode("ascii"),
            param_value=self._coding.encode(parameter),
            param_type=parameter.type,
            param_count=len(self._parameters),
            param_index=index,
        )
